import { describe, expect, test } from 'vitest';
import { cameraOfWire, rigid, type Camera } from '../src/geometry';
import { overlapShare, ViewWeights, type Among } from '../src/view_weights';
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
/** Both languages round `exp` in their own way: 1.1e-16 at worst in these cases (node 24.19). */
const EXP_TOLERANCE = 2e-16;

function at(x_m: number): Camera {
  return { pinhole: PINHOLE, worldFromCam: rigid([1, 0, 0, x_m, 0, 1, 0, 0, 0, 0, 1, 0]) };
}

interface Neighbour { readonly index: number; readonly weight: number; readonly distance_m: number }

function chosenBy(
  views: readonly Camera[], target: Camera, sceneDepth_m: number | null, count: number,
  among: Among = null,
): Neighbour[] {
  const weights = new ViewWeights(count);
  weights.measure(views, target);
  const chosen = sceneDepth_m === null ? weights.byDistance(count, among)
    : weights.byOverlap(sceneDepth_m, count, among);
  return Array.from({ length: chosen.count }, (_, k) => ({
    index: chosen.index[k] ?? NaN, weight: chosen.weight[k] ?? NaN,
    distance_m: chosen.distance_m[k] ?? NaN,
  }));
}

/** Index and distance to the bit; the weights too, where there is no `exp` in them. */
function expectSame(ours: readonly Neighbour[], theirs: Case['by_distance'], exact: boolean): void {
  expect(ours.map(({ index, distance_m }) => [index, distance_m]))
    .toEqual(theirs.map(([index, , distance_m]) => [index, distance_m]));
  ours.forEach(({ weight }, k) => {
    const away = Math.abs(weight - (theirs[k]?.[1] ?? NaN));
    expect(away).toBeLessThanOrEqual(exact ? 0 : EXP_TOLERANCE);
  });
}

describe('by hand', () => {
  test('the weights of the paper: l = 5, 10, 20 cm, so e^-1/4, e^-1/2, e^-1', () => {
    const near = chosenBy([at(0.3), at(0.2), at(0.05), at(-0.1)], at(0), null, 3);
    expect(near.map(({ index }) => index)).toEqual([2, 3, 1]);
    expect(near.map(({ weight }) => Number(weight.toFixed(3)))).toEqual([0.444, 0.346, 0.21]);
  });

  test('of equal distances the first captured comes first', () => {
    const near = chosenBy([at(0.1), at(-0.1), at(0.1), at(-0.1)], at(0), null, 2);
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
      chosenBy([at(0.05), at(0.2), at(-0.2)], at(x_m), 100, 2)[1]?.weight ?? NaN;
    expect(weightOf(1e-6)).toBeLessThan(1e-4);
    expect(weightOf(-1e-6)).toBeLessThan(1e-4);
    expect(weightOf(0.05)).toBeLessThan(weightOf(0.1));
  });
});

describe('many views', () => {
  let seed = 7;
  const random = (): number => {
    seed = (seed * 1103515245 + 12345) % 2 ** 31;
    return seed / 2 ** 31;
  };
  /** On a grid, so that many are equally far. */
  const many = Array.from({ length: 400 }, () => at(Math.round(60 * (random() - 0.5)) / 20));

  /** As the words say it: sort everything, take the first. */
  function sorted(views: readonly Camera[], target: Camera, depth_m: number, count: number): number[] {
    const far = (i: number): number => Math.abs((views[i]?.worldFromCam.rows[3] ?? NaN)
      - (target.worldFromCam.rows[3] ?? NaN));
    const by = (value: (i: number) => number) => (a: number, b: number): number => value(a) - value(b);
    const cost = (i: number): number =>
      (far(i) + 0.002) / Math.max(overlapShare(views[i] ?? target, target, depth_m), 0.05);
    return views.map((_, i) => i).sort(by(far)).slice(0, Math.max(64, 8 * count)).sort(by(cost))
      .slice(0, count);
  }

  test.each([1, 3, 8])('the %i best are those of a full sort, ties in order', (count) => {
    for (let k = 0; k < 20; k += 1) {
      const target = at(random() - 0.5);
      expect(chosenBy(many, target, 1, count).map(({ index }) => index))
        .toEqual(sorted(many, target, 1, count));
    }
  });

  test('only those that are here take part', () => {
    const here = Uint8Array.from(many, (_, i) => (i % 50 === 0 ? 1 : 0));
    const near = chosenBy(many, at(0), 1, 3, here);
    expect(near.map(({ index }) => index % 50)).toEqual([0, 0, 0]);
    expect(near.reduce((sum, { weight }) => sum + weight, 0)).toBeCloseTo(1, 12);
    expect(chosenBy(many, at(0), 1, 3, new Uint8Array(many.length))).toEqual([]);
  });

  test('more than was prepared for is refused, and so is nothing', () => {
    const weights = new ViewWeights(3);
    weights.measure(many, at(0));
    expect(() => weights.byDistance(4)).toThrow('need 1 <= count <= 3, got 4');
    expect(() => weights.byOverlap(1, 0)).toThrow('got 0');
    expect(() => weights.measure([], at(0))).toThrow('at least one');
  });
});

describe('as Python answers', () => {
  const cases = jsonFixture<Case[]>('view_weights.json');

  test.each(cases.map((one, i) => [i, one] as const))('case %i', (_, one) => {
    const views = one.views.map(cameraOfWire);
    const target = cameraOfWire(one.target);
    expectSame(chosenBy(views, target, null, one.count), one.by_distance, false);
    expectSame(chosenBy(views, target, one.scene_depth_m, one.count), one.by_overlap, true);
    expect(views.map((view) => overlapShare(view, target, one.scene_depth_m)))
      .toEqual(one.overlap);
  });
});
