import { expect, test } from 'vitest';
import { compose, inverse, rigid, type Cam, type World } from '../../src/geometry';
import { newProjection, project } from '../../src/render/projection';

const SOURCE = { width_px: 100, height_px: 80, fx_px: 50, fy_px: 40, cx_px: 45, cy_px: 30 };
const TARGET = { width_px: 60, height_px: 60, fx_px: 90, fy_px: 80, cx_px: 31, cy_px: 28 };
/** float32, of numbers up to 100. */
const DIGITS = 4;

/** A quarter turn about y, and a step. */
const TURNED = rigid<World, Cam>([0, 0, 1, 1, 0, 1, 0, 2, -1, 0, 0, 3]);
const ELSEWHERE = rigid<World, Cam>([0.6, 0, 0.8, 0.5, 0, 1, 0, 2.25, -0.8, 0, 0.6, 2.5]);

test('a texel at a depth lands where its point in the world does', () => {
  const [u, v, depth_m] = [20, 70, 3];
  const { matrix, translation } = project(
    { pinhole: SOURCE, worldFromCam: TURNED }, ELSEWHERE, TARGET, newProjection());
  const m = (row: number): number => depth_m * ((matrix[row] ?? NaN) * u
    + (matrix[3 + row] ?? NaN) * v + (matrix[6 + row] ?? NaN)) + (translation[row] ?? NaN);
  // By hand: to the source's axes, to the target's, to its pixels.
  const at = [((u - 45) / 50) * 3, ((v - 30) / 40) * 3, 3];
  const rows = compose(inverse(ELSEWHERE), TURNED).rows;
  const [x = 0, y = 0, z = 0] = [0, 1, 2].map((r) => (rows[4 * r] ?? 0) * (at[0] ?? 0)
    + (rows[4 * r + 1] ?? 0) * (at[1] ?? 0) + (rows[4 * r + 2] ?? 0) * (at[2] ?? 0)
    + (rows[4 * r + 3] ?? 0));
  expect(m(2)).toBeCloseTo(z, DIGITS);
  expect(m(0)).toBeCloseTo(90 * x + 31 * z, DIGITS - 1);
  expect(m(1)).toBeCloseTo(80 * y + 28 * z, DIGITS - 1);
});

test('a target half a metre before the source', () => {
  const ahead = rigid<World, Cam>([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.5]);
  const here = rigid<World, Cam>([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]);
  const out = project({ pinhole: SOURCE, worldFromCam: here }, ahead, SOURCE, newProjection());
  expect(out.targetDepth_m).toBeCloseTo(0.5, 12);
  expect(Array.from(out.matrix)).toEqual([1, 0, 0, 0, 1, 0, 0, 0, 1]);
  expect(Array.from(out.translation)).toEqual([-22.5, -15, -0.5]);
});
