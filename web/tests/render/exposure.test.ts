import { expect, test } from 'vitest';
import { exposureGain } from '../../src/render/exposure';
import { jsonFixture } from '../fixtures';

interface Case {
  /** RGBA samples. */
  readonly view: readonly number[];
  readonly live: readonly number[];
  readonly gain: readonly number[];
}

const cases = jsonFixture<Case[]>('exposure.json');

/** Python divides float32; the worst of these cases is 7e-8 away (node 20.20). */
const DIGITS = 6;

test.each(cases.map((one, i) => [i, one] as const))('gain of case %i is Python\'s', (_, one) => {
  const gain = Float32Array.of(0, 0, 0);
  const pixels = Uint8Array.from([...one.view, ...one.live]);
  expect(exposureGain(pixels, gain)).toBe(true);
  expect(exposureGain(pixels, gain)).toBe(false); // the same as before
  gain.forEach((factor, c) => expect(factor).toBeCloseTo(one.gain[c] ?? NaN, DIGITS));
});

test('the cases are of both kinds', () => {
  expect(cases.some(({ gain }) => gain.every((factor) => factor === 1))).toBe(true);
  expect(cases.some(({ gain }) => gain.some((factor) => Math.abs(factor - 1) > 0.2))).toBe(true);
});
