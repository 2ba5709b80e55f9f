/**
 * Cameras and rigid transforms whose names and types say between which frames they go; the twin of
 * `src/peaking/geometry.py`. Axes, pixel centres and units: CONVENTIONS.md.
 */

import type { Camera as WireCamera, Pinhole } from './wire';

export type { Pinhole } from './wire';

declare const frame: unique symbol;
/** The frame of the session: fixed in the room. */
export interface World { readonly [frame]: 'world' }
/** The frame of one camera: x right, y down, z forward (OpenCV). */
export interface Cam { readonly [frame]: 'cam' }
export type Frame = World | Cam;

/** `p_to = R p_from + t`: `[R | t]` row by row, 12 numbers, metres. */
export interface Rigid<To, From> {
  readonly rows: Float64Array;
  readonly to?: To;
  readonly from?: From;
}

/** Where a picture was taken from, and how its pixels look out. */
export interface Camera {
  readonly pinhole: Pinhole;
  readonly worldFromCam: Rigid<World, Cam>;
}

export type Vector3 = readonly [number, number, number];

export function rigid<To, From>(rows: ArrayLike<number>): Rigid<To, From> {
  if (rows.length !== 12) throw new RangeError(`need 12 numbers [R | t], got ${rows.length}`);
  return { rows: Float64Array.from(rows) };
}

/** Turn WebXR's `view.transform.matrix` (column-major, camera looks along -z, y up) to OpenCV's axes. */
export function worldFromCamOfWebXr(matrix: ArrayLike<number>): Rigid<World, Cam> {
  const m = (row: number, column: number): number => matrix[4 * column + row] ?? NaN;
  const rows = [0, 1, 2].flatMap((r) => [m(r, 0), -m(r, 1), -m(r, 2), m(r, 3)]);
  return rigid(rows);
}

/**
 * Intrinsics from WebXR's projection matrix (column-major) for a picture of this size. `cy` is
 * counted from the top, as everywhere here.
 */
export function pinholeOfProjection(
  projection: ArrayLike<number>, width_px: number, height_px: number,
): Pinhole {
  const p = (i: number): number => projection[i] ?? NaN;
  return {
    width_px,
    height_px,
    fx_px: (width_px / 2) * p(0),
    fy_px: (height_px / 2) * p(5),
    cx_px: (width_px / 2) * (1 - p(8)),
    cy_px: (height_px / 2) * (1 + p(9)),
  };
}

export function resized(pinhole: Pinhole, width_px: number, height_px: number): Pinhole {
  const sx = width_px / pinhole.width_px;
  const sy = height_px / pinhole.height_px;
  return {
    width_px,
    height_px,
    fx_px: pinhole.fx_px * sx,
    fy_px: pinhole.fy_px * sy,
    cx_px: pinhole.cx_px * sx,
    cy_px: pinhole.cy_px * sy,
  };
}

export function inverse<To, From>(transform: Rigid<To, From>): Rigid<From, To> {
  const m = transform.rows;
  const at = (r: number, c: number): number => m[4 * r + c] ?? NaN;
  const rows = [0, 1, 2].flatMap((r) => [
    at(0, r), at(1, r), at(2, r),
    -(at(0, r) * at(0, 3) + at(1, r) * at(1, 3) + at(2, r) * at(2, 3)),
  ]);
  return rigid(rows);
}

export function compose<A, B, C>(
  aFromB: Rigid<A, B>, bFromC: Rigid<NoInfer<B>, C>,
): Rigid<A, C> {
  const a = (r: number, c: number): number => aFromB.rows[4 * r + c] ?? NaN;
  const b = (r: number, c: number): number => bFromC.rows[4 * r + c] ?? NaN;
  const rows = [0, 1, 2].flatMap((r) => [0, 1, 2, 3].map((c) =>
    a(r, 0) * b(0, c) + a(r, 1) * b(1, c) + a(r, 2) * b(2, c) + (c === 3 ? a(r, 3) : 0)));
  return rigid(rows);
}

export function positionOf(camera: Camera): Vector3 {
  const m = camera.worldFromCam.rows;
  return [m[3] ?? NaN, m[7] ?? NaN, m[11] ?? NaN];
}

/** The viewing direction, in the world. */
export function forwardOf(camera: Camera): Vector3 {
  const m = camera.worldFromCam.rows;
  return [m[2] ?? NaN, m[6] ?? NaN, m[10] ?? NaN];
}

export function cameraOfWire(camera: WireCamera): Camera {
  return { pinhole: camera.pinhole, worldFromCam: rigid(camera.world_from_cam) };
}

export function wireOfCamera(camera: Camera): WireCamera {
  return { pinhole: camera.pinhole, world_from_cam: Array.from(camera.worldFromCam.rows) };
}
