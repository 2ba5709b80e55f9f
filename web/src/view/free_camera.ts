/** A camera that one carries upright through a volume, and turns freely. */

import {
  forwardOf, identity, pinholeScratch, positionOf, type Cam, type Camera, type Pinhole, type Rigid, type Vector3,
  type World,
} from '../geometry';
import type { Walker } from '../walk_controls';
import type { Volume } from './volume';

const MAX_PITCH_RAD = 1.45;
/** A picture that does not fill the screen is enlarged so much, at most: then its border shows. */
const MOST_CROPPED = 2;

/** Where one looks from: enough to come back to. */
export interface Stand {
  readonly position: Vector3;
  readonly yaw_rad: number;
  readonly pitch_rad: number;
}

export class FreeCamera implements Walker {
  /** Written anew at every `update`. */
  readonly camera: Camera;
  volume: Volume | null = null;
  readonly #pinhole = pinholeScratch();
  readonly #worldFromCam: Rigid<World, Cam> = identity();
  readonly #position = new Float64Array(3);
  readonly #next = new Float64Array(3);
  /** Level, and at right angles: where yaw 0 looks, and to the right of it; then up. */
  readonly #ahead = new Float64Array(3);
  readonly #right = new Float64Array(3);
  readonly #up = new Float64Array(3);
  #yaw_rad = 0;
  #pitch_rad = 0;
  /** The window leans so far to the side, metres right and up. */
  readonly #lean = new Float64Array(2);

  /** @param up Unit vector. @param facing Where yaw 0 looks, about. */
  constructor(up: Vector3, facing: Vector3) {
    this.camera = { pinhole: this.#pinhole, worldFromCam: this.#worldFromCam };
    this.#up.set(up);
    // What looks straight up or down has no direction: any level one does.
    level(facing, up, this.#ahead);
    if (Math.hypot(...this.#ahead) < 1e-3) level(Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], up, this.#ahead);
    normalise(this.#ahead);
    cross(this.#ahead, this.#up, this.#right);
  }

  get stand(): Stand {
    const [x = 0, y = 0, z = 0] = this.#position;
    return { position: [x, y, z], yaw_rad: this.#yaw_rad, pitch_rad: this.#pitch_rad };
  }

  set stand({ position, yaw_rad, pitch_rad }: Stand) {
    this.#position.set(position);
    this.#yaw_rad = yaw_rad;
    this.#pitch_rad = pitch_rad;
    this.#next.set(position);
    this.volume?.hold(this.#position, this.#next);
    this.#position.set(this.#next);
  }

  /** Where one stands to look as a camera does, upright. */
  standOf(camera: Camera): Stand {
    const forward = forwardOf(camera);
    const ahead = dot(forward, this.#ahead);
    const right = dot(forward, this.#right);
    return {
      position: positionOf(camera),
      yaw_rad: Math.atan2(-right, ahead),
      pitch_rad: Math.asin(Math.min(Math.max(dot(forward, this.#up), -1), 1)),
    };
  }

  turn(yaw_rad: number, pitch_rad: number): void {
    this.#yaw_rad += yaw_rad;
    this.#pitch_rad = Math.min(Math.max(this.#pitch_rad + pitch_rad, -MAX_PITCH_RAD), MAX_PITCH_RAD);
  }

  walk(right_m: number, up_m: number, ahead_m: number): void {
    const s = Math.sin(this.#yaw_rad);
    const c = Math.cos(this.#yaw_rad);
    for (let axis = 0; axis < 3; axis += 1) {
      const ahead = this.#ahead[axis] ?? 0;
      const right = this.#right[axis] ?? 0;
      this.#next[axis] = (this.#position[axis] ?? 0) + right_m * (c * right + s * ahead)
        + ahead_m * (c * ahead - s * right) + up_m * (this.#up[axis] ?? 0);
    }
    this.volume?.hold(this.#position, this.#next);
    this.#position.set(this.#next);
  }

  /** Lean to the side, as before a window: metres right and up. */
  lean(right_m: number, up_m: number): void {
    this.#lean[0] = right_m;
    this.#lean[1] = up_m;
  }

  /** Write the camera for a screen of this size, which shows about what `seen` shows. */
  update(width_px: number, height_px: number, seen: Pinhole): Camera {
    const scale = scaleFor(width_px, height_px, seen, true);
    const k = this.#pinhole;
    k.width_px = width_px;
    k.height_px = height_px;
    k.fx_px = scale * seen.fx_px;
    k.fy_px = scale * seen.fy_px;
    k.cx_px = width_px / 2;
    k.cy_px = height_px / 2;
    this.#place();
    return this.camera;
  }

  #place(): void {
    const m = this.#worldFromCam.rows;
    const s = Math.sin(this.#yaw_rad);
    const c = Math.cos(this.#yaw_rad);
    const sp = Math.sin(this.#pitch_rad);
    const cp = Math.cos(this.#pitch_rad);
    const leanRight = this.#lean[0] ?? 0;
    const leanUp = this.#lean[1] ?? 0;
    for (let axis = 0; axis < 3; axis += 1) {
      const ahead = this.#ahead[axis] ?? 0;
      const aside = this.#right[axis] ?? 0;
      const up = this.#up[axis] ?? 0;
      const heading = c * ahead - s * aside;
      const right = c * aside + s * ahead;
      const down = sp * heading - cp * up;
      m[4 * axis] = right;
      m[4 * axis + 1] = down;
      m[4 * axis + 2] = cp * heading + sp * up;
      m[4 * axis + 3] = (this.#position[axis] ?? 0) + leanRight * right - leanUp * down;
    }
  }
}

/**
 * Pixels of a screen per pixel of a picture.
 *
 * @param fills It fills the screen, though not all of it is seen then; else all of it is.
 */
export function scaleFor(
  width_px: number, height_px: number, seen: Pinhole, fills: boolean,
): number {
  const across = width_px / seen.width_px;
  const down = height_px / seen.height_px;
  const contain = Math.min(across, down);
  return fills ? Math.min(Math.max(across, down), MOST_CROPPED * contain) : contain;
}

/** Between two stands, the shorter way round; `share` 0…1. */
export function between(a: Stand, b: Stand, share: number): Stand {
  const turn = Math.atan2(Math.sin(b.yaw_rad - a.yaw_rad), Math.cos(b.yaw_rad - a.yaw_rad));
  const [ax, ay, az] = a.position;
  const [bx, by, bz] = b.position;
  return {
    position: [ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)],
    yaw_rad: a.yaw_rad + share * turn,
    pitch_rad: a.pitch_rad + share * (b.pitch_rad - a.pitch_rad),
  };
}

function level(vector: Vector3, up: Vector3, out: Float64Array): void {
  const along = dot(vector, up);
  for (let axis = 0; axis < 3; axis += 1) out[axis] = (vector[axis] ?? 0) - along * (up[axis] ?? 0);
}

function normalise(vector: Float64Array): void {
  const length = Math.hypot(...vector);
  for (let axis = 0; axis < 3; axis += 1) vector[axis] = (vector[axis] ?? 0) / length;
}

function dot(a: ArrayLike<number>, b: ArrayLike<number>): number {
  return (a[0] ?? 0) * (b[0] ?? 0) + (a[1] ?? 0) * (b[1] ?? 0) + (a[2] ?? 0) * (b[2] ?? 0);
}

function cross(a: ArrayLike<number>, b: ArrayLike<number>, out: Float64Array): void {
  const [ax = 0, ay = 0, az = 0] = [a[0], a[1], a[2]];
  const [bx = 0, by = 0, bz = 0] = [b[0], b[1], b[2]];
  out[0] = ay * bz - az * by;
  out[1] = az * bx - ax * bz;
  out[2] = ax * by - ay * bx;
}
