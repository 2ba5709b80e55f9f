/** What an answer has to be: the twin of `problems` in `src/peaking/study/questionnaires`. */

import type { Answer, Answers } from './study_api';
import { MAX_TEXT, type Item, type Questionnaire } from './wire';

export type Problem = 'unanswered' | 'not-a-number' | 'out-of-range' | 'not-a-choice' | 'too-long';

/** @returns The problem of each item that has one, in the order of the form. */
export function problemsOf(form: Questionnaire, answers: Answers): ReadonlyMap<string, Problem> {
  const found = new Map<string, Problem>();
  for (const item of form.items) {
    const problem = problemOf(item, answers[item.id] ?? null);
    if (problem !== null) found.set(item.id, problem);
  }
  return found;
}

/** @returns Smallest and largest number that an item takes. */
export function rangeOf(item: Item): readonly [number, number] {
  switch (item.kind) {
    case 'scale': return [1, item.points ?? 7];
    case 'rating': return [0, 100];
    default: return [item.smallest ?? 0, item.largest ?? 1e6];
  }
}

function problemOf(item: Item, answer: Answer): Problem | null {
  if (answer === null || answer === '' || (Array.isArray(answer) && answer.length === 0)) {
    return item.optional === true ? null : 'unanswered';
  }
  switch (item.kind) {
    case 'scale': case 'rating': case 'number': {
      if (typeof answer !== 'number' || !Number.isFinite(answer)) return 'not-a-number';
      const [low, high] = rangeOf(item);
      const fits = item.kind === 'number'
        || (item.kind === 'scale' ? Number.isInteger(answer) : answer % 5 === 0);
      return fits && low <= answer && answer <= high ? null : 'out-of-range';
    }
    case 'choice': return valuesOf(item).has(String(answer)) ? null : 'not-a-choice';
    case 'choices':
      return Array.isArray(answer) && answer.every((value) => valuesOf(item).has(String(value)))
        ? null : 'not-a-choice';
    case 'text': return String(answer).length <= MAX_TEXT ? null : 'too-long';
    default: return item.kind satisfies never;
  }
}

function valuesOf(item: Item): ReadonlySet<string> {
  return new Set((item.choices ?? []).map((choice) => choice.value));
}
