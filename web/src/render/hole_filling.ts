/**
 * Which views fill what the blended ones leave empty; twin of src/peaking/hole_filling.py. Asked a
 * few times a second, so nothing is made here but once.
 */

import type { Camera } from '../geometry';
import { overlapShare } from '../view_weights';

const BLOCKS = 42;
const OPAQUE = 0.9;
const MIN_GAIN = 0.002;
const CANDIDATES = 64;
const CLOSE_M = 0.002;
const MIN_OVERLAP = 0.05;

/** How deep an empty block may be: these parts of the planes of the nearest view are nearer. */
export const FILL_DEPTHS = [0.5, 0.75, 0.95] as const;

/** How many blocks a picture is cut into: columns and rows. */
export function blocksOf(width_px: number, height_px: number): { cols: number; rows: number } {
  const longest = Math.max(width_px, height_px);
  const along = (side: number): number =>
    Math.min(side, Math.max(1, Math.floor((BLOCKS * side + Math.floor(longest / 2)) / longest)));
  return { cols: along(width_px), rows: along(height_px) };
}

/** Mean opacities of blocks. */
export interface Blocks {
  /** RGBA8: the mean opacity of every block in red, top row first. */
  readonly opacity: Uint8Array;
  readonly cols: number;
  readonly rows: number;
}

/** Of an MPI's planes. */
export interface Depths {
  readonly medianDepth_m: number;
  /** As `FILL_DEPTHS` says. */
  readonly fillDepths_m: Float64Array;
}

export class HoleFiller {
  /** How many of `index` count. */
  count = 0;
  /** The views that fill, in the order in which they go under what is there. */
  readonly index: Int32Array;

  readonly #candidates = new Int32Array(CANDIDATES);
  readonly #distance_m = new Float64Array(CANDIDATES);
  readonly #closeness = new Float64Array(CANDIDATES);
  /** How many blocks are empty; their opacity and place, and what each candidate sees of them. */
  #blocks = 0;
  #empty = new Float64Array(0);
  #places = new Int32Array(0);
  #sees = new Float64Array(0);
  /** So many of the candidates were looked at: the closest. */
  #looked = 0;

  /** @param most So many fill, at most. */
  constructor(readonly most: number) {
    this.index = new Int32Array(most);
  }

  /**
   * Choose anew.
   *
   * @param nearest What the nearest view tells of depths.
   * @param isBlended Of all views: whether it is blended.
   */
  choose(
    cameras: readonly Camera[], target: Camera, { opacity, cols, rows }: Blocks,
    { medianDepth_m, fillDepths_m }: Depths, isBlended: (index: number) => boolean,
  ): void {
    this.count = 0;
    const needed = MIN_GAIN * cols * rows;
    const blocks = this.#findEmpty(opacity, cols * rows);
    this.#blocks = blocks;
    let left = 0;
    for (let i = 0; i < blocks; i += 1) left += this.#empty[i] ?? 0;
    if (this.most === 0 || blocks === 0 || left < needed) return;
    const candidates = this.#findCandidates(cameras, target, isBlended);
    this.#looked = 0;
    while (this.count < this.most) {
      // The closest come first, and none fills more than what is left: most need not be looked at.
      let best = -1;
      let most = -1;
      for (let k = 0; k < candidates; k += 1) {
        if (left * closenessOf(this.#distance_m[k] ?? 0, 1, medianDepth_m) <= most) break;
        if (k === this.#looked) {
          const view = cameras[this.#candidates[k] ?? 0] ?? target;
          const overlap = overlapShare(view, target, medianDepth_m);
          this.#closeness[k] = closenessOf(this.#distance_m[k] ?? 0, overlap, medianDepth_m);
          this.#look(k * blocks, view, target, cols, rows, fillDepths_m);
          this.#looked += 1;
        }
        const worth = this.#gain(k, blocks) * (this.#closeness[k] ?? 0);
        if (worth <= most) continue;
        most = worth;
        best = k;
      }
      if (best < 0 || this.#gain(best, blocks) < needed) return;
      this.index[this.count] = this.#candidates[best] ?? 0;
      this.count += 1;
      left = 0;
      for (let i = 0; i < blocks; i += 1) {
        this.#empty[i] = (this.#empty[i] ?? 0) * (1 - (this.#sees[best * blocks + i] ?? 0));
        left += this.#empty[i] ?? 0;
      }
    }
  }

  #findEmpty(opacity: Uint8Array, all: number): number {
    if (this.#empty.length < all) {
      this.#empty = new Float64Array(all);
      this.#places = new Int32Array(all);
      this.#sees = new Float64Array(CANDIDATES * all);
    }
    let blocks = 0;
    for (let place = 0; place < all; place += 1) {
      const mean = (opacity[4 * place] ?? 0) / 255;
      if (mean >= OPAQUE) continue;
      this.#empty[blocks] = 1 - mean;
      this.#places[blocks] = place;
      blocks += 1;
    }
    return blocks;
  }

  /** The closest views that are not blended; of equally close ones the first comes first. */
  #findCandidates(
    cameras: readonly Camera[], target: Camera, isBlended: (index: number) => boolean,
  ): number {
    const t = target.worldFromCam.rows;
    let count = 0;
    for (let index = 0; index < cameras.length; index += 1) {
      const s = cameras[index]?.worldFromCam.rows;
      if (s === undefined || isBlended(index)) continue;
      const dx = (s[3] ?? 0) - (t[3] ?? 0);
      const dy = (s[7] ?? 0) - (t[7] ?? 0);
      const dz = (s[11] ?? 0) - (t[11] ?? 0);
      const distance_m = Math.sqrt(dx * dx + dy * dy + dz * dz);
      let k = count;
      if (k === CANDIDATES) {
        k -= 1;
        if (!(distance_m < (this.#distance_m[k] ?? 0))) continue;
      } else count += 1;
      for (; k > 0 && distance_m < (this.#distance_m[k - 1] ?? 0); k -= 1) {
        this.#distance_m[k] = this.#distance_m[k - 1] ?? 0;
        this.#candidates[k] = this.#candidates[k - 1] ?? 0;
      }
      this.#distance_m[k] = distance_m;
      this.#candidates[k] = index;
    }
    return count;
  }

  /** Writes at how many of the depths the view has each empty block's centre in its picture. */
  #look(
    first: number, view: Camera, target: Camera, cols: number, rows: number, depths_m: Float64Array,
  ): void {
    const blocks = this.#blocks;
    const from = target.pinhole;
    const to = view.pinhole;
    const t = target.worldFromCam.rows;
    const s = view.worldFromCam.rows;
    for (let i = 0; i < blocks; i += 1) {
      const place = this.#places[i] ?? 0;
      const px = (((place % cols) + 0.5) * from.width_px) / cols;
      const py = ((Math.floor(place / cols) + 0.5) * from.height_px) / rows;
      let seen = 0;
      for (let d = 0; d < depths_m.length; d += 1) {
        const depth_m = n(depths_m, d);
        const x = (depth_m * (px - from.cx_px)) / from.fx_px;
        const y = (depth_m * (py - from.cy_px)) / from.fy_px;
        const dx = n(t, 0) * x + n(t, 1) * y + n(t, 2) * depth_m + n(t, 3) - n(s, 3);
        const dy = n(t, 4) * x + n(t, 5) * y + n(t, 6) * depth_m + n(t, 7) - n(s, 7);
        const dz = n(t, 8) * x + n(t, 9) * y + n(t, 10) * depth_m + n(t, 11) - n(s, 11);
        const z = n(s, 2) * dx + n(s, 6) * dy + n(s, 10) * dz;
        if (z <= 0) continue;
        const u = (to.fx_px * (n(s, 0) * dx + n(s, 4) * dy + n(s, 8) * dz)) / z + to.cx_px;
        const v = (to.fy_px * (n(s, 1) * dx + n(s, 5) * dy + n(s, 9) * dz)) / z + to.cy_px;
        if (u >= 0 && v >= 0 && u <= to.width_px && v <= to.height_px) seen += 1;
      }
      this.#sees[first + i] = seen / depths_m.length;
    }
  }

  #gain(k: number, blocks: number): number {
    let gain = 0;
    for (let i = 0; i < blocks; i += 1) {
      gain += (this.#empty[i] ?? 0) * (this.#sees[k * blocks + i] ?? 0);
    }
    return gain;
  }
}

/** How near a view is, 0…1, by how far it is and how much of the picture it sees. */
function closenessOf(distance_m: number, overlap: number, depth_m: number): number {
  const cost_m = (distance_m + CLOSE_M) / Math.max(overlap, MIN_OVERLAP);
  return 1 / (1 + cost_m / depth_m);
}

function n(values: Float64Array, index: number): number {
  return values[index] ?? NaN;
}
