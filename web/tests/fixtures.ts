/** What `tests/web_fixtures.py` wrote. */

import { readFileSync } from 'node:fs';
import { resolve } from 'node:path';

function pathOf(name: string): string {
  return resolve(import.meta.dirname, '../fixtures', name);
}

/** @typeParam T What the Python script wrote under this name. */
export function jsonFixture<T>(name: string): T {
  return JSON.parse(readFileSync(pathOf(name), 'utf8')) as T;
}

/** A copy of the file's bytes. */
export function fileFixture(name: string): ArrayBuffer {
  return Uint8Array.from(readFileSync(pathOf(name))).buffer;
}
