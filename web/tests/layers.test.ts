import { readdirSync, readFileSync } from 'node:fs';
import { dirname, join, relative, resolve } from 'node:path';
import { expect, test } from 'vitest';

const SRC = resolve(import.meta.dirname, '../src');

/** From each file to those it imports; types, workers and what is loaded later count too. */
type Imports = ReadonlyMap<string, readonly string[]>;

const SPECIFIER = /(?:\bfrom|\bimport|\bimport\(|\bnew URL\()\s*'(\.[^']+)'/g;

function importsOf(): Imports {
  const files = readdirSync(SRC, { recursive: true, encoding: 'utf8' })
    .filter((name) => name.endsWith('.ts'));
  const known = new Set(files);
  return new Map(files.map((file) => {
    const text = readFileSync(join(SRC, file), 'utf8');
    const found = Array.from(text.matchAll(SPECIFIER), ([, specifier = '']) =>
      relative(SRC, resolve(SRC, dirname(file), specifier)).replace(/(\.ts)?$/, '.ts'));
    return [file, found.filter((name) => known.has(name))];
  }));
}

/** Each circle as the files on the way round; empty when there is none. */
function circlesIn(imports: Imports): string[] {
  const done = new Set<string>();
  const circles: string[] = [];
  const visit = (file: string, path: readonly string[]): void => {
    const at = path.indexOf(file);
    if (at >= 0) circles.push([...path.slice(at), file].join(' → '));
    if (at >= 0 || done.has(file)) return;
    for (const next of imports.get(file) ?? []) visit(next, [...path, file]);
    done.add(file);
  };
  for (const file of imports.keys()) visit(file, []);
  return circles;
}

test('a circle of three is found', () => {
  const imports = new Map([['a', ['b']], ['b', ['c', 'd']], ['c', ['a']], ['d', []]]);
  expect(circlesIn(imports)).toEqual(['a → b → c → a']);
});

test('imports are found, in every form', () => {
  const imports = importsOf();
  expect(imports.size).toBeGreaterThan(70);
  expect(imports.get('main.ts')).toContain('extension_registry.ts');
  expect(imports.get('extension_registry.ts')).toContain('study/capture_study.ts'); // import()
  expect(imports.get('ui/hud.ts')).toContain('ui/hud_rules.ts'); // import type
  expect(imports.get('mpi/decoder.ts')).toContain('mpi/decode_worker.ts'); // new URL()
});

test('no file imports itself by way of others', () => {
  expect(circlesIn(importsOf())).toEqual([]);
});

test('the capture page knows no extension', () => {
  const outside = Array.from(importsOf())
    .filter(([file, imports]) => !file.startsWith('study/') && file !== 'extension_registry.ts'
      && imports.some((name) => name.startsWith('study/')));
  expect(outside).toEqual([]);
});
