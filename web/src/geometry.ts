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

/** No turn and no way; also what is written into, frame by frame. */
export function identity<To, From>(): Rigid<To, From> {
  return rigid([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]);
}

/** A pinhole whose numbers are written anew. */
export type PinholeScratch = { -readonly [K in keyof Pinhole]: Pinhole[K] };

export function pinholeScratch(): PinholeScratch {
  return { width_px: 0, height_px: 0, fx_px: 0, fy_px: 0, cx_px: 0, cy_px: 0 };
}

/**
 * Turn WebXR's `view.transform.matrix` (column-major, camera looks along -z, y up) to OpenCV's axes.
 *
 * @param out Written to, and returned; in the frame loop it is used again.
 */
export function worldFromCamOfWebXr(
  matrix: ArrayLike<number>, out: Rigid<World, Cam> = identity(),
): Rigid<World, Cam> {
  for (let r = 0; r < 3; r += 1) {
    out.rows[4 * r] = matrix[r] ?? NaN;
    out.rows[4 * r + 1] = -(matrix[4 + r] ?? NaN);
    out.rows[4 * r + 2] = -(matrix[8 + r] ?? NaN);
    out.rows[4 * r + 3] = matrix[12 + r] ?? NaN;
  }
  return out;
}

/**
 * Intrinsics from WebXR's projection matrix (column-major) for a picture of this size. `cy` is
 * counted from the top, as everywhere here.
 *
 * @param out As above.
 */
export function pinholeOfProjection(
  projection: ArrayLike<number>, width_px: number, height_px: number,
  out: PinholeScratch = pinholeScratch(),
): Pinhole {
  out.width_px = width_px;
  out.height_px = height_px;
  out.fx_px = (width_px / 2) * (projection[0] ?? NaN);
  out.fy_px = (height_px / 2) * (projection[5] ?? NaN);
  out.cx_px = (width_px / 2) * (1 - (projection[8] ?? NaN));
  out.cy_px = (height_px / 2) * (1 + (projection[9] ?? NaN));
  return out;
}

/** @param out As above. */
export function resized(
  pinhole: Pinhole, width_px: number, height_px: number, out: PinholeScratch = pinholeScratch(),
): Pinhole {
  const sx = width_px / pinhole.width_px;
  const sy = height_px / pinhole.height_px;
  out.width_px = width_px;
  out.height_px = height_px;
  out.fx_px = pinhole.fx_px * sx;
  out.fy_px = pinhole.fy_px * sy;
  out.cx_px = pinhole.cx_px * sx;
  out.cy_px = pinhole.cy_px * sy;
  return out;
}

/** @param out As above; not the transform itself. */
export function inverse<To, From>(
  transform: Rigid<To, From>, out: Rigid<From, To> = identity(),
): Rigid<From, To> {
  const m = transform.rows;
  const x = m[3] ?? NaN;
  const y = m[7] ?? NaN;
  const z = m[11] ?? NaN;
  for (let r = 0; r < 3; r += 1) {
    const a = m[r] ?? NaN;
    const b = m[4 + r] ?? NaN;
    const c = m[8 + r] ?? NaN;
    out.rows[4 * r] = a;
    out.rows[4 * r + 1] = b;
    out.rows[4 * r + 2] = c;
    out.rows[4 * r + 3] = -(a * x + b * y + c * z);
  }
  return out;
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

/** As `compose`, without making anything. @param out Written to, and returned; neither of the two. */
export function composeInto<A, B, C>(
  aFromB: Rigid<A, B>, bFromC: Rigid<NoInfer<B>, C>, out: Rigid<A, C>,
): Rigid<A, C> {
  const a = aFromB.rows;
  const b = bFromC.rows;
  for (let r = 0; r < 12; r += 4) {
    for (let c = 0; c < 4; c += 1) {
      out.rows[r + c] = (a[r] ?? NaN) * (b[c] ?? NaN) + (a[r + 1] ?? NaN) * (b[4 + c] ?? NaN)
        + (a[r + 2] ?? NaN) * (b[8 + c] ?? NaN) + (c === 3 ? a[r + 3] ?? NaN : 0);
    }
  }
  return out;
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

/** Between the centres of projection, metres. */
export function distanceBetween(a: Rigid<World, Cam>, b: Rigid<World, Cam>): number {
  return columnDistance(a.rows, b.rows, 3);
}

/** Between the viewing directions, radians; exact for small angles too. */
export function angleBetween(a: Rigid<World, Cam>, b: Rigid<World, Cam>): number {
  return 2 * Math.asin(Math.min(columnDistance(a.rows, b.rows, 2) / 2, 1));
}

function columnDistance(a: Float64Array, b: Float64Array, column: number): number {
  const dx = (a[column] ?? NaN) - (b[column] ?? NaN);
  const dy = (a[4 + column] ?? NaN) - (b[4 + column] ?? NaN);
  const dz = (a[8 + column] ?? NaN) - (b[8 + column] ?? NaN);
  return Math.sqrt(dx * dx + dy * dy + dz * dz);
}

export function cameraOfWire(camera: WireCamera): Camera {
  return { pinhole: camera.pinhole, worldFromCam: rigid(camera.world_from_cam) };
}

/** A camera of its own, to be kept when the frame that brought it is over. */
export function copyOfCamera({ pinhole, worldFromCam }: Camera): Camera {
  return { pinhole: { ...pinhole }, worldFromCam: rigid(worldFromCam.rows) };
}

export function wireOfCamera(camera: Camera): WireCamera {
  return { pinhole: camera.pinhole, world_from_cam: Array.from(camera.worldFromCam.rows) };
}
