/** A capture seen from above: cameras, what they have seen, and what is left; geometry alone. */

import { forwardOf, positionOf, type Camera, type Vector3 } from '../geometry';

export interface Marker {
  readonly x_m: number;
  readonly y_m: number;
  /** The direction it looks in, of length 1 or less. */
  readonly ahead_x: number;
  readonly ahead_y: number;
}

export interface PlanView {
  /** x and y of every place, metres; the first view looks to the top (−y). */
  readonly surface: Float64Array;
  readonly views: readonly Marker[];
  readonly left: readonly Marker[];
}

/**
 * Look down along the mean "down" of the views: worlds have any axis up.
 *
 * @param surface_m x, y, z of places in the world.
 */
export function planViewOf(
  views: readonly Camera[], left: readonly Camera[], surface_m: readonly number[],
): PlanView {
  const first = views[0] ?? left[0];
  if (first === undefined) return { surface: new Float64Array(0), views: [], left: [] };
  const down = unit((views.length > 0 ? views : left).map(downOf).reduce(plus));
  const ahead = unit(across(forwardOf(first), down));
  const right = cross(down, ahead);
  const marker = (camera: Camera): Marker => {
    const at = positionOf(camera);
    const look = forwardOf(camera);
    return { x_m: dot(at, right), y_m: -dot(at, ahead), ahead_x: dot(look, right), ahead_y: -dot(look, ahead) };
  };
  const surface = new Float64Array(2 * Math.floor(surface_m.length / 3));
  for (let i = 0; i < surface.length; i += 2) {
    const at = [0, 1, 2].map((k) => surface_m[1.5 * i + k] ?? NaN) as unknown as Vector3;
    surface[i] = dot(at, right);
    surface[i + 1] = -dot(at, ahead);
  }
  return { surface, views: views.map(marker), left: left.map(marker) };
}

export interface Fitting {
  readonly scale: number;
  readonly x_px: number;
  readonly y_px: number;
}

/** How a plan lies on a canvas: all cameras, and nine tenths of the surface to each side. */
export function fitting(plan: PlanView, width_px: number, height_px: number, margin_px: number): Fitting {
  const xs = plan.surface.filter((_, i) => i % 2 === 0).sort();
  const ys = plan.surface.filter((_, i) => i % 2 === 1).sort();
  const places = [...plan.views, ...plan.left];
  const [left, right] = range(xs, places.map(({ x_m }) => x_m));
  const [top, bottom] = range(ys, places.map(({ y_m }) => y_m));
  const scale = Math.min((width_px - 2 * margin_px) / Math.max(right - left, 0.1),
    (height_px - 2 * margin_px) / Math.max(bottom - top, 0.1));
  return {
    scale,
    x_px: 0.5 * width_px - 0.5 * scale * (left + right),
    y_px: 0.5 * height_px - 0.5 * scale * (top + bottom),
  };
}

function range(sorted: Float64Array, more: readonly number[]): readonly [number, number] {
  const cut = Math.floor(0.05 * sorted.length);
  const some = [...(sorted.length > 0 ? [sorted[cut] ?? 0, sorted[sorted.length - 1 - cut] ?? 0] : []), ...more];
  return [Math.min(...some), Math.max(...some)];
}

function downOf({ worldFromCam: { rows } }: Camera): Vector3 {
  return [rows[1] ?? 0, rows[5] ?? 0, rows[9] ?? 0];
}

function plus(a: Vector3, b: Vector3): Vector3 {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}

function dot(a: Vector3, b: Vector3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function cross(a: Vector3, b: Vector3): Vector3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function unit(v: Vector3): Vector3 {
  const length = Math.sqrt(dot(v, v)) || 1;
  return [v[0] / length, v[1] / length, v[2] / length];
}

/** What is left of `v` across `axis`; for a camera that looks straight down, some direction across. */
function across(v: Vector3, axis: Vector3): Vector3 {
  const along = dot(v, axis);
  const rest: Vector3 = [v[0] - along * axis[0], v[1] - along * axis[1], v[2] - along * axis[2]];
  if (dot(rest, rest) > 1e-6) return rest;
  return Math.abs(axis[0]) < 0.9 ? cross(axis, [1, 0, 0]) : cross(axis, [0, 1, 0]);
}
