import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';

import { problemsOf } from '../../src/study/answer_rules';
import type { Answer } from '../../src/study/study_api';
import type { Item } from '../../src/study/wire';

interface Fixture {
  readonly items: Readonly<Record<string, Item>>;
  readonly cases: readonly (readonly [string, Answer, string | null])[];
}

const fixture = JSON.parse(readFileSync(
  new URL('../../fixtures/study_answers.json', import.meta.url), 'utf-8')) as Fixture;

test.each(fixture.cases)('%s answered with %j: %s', (name, answer, expected) => {
  const form = { name: 'form', title: 'Form', items: [fixture.items[name] as Item] };
  expect(problemsOf(form, { [name]: answer }).get(name) ?? null).toBe(expected);
});
