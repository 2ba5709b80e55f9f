/** Which captured views to render from, and how much each counts; twin of src/peaking/view_weights.py. */

import { positionOf, type Camera } from './geometry';

const GRID = 5;
const LEAST_OVERLAP = 0.05;
const CLOSE_M = 0.002;
const CANDIDATES = 64;
const RANGE = 1.3;

export interface Neighbour {
  /** Which of the captured views. */
  readonly index: number;
  /** Its share; they sum to 1. */
  readonly weight: number;
  readonly distance_m: number;
}

/** The paper's: the `count` nearest, w ∝ exp(-l/γ), γ the largest distance among them. */
export function nearestByDistance(
  cameras: readonly Camera[], target: Camera, count: number,
): Neighbour[] {
  const distances_m = distancesOf(cameras, target);
  const chosen = orderOf(distances_m).slice(0, count);
  const gamma_m = Math.max(...chosen.map((i) => at(distances_m, i)));
  const weights = chosen.map((i) =>
    (gamma_m > 0 ? Math.exp(-at(distances_m, i) / gamma_m) : 1));
  return neighbours(chosen, weights, distances_m);
}

/**
 * Ours: cost = distance / overlap, w ∝ (1/cost)(1 - cost/limit), where the limit is the cost of the
 * best view left out. `sceneDepth_m` is a typical depth, such as the median plane of the nearest view.
 */
export function nearestByOverlap(
  cameras: readonly Camera[], target: Camera, sceneDepth_m: number, count: number,
): Neighbour[] {
  const distances_m = distancesOf(cameras, target);
  const candidates = orderOf(distances_m).slice(0, Math.max(CANDIDATES, 8 * count));
  const costs_m = candidates.map((i) => (at(distances_m, i) + CLOSE_M)
    / Math.max(overlapShare(cameras[i] ?? target, target, sceneDepth_m), LEAST_OVERLAP));
  const order = orderOf(costs_m);
  const best = order.slice(0, count);
  const next = order[count];
  const limit_m = next === undefined
    ? RANGE * Math.max(...best.map((i) => at(costs_m, i))) : at(costs_m, next);
  const weights = best.map((i) => {
    const cost_m = at(costs_m, i);
    return Math.max(1 - cost_m / limit_m, 1e-6) / cost_m;
  });
  return neighbours(best.map((i) => at(candidates, i)), weights, distances_m);
}

/** The part of the target's picture that a view saw, if all is at `sceneDepth_m`. */
export function overlapShare(view: Camera, target: Camera, sceneDepth_m: number): number {
  const k = target.pinhole;
  const v = view.pinhole;
  const t = target.worldFromCam.rows;
  const s = view.worldFromCam.rows;
  let seen = 0;
  for (let row = 0; row < GRID; row += 1) {
    for (let column = 0; column < GRID; column += 1) {
      const x = (sceneDepth_m * (((column + 0.5) / GRID) * k.width_px - k.cx_px)) / k.fx_px;
      const y = (sceneDepth_m * (((row + 0.5) / GRID) * k.height_px - k.cy_px)) / k.fy_px;
      const dx = at(t, 0) * x + at(t, 1) * y + at(t, 2) * sceneDepth_m + at(t, 3) - at(s, 3);
      const dy = at(t, 4) * x + at(t, 5) * y + at(t, 6) * sceneDepth_m + at(t, 7) - at(s, 7);
      const dz = at(t, 8) * x + at(t, 9) * y + at(t, 10) * sceneDepth_m + at(t, 11) - at(s, 11);
      const z = at(s, 2) * dx + at(s, 6) * dy + at(s, 10) * dz;
      if (z <= 0) continue;
      const px = (v.fx_px * (at(s, 0) * dx + at(s, 4) * dy + at(s, 8) * dz)) / z + v.cx_px;
      const py = (v.fy_px * (at(s, 1) * dx + at(s, 5) * dy + at(s, 9) * dz)) / z + v.cy_px;
      if (px >= 0 && px <= v.width_px && py >= 0 && py <= v.height_px) seen += 1;
    }
  }
  return seen / (GRID * GRID);
}

function distancesOf(cameras: readonly Camera[], target: Camera): number[] {
  if (cameras.length === 0) throw new RangeError('need at least one captured view');
  const [x, y, z] = positionOf(target);
  return cameras.map((camera) => {
    const p = positionOf(camera);
    return Math.hypot(p[0] - x, p[1] - y, p[2] - z);
  });
}

/** Indices from the smallest value to the largest; equal ones stay in order. */
function orderOf(values: readonly number[]): number[] {
  return values.map((_, i) => i).sort((a, b) => at(values, a) - at(values, b));
}

function neighbours(
  chosen: readonly number[], weights: readonly number[], distances_m: readonly number[],
): Neighbour[] {
  const total = weights.reduce((sum, weight) => sum + weight, 0);
  return chosen.map((index, i) => ({
    index, weight: at(weights, i) / total, distance_m: at(distances_m, index),
  }));
}

function at(values: ArrayLike<number>, index: number): number {
  return values[index] ?? NaN;
}
