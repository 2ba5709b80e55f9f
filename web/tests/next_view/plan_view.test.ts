import { expect, test } from 'vitest';
import { rigid, type Camera } from '../../src/geometry';
import { fitting, planViewOf } from '../../src/next_view/plan_view';

const LENS = { width_px: 30, height_px: 60, fx_px: 30, fy_px: 30, cx_px: 15, cy_px: 30 };

/** In a world with y up, looking along -z: as WebXR's. */
const upright = (x: number, y: number, z: number): Camera =>
  ({ pinhole: LENS, worldFromCam: rigid([1, 0, 0, x, 0, -1, 0, y, 0, 0, -1, z]) });

test('right is right, ahead is up on the map, and height does not matter', () => {
  const plan = planViewOf([upright(0, 1.3, 1), upright(0.5, 1.5, 0.8)], [upright(-0.5, 1, 1)], [0.2, 0.4, -1, 0.2, 2, -1]);
  expect(plan.views[0]).toMatchObject({ ahead_y: -1 });
  expect((plan.views[1]?.x_m ?? 0) - (plan.views[0]?.x_m ?? 0)).toBeCloseTo(0.5, 9);
  expect((plan.views[1]?.y_m ?? 0) - (plan.views[0]?.y_m ?? 0)).toBeCloseTo(-0.2, 9);
  expect(plan.left[0]?.x_m).toBeCloseTo(-0.5, 9);
  expect(Array.from(plan.surface.slice(0, 2))).toEqual(Array.from(plan.surface.slice(2)));
  expect(plan.surface[0]).toBeCloseTo(0.2, 9);
  expect((plan.surface[1] ?? 0) - (plan.views[0]?.y_m ?? 0)).toBeCloseTo(-2, 9);
});

test('a world with another axis up gives the same map', () => {
  // x right, y ahead, z up.
  const other = (x: number, y: number, z: number): Camera =>
    ({ pinhole: LENS, worldFromCam: rigid([1, 0, 0, x, 0, 0, 1, y, 0, -1, 0, z]) });
  const a = planViewOf([upright(0, 1.3, 1), upright(0.5, 1.3, 0.6)], [], [0.3, 0, -2]);
  const b = planViewOf([other(0, -1, 1.3), other(0.5, -0.6, 1.3)], [], [0.3, 2, 0]);
  for (const i of [0, 1]) {
    expect(b.views[i]?.x_m).toBeCloseTo(a.views[i]?.x_m ?? NaN, 9);
    expect(b.views[i]?.y_m).toBeCloseTo(a.views[i]?.y_m ?? NaN, 9);
  }
  a.surface.forEach((value, i) => expect(b.surface[i]).toBeCloseTo(value, 9));
});

test('a camera that looks straight down has a map', () => {
  const down: Camera = { pinhole: LENS, worldFromCam: rigid([1, 0, 0, 0, 0, 0, -1, 2, 0, 1, 0, 0]) };
  const plan = planViewOf([down], [], [0.5, 0, 0]);
  expect(Number.isFinite(plan.surface[0])).toBe(true);
});

test('all cameras lie on the canvas, whatever lies far away', () => {
  const far = Array.from({ length: 100 }, (_, i) => [i < 97 ? i / 50 : 500, 0, -2]).flat();
  const plan = planViewOf([upright(0, 1, 0), upright(1, 1, 0)], [upright(3, 1, 0)], far);
  const fit = fitting(plan, 200, 100, 10);
  for (const { x_m, y_m } of [...plan.views, ...plan.left]) {
    expect(fit.x_px + fit.scale * x_m).toBeGreaterThanOrEqual(10 - 1e-6);
    expect(fit.x_px + fit.scale * x_m).toBeLessThanOrEqual(190 + 1e-6);
    expect(fit.y_px + fit.scale * y_m).toBeGreaterThanOrEqual(10 - 1e-6);
    expect(fit.y_px + fit.scale * y_m).toBeLessThanOrEqual(90 + 1e-6);
  }
  expect(fit.scale).toBeGreaterThan(20);
});

test('nothing gives an empty map', () => {
  expect(planViewOf([], [], [1, 2, 3]).surface).toHaveLength(0);
});
