import { describe, expect, test } from 'vitest';
import { cameraOfWire, resized, rigid, type Cam, type Camera, type World } from '../../src/geometry';
import {
  nextTarget, numTaken, progress, withinReach, type Guide,
} from '../../src/guidance/guide';
import { hemisphere } from '../../src/guidance/hemisphere';
import { planeStack, plenopticBound, plenopticGrid } from '../../src/guidance/plenoptic';
import { DepthScan, middleDepth } from '../../src/guidance/scan';
import type { Camera as WireCamera } from '../../src/wire';
import { jsonFixture } from '../fixtures';

interface GuideAnswers {
  readonly targets: readonly (readonly number[])[];
  readonly position_tolerance_m: number;
  readonly views: readonly WireCamera[];
  /** -1 is none, here and below. */
  readonly taken_by: readonly number[];
  readonly next: readonly number[];
  readonly within_reach: readonly number[];
}

interface Cases {
  readonly scans: readonly {
    readonly maps_mm: readonly (readonly number[])[];
    readonly z_min_and_middle_m: readonly (readonly [number, number])[];
  }[];
  readonly guides: readonly {
    readonly camera: WireCamera;
    readonly z_min_m: number;
    readonly area_side_m: number;
    readonly num_planes: number;
    readonly spacing_m: number;
    readonly num_views: number;
    readonly views_per_side: number;
    readonly pitch_m: number;
    readonly guides: Readonly<Record<'plenoptic' | 'planes' | 'hemisphere', GuideAnswers>>;
  }[];
}

/** Both sides compute in float64; the worst of these cases is 4.4e-16 away (node 20.20). */
const DIGITS = 12;
const RADIANS = Math.PI / 180;

const HERE = rigid<World, Cam>([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]);
const PINHOLE = { width_px: 100, height_px: 100, fx_px: 50, fy_px: 50, cx_px: 50, cy_px: 50 };

function at(x_m: number, y_m = 0): Camera {
  return { pinhole: PINHOLE, worldFromCam: rigid([1, 0, 0, x_m, 0, 1, 0, y_m, 0, 0, 1, 0]) };
}

describe('by hand', () => {
  /** f = 50 px: Δu = 5 · 1 / 50 = 0.1 m, so nine views in a square of 0.3 m. */
  const bound = plenopticBound(PINHOLE, 1, 0.3, 5);

  test('nine views in a square', () => {
    expect(bound.spacing_m).toBeCloseTo(0.1, DIGITS);
    expect([bound.numViews, bound.viewsPerSide]).toEqual([9, 3]);
    const grid = plenopticGrid(HERE, bound);
    expect(grid.targets.length).toBe(9);
    expect(grid.targets[4]?.rows[3]).toBeCloseTo(0, DIGITS);
    expect(grid.targets[5]?.rows[3]).toBeCloseTo(0.1, DIGITS);
  });

  test('the paper: 294 px over 45.93°, 32 planes, 0.5 m, 15 cm: N = 10.6', () => {
    const fx_px = 147 / Math.tan((45.93 / 2) * RADIANS);
    const paper = plenopticBound(
      { ...PINHOLE, width_px: 294, fx_px, fy_px: fx_px }, 0.5, 0.15, 32);
    expect(paper.numViewsExact).toBeCloseTo(10.58, 2);
    expect([paper.numViews, paper.viewsPerSide]).toEqual([11, 4]);
  });

  test('the bound of a picture is that of the MPI made from it, not of its own pixels', () => {
    const half = plenopticBound(resized(PINHOLE, 50, 50), 1, 0.3, 5);
    expect(half.spacing_m).toBeCloseTo(2 * bound.spacing_m, DIGITS);
  });

  test('a view near a target takes it, and no other', () => {
    const grid = plenopticGrid(HERE, bound, { position_m: 0.03 });
    expect(progress(grid, [at(0.02), at(0.09), at(0.05)])).toEqual(
      [null, null, null, null, 0, 1, null, null, null]);
    expect(nextTarget(grid, at(0.01), progress(grid, [at(0)]))).toBe(5);
    expect(numTaken(progress(grid, [at(0.02), at(0.09)]))).toBe(2);
  });

  test('no depth is refused', () => {
    expect(() => plenopticBound(PINHOLE, 0, 0.3, 5)).toThrow(/zMin_m/);
    expect(() => plenopticBound(PINHOLE, 1, NaN, 5)).toThrow(/areaSide_m/);
  });
});

describe('as Python answers', () => {
  const cases = jsonFixture<Cases>('guidance.json');
  const orNull = (index: number): number | null => (index < 0 ? null : index);

  test.each(cases.scans.map((one, i) => [i, one] as const))('scan %i', (_, one) => {
    const scan = new DepthScan();
    const found = one.maps_mm.map((map) => {
      const depth = { width_px: 16, height_px: 12, depth_mm: Uint16Array.from(map) };
      scan.add(depth);
      return [scan.zMin_m ?? -1, middleDepth(depth) ?? -1];
    });
    expect(found.length).toBe(one.z_min_and_middle_m.length);
    found.flat().forEach((depth_m, i) =>
      expect(depth_m).toBeCloseTo(one.z_min_and_middle_m.flat()[i] ?? NaN, DIGITS));
  });

  test.each(cases.guides.map((one, i) => [i, one] as const))('guides %i', (_, one) => {
    const camera = cameraOfWire(one.camera);
    const bound = plenopticBound(camera.pinhole, one.z_min_m, one.area_side_m, one.num_planes);
    expect(bound.spacing_m).toBeCloseTo(one.spacing_m, DIGITS);
    expect(bound.pitch_m).toBeCloseTo(one.pitch_m, DIGITS);
    expect([bound.numViews, bound.viewsPerSide]).toEqual([one.num_views, one.views_per_side]);
    const anchor = camera.worldFromCam;
    const cap = { radius_m: 2 * one.z_min_m, step_rad: 20 * RADIANS, extent_rad: 60 * RADIANS };
    expectSame(plenopticGrid(anchor, bound), one.guides.plenoptic);
    expectSame(planeStack(anchor, bound), one.guides.planes);
    expectSame(hemisphere(anchor, cap), one.guides.hemisphere);
  });

  function expectSame(guide: Guide, answers: GuideAnswers): void {
    expect(guide.targets.length).toBe(answers.targets.length);
    guide.targets.forEach((target, i) => target.rows.forEach((value, k) =>
      expect(value).toBeCloseTo(answers.targets[i]?.[k] ?? NaN, DIGITS)));
    expect(guide.nearEnough.position_m).toBeCloseTo(answers.position_tolerance_m, DIGITS);
    const views = answers.views.map(cameraOfWire);
    const takenBy = progress(guide, views);
    expect(takenBy).toEqual(answers.taken_by.map(orNull));
    views.forEach((view, i) => {
      expect(nextTarget(guide, view, takenBy)).toBe(orNull(answers.next[i] ?? NaN));
      expect(withinReach(guide, view, takenBy)).toBe(orNull(answers.within_reach[i] ?? NaN));
    });
  }
});
