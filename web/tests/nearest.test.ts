import { describe, expect, test } from 'vitest';
import { cameraOfWire, rigid, type Camera } from '../src/geometry';
import { nearestByDistance, nearestByOverlap, overlapShare, type Neighbour } from '../src/nearest';
import type { Camera as WireCamera } from '../src/wire';
import { jsonFixture } from './fixtures';

interface Case {
  readonly views: readonly WireCamera[];
  readonly target: WireCamera;
  readonly scene_depth_m: number;
  readonly count: number;
  readonly overlap: readonly number[];
  /** Index, weight, distance of each. */
  readonly by_distance: readonly [number, number, number][];
  readonly by_overlap: readonly [number, number, number][];
}

const PINHOLE = { width_px: 100, height_px: 100, fx_px: 100, fy_px: 100, cx_px: 50, cy_px: 50 };
/** Both sides compute in float64; the worst of these cases is 2.2e-16 away (node 20.20). */
const DIGITS = 12;

function at(x_m: number): Camera {
  return { pinhole: PINHOLE, worldFromCam: rigid([1, 0, 0, x_m, 0, 1, 0, 0, 0, 0, 1, 0]) };
}

function expectSame(ours: readonly Neighbour[], theirs: Case['by_distance']): void {
  expect(ours.map(({ index }) => index)).toEqual(theirs.map(([index]) => index));
  ours.forEach(({ weight, distance_m }, k) => {
    expect(weight).toBeCloseTo(theirs[k]?.[1] ?? NaN, DIGITS);
    expect(distance_m).toBeCloseTo(theirs[k]?.[2] ?? NaN, DIGITS);
  });
}

describe('by hand', () => {
  test('the weights of the paper: l = 5, 10, 20 cm, so e^-1/4, e^-1/2, e^-1', () => {
    const near = nearestByDistance([at(0.3), at(0.2), at(0.05), at(-0.1)], at(0), 3);
    expect(near.map(({ index }) => index)).toEqual([2, 3, 1]);
    expect(near.map(({ weight }) => Number(weight.toFixed(3)))).toEqual([0.444, 0.346, 0.21]);
  });

  test('of equal distances the first captured comes first', () => {
    const near = nearestByDistance([at(0.1), at(-0.1), at(0.1), at(-0.1)], at(0), 2);
    expect(near.map(({ index, weight }) => [index, weight])).toEqual([[0, 0.5], [1, 0.5]]);
  });

  test('half a picture to the side, at the depth where that is half the picture, sees half', () => {
    // 1 m deep, the picture is 1 m wide: 5 columns of points at 0.1, 0.3 … 0.9, of which 3 remain.
    expect(overlapShare(at(0.5), at(0), 1)).toBe(0.6);
    expect(overlapShare(at(5), at(0), 1)).toBe(0);
  });

  test('a view fades out before another takes its place', () => {
    // The second and the third change places where their costs are equal: the weight is nothing.
    const weightOf = (x_m: number): number =>
      nearestByOverlap([at(0.05), at(0.2), at(-0.2)], at(x_m), 100, 2)[1]?.weight ?? NaN;
    expect(weightOf(1e-6)).toBeLessThan(1e-4);
    expect(weightOf(-1e-6)).toBeLessThan(1e-4);
    expect(weightOf(0.05)).toBeLessThan(weightOf(0.1));
  });
});

describe('as Python answers', () => {
  const cases = jsonFixture<Case[]>('nearest.json');

  test.each(cases.map((one, i) => [i, one] as const))('case %i', (_, one) => {
    const views = one.views.map(cameraOfWire);
    const target = cameraOfWire(one.target);
    expectSame(nearestByDistance(views, target, one.count), one.by_distance);
    expectSame(nearestByOverlap(views, target, one.scene_depth_m, one.count), one.by_overlap);
    expect(views.map((view) => overlapShare(view, target, one.scene_depth_m)))
      .toEqual(one.overlap);
  });
});
