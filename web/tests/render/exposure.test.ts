import { expect, test } from 'vitest';
import { measureExposure } from '../../src/render/exposure';
import { jsonFixture } from '../fixtures';

interface Case {
  /** RGBA samples. */
  readonly view: readonly number[];
  readonly live: readonly number[];
  readonly width_px: number;
  readonly height_px: number;
  readonly gain: readonly number[];
  readonly falloff: number;
}

const cases = jsonFixture<Case[]>('exposure.json');

/** Python has colours of float32; the worst of these cases is 1.2e-7 away. */
const DIGITS = 6;

test.each(cases.map((one, i) => [i, one] as const))('exposure of case %i is Python\'s', (_, one) => {
  const exposure = Float32Array.of(0, 0, 0, NaN);
  const pixels = Uint8Array.from([...one.view, ...one.live]);
  expect(measureExposure(pixels, one.width_px, one.height_px, exposure)).toBe(true);
  expect(measureExposure(pixels, one.width_px, one.height_px, exposure)).toBe(false); // the same as before
  one.gain.forEach((factor, c) => expect(exposure[c]).toBeCloseTo(factor, DIGITS));
  expect(exposure[3]).toBeCloseTo(one.falloff, DIGITS);
});

test('the cases are of all kinds', () => {
  expect(cases.some(({ gain }) => gain.every((factor) => factor === 1))).toBe(true);
  expect(cases.some(({ gain }) => gain.some((factor) => Math.abs(factor - 1) > 0.2))).toBe(true);
  expect(cases.some(({ falloff }) => falloff < -0.2)).toBe(true);
});
