/** Where in the room what is shown is wrong, also outside the picture: cells that are remembered. */

import type { Camera, Vector3 } from '../geometry';

/** What was looked at, row by row from the bottom: share that is wrong, 0…1, and depth, 0 = unknown. */
export interface LookedAt {
  readonly cols: number;
  readonly rows: number;
  readonly share: Float32Array;
  readonly depth_m: Float32Array;
}

/** A surface that is 2^k … 2^(k+1) metres away is cut into cells of this part of 2^k metres. */
const CELLS_PER_DEPTH = 8;
/** So many cells along an axis to each side of the middle. */
const HALF_AXIS = 1 << 14;
/** Of what is seen now in what is remembered. */
const FRESH = 0.5;
/** What is less wrong than this is forgotten. */
const LEAST_SHARE = 0.1;
/** What is nearer than that in all axes of direction belongs together. */
const BINS_PER_RADIAN = 3;
/** Smaller areas, in steradians, are not pointed at: a hand at arm's length covers 0.03. */
const LEAST_AREA_SR = 0.02;

interface Place {
  x_m: number;
  y_m: number;
  z_m: number;
  readonly size_m: number;
  share: number;
}

export class WrongPlaces {
  readonly #places = new Map<number, Place>();
  /** Middle of the largest wrong area outside the picture, when it was looked for last. */
  #target: Place | null = null;
  readonly #direction: [number, number, number] = [0, 0, 0];

  get count(): number {
    return this.#places.size;
  }

  /** Forget everything: the world has moved. */
  clear(): void {
    this.#places.clear();
    this.#target = null;
  }

  /** Remember what a camera looked at, and look for the largest wrong area outside its picture. */
  remember(camera: Camera, { cols, rows, share, depth_m }: LookedAt): void {
    const { pinhole, worldFromCam: { rows: pose } } = camera;
    for (let i = 0; i < cols * rows; i += 1) {
      const z = depth_m[i] ?? 0;
      if (!(z > 0)) continue;
      const u_px = (i % cols + 0.5) / cols * pinhole.width_px;
      const v_px = (1 - (Math.floor(i / cols) + 0.5) / rows) * pinhole.height_px;
      const x = (u_px - pinhole.cx_px) / pinhole.fx_px * z;
      const y = (v_px - pinhole.cy_px) / pinhole.fy_px * z;
      this.#put(
        along(pose, 0, x, y, z), along(pose, 4, x, y, z), along(pose, 8, x, y, z), z, share[i] ?? 0);
    }
    this.#target = this.#largestOutside(camera);
  }

  /**
   * Towards the largest wrong area outside the picture, in axes of the camera; null when there is
   * none, or when it is in the picture by now. The array is used again.
   */
  direction(camera: Camera): Vector3 | null {
    if (this.#target === null) return null;
    this.#look(camera, this.#target);
    return isInPicture(camera, this.#direction) ? null : this.#direction;
  }

  #put(x_m: number, y_m: number, z_m: number, depth_m: number, share: number): void {
    const level = Math.floor(Math.log2(depth_m));
    const size_m = 2 ** level / CELLS_PER_DEPTH;
    let key = level + 16;
    for (const each of [x_m, y_m, z_m]) {
      const cell = Math.floor(each / size_m) + HALF_AXIS;
      if (!(cell >= 0 && cell < 2 * HALF_AXIS)) return;
      key = key * 2 * HALF_AXIS + cell;
    }
    const place = this.#places.get(key);
    if (place === undefined) {
      if (share >= LEAST_SHARE) this.#places.set(key, { x_m, y_m, z_m, size_m, share });
      return;
    }
    place.share += FRESH * (share - place.share);
    if (place.share < LEAST_SHARE) this.#places.delete(key);
  }

  /** The wrong area that covers most, of what is seen in about the same direction. */
  #largestOutside(camera: Camera): Place | null {
    const bins = new Map<number, { area_sr: number; x: number; y: number; z: number }>();
    for (const place of this.#places.values()) {
      this.#look(camera, place);
      const direction = this.#direction;
      const away_m = Math.hypot(...direction);
      if (!(away_m > 0) || isInPicture(camera, direction)) continue;
      const area_sr = place.share * Math.min((place.size_m / away_m) ** 2, 1);
      let key = 0;
      for (const each of direction) {
        key = 64 * key + Math.round(BINS_PER_RADIAN * each / away_m) + BINS_PER_RADIAN;
      }
      const bin = bins.get(key) ?? { area_sr: 0, x: 0, y: 0, z: 0 };
      bins.set(key, bin);
      bin.area_sr += area_sr;
      bin.x += area_sr * place.x_m;
      bin.y += area_sr * place.y_m;
      bin.z += area_sr * place.z_m;
    }
    let best: { area_sr: number; x: number; y: number; z: number } | null = null;
    for (const bin of bins.values()) if (bin.area_sr > (best?.area_sr ?? LEAST_AREA_SR)) best = bin;
    if (best === null) return null;
    const { area_sr, x, y, z } = best;
    return { x_m: x / area_sr, y_m: y / area_sr, z_m: z / area_sr, size_m: 0, share: 1 };
  }

  /** Write where a place is, from the camera. */
  #look({ worldFromCam: { rows } }: Camera, { x_m, y_m, z_m }: Place): void {
    const dx = x_m - (rows[3] ?? NaN);
    const dy = y_m - (rows[7] ?? NaN);
    const dz = z_m - (rows[11] ?? NaN);
    for (let i = 0; i < 3; i += 1) {
      this.#direction[i] = (rows[i] ?? NaN) * dx + (rows[4 + i] ?? NaN) * dy + (rows[8 + i] ?? NaN) * dz;
    }
  }
}

function along(pose: Float64Array, row: number, x: number, y: number, z: number): number {
  return (pose[row] ?? NaN) * x + (pose[row + 1] ?? NaN) * y + (pose[row + 2] ?? NaN) * z
    + (pose[row + 3] ?? NaN);
}

function isInPicture({ pinhole }: Camera, [x, y, z]: Vector3): boolean {
  if (z <= 0) return false;
  const u_px = pinhole.fx_px * x / z + pinhole.cx_px;
  const v_px = pinhole.fy_px * y / z + pinhole.cy_px;
  return u_px >= 0 && v_px >= 0 && u_px < pinhole.width_px && v_px < pinhole.height_px;
}
