import { expect, test } from 'vitest';
import { cameraOfWire, rigid, type Camera } from '../../src/geometry';
import { blocksOf, HoleFiller } from '../../src/render/hole_filling';
import type { Camera as WireCamera } from '../../src/wire';
import { jsonFixture } from '../fixtures';

interface Case {
  readonly cameras: readonly WireCamera[];
  readonly target: WireCamera;
  /** Of 28 by 42 blocks, top row first. */
  readonly opacity: readonly number[];
  readonly fill_depths_m: readonly number[];
  readonly scene_depth_m: number;
  readonly chosen: readonly number[];
}

const cases = jsonFixture<Case[]>('hole_filling.json');
const filler = new HoleFiller(3);

test.each(cases.map((one, i) => [i, one] as const))('case %i is filled as in Python', (_, one) => {
  const opacity = Uint8Array.from(one.opacity.flatMap((mean) => [mean, 0, 0, 255]));
  filler.choose(
    one.cameras.map(cameraOfWire), cameraOfWire(one.target), { opacity, cols: 28, rows: 42 },
    { medianDepth_m: one.scene_depth_m, fillDepths_m: Float64Array.from(one.fill_depths_m) },
    (index) => index === 0);
  expect(Array.from(filler.index.subarray(0, filler.count))).toEqual(one.chosen);
});

test('the cases are of all kinds', () => {
  expect(cases.some(({ chosen }) => chosen.length === 0)).toBe(true);
  expect(cases.some(({ chosen }) => chosen.length === 3)).toBe(true);
});

test('views that are too far away to be chosen are not looked at', () => {
  const one = cases.find(({ chosen }) => chosen.length === 3);
  if (one === undefined) throw new Error('no such case');
  const opacity = Uint8Array.from(one.opacity.flatMap((mean) => [mean, 0, 0, 255]));
  const depths = { medianDepth_m: one.scene_depth_m, fillDepths_m: Float64Array.from(one.fill_depths_m) };
  const near = one.cameras.map(cameraOfWire);
  const far = Array.from({ length: 290 }, (): Camera => {
    const rows = Float64Array.from(near[0]?.worldFromCam.rows ?? []);
    rows[3] = 1e4;
    return {
      get pinhole(): never { throw new Error('looked at'); },
      worldFromCam: rigid(rows),
    };
  });
  filler.choose(
    [...near, ...far], cameraOfWire(one.target), { opacity, cols: 28, rows: 42 }, depths, (index) => index === 0);
  expect(Array.from(filler.index.subarray(0, filler.count))).toEqual(one.chosen);
});

test.each([
  [294, 639, 19, 42], [639, 294, 42, 19], [7, 500, 1, 42], [1, 1, 1, 1], [84, 42, 42, 21],
])('%i by %i pixels are cut into %i by %i blocks', (width, height, cols, rows) => {
  expect(blocksOf(width, height)).toEqual({ cols, rows });
});
