/**
 * Which captured views to render from, and how much each counts; twin of src/peaking/view_weights.py.
 * Asked at every frame, so nothing is made here but once.
 */

import type { Camera } from './geometry';

const GRID = 5;
const NUM_POINTS = GRID * GRID;
const MIN_OVERLAP = 0.05;
const CLOSE_M = 0.002;
const CANDIDATES = 64;
const RANGE = 1.3;

/** The views for one frame, best first. Filled anew at every call, always the same object. */
export interface ChosenViews {
  readonly count: number;
  /** Which of the captured views. */
  readonly index: Int32Array;
  /** Their shares; they sum to 1. */
  readonly weight: Float64Array;
  readonly distance_m: Float64Array;
}

/** Which of the captured views may be chosen: 1 or 0 for each. Null: all of them. */
export type Among = Uint8Array | null;

export class ViewWeights {
  readonly #chosen: { -readonly [K in keyof ChosenViews]: ChosenViews[K] };
  readonly #closest: Smallest;
  readonly #cheapest: Smallest;
  #distance_m = new Float64Array(16);
  #cost_m = new Float64Array(16);
  #cameras: readonly Camera[] = [];
  #target: Camera | null = null;

  /** @param maxCount So many are chosen, at most. */
  constructor(readonly maxCount: number) {
    this.#chosen = {
      count: 0, index: new Int32Array(maxCount), weight: new Float64Array(maxCount),
      distance_m: new Float64Array(maxCount),
    };
    this.#closest = new Smallest(Math.max(CANDIDATES, 8 * maxCount));
    this.#cheapest = new Smallest(maxCount + 1); // and the best that is left out
  }

  /** Measure how far the views are from a target, for all that is asked next. @throws RangeError */
  measure(cameras: readonly Camera[], target: Camera): void {
    if (cameras.length === 0) throw new RangeError('need at least one captured view');
    if (this.#distance_m.length < cameras.length) {
      this.#distance_m = new Float64Array(2 * cameras.length);
      this.#cost_m = new Float64Array(2 * cameras.length);
    }
    const t = target.worldFromCam.rows;
    for (let i = 0; i < cameras.length; i += 1) {
      const s = cameras[i]?.worldFromCam.rows ?? t;
      const dx = at(s, 3) - at(t, 3);
      const dy = at(s, 7) - at(t, 7);
      const dz = at(s, 11) - at(t, 11);
      this.#distance_m[i] = Math.sqrt(dx * dx + dy * dy + dz * dz);
    }
    this.#cameras = cameras;
    this.#target = target;
  }

  /** The closest view; of equally close ones the first. */
  get closest(): number {
    let closest = 0;
    for (let i = 1; i < this.#cameras.length; i += 1) {
      if (at(this.#distance_m, i) < at(this.#distance_m, closest)) closest = i;
    }
    return closest;
  }

  /** The paper's: the `count` nearest, w ∝ exp(-l/γ), γ the largest distance among them. */
  byDistance(count: number, among: Among = null): ChosenViews {
    const chosen = this.#chosen;
    this.#check(count);
    const near = this.#nearest(count, among);
    const gamma_m = near.largest;
    for (let k = 0; k < near.count; k += 1) {
      const index = near.index[k] ?? 0;
      chosen.index[k] = index;
      chosen.weight[k] = gamma_m > 0 ? Math.exp(-at(this.#distance_m, index) / gamma_m) : 1;
    }
    return this.#normalized(near.count);
  }

  /**
   * Ours: cost = distance / overlap, w ∝ (1/cost)(1 - cost/limit), where the limit is the cost of
   * the best view left out. `sceneDepth_m` is a typical depth, such as the median plane of the
   * nearest view.
   */
  byOverlap(sceneDepth_m: number, count: number, among: Among = null): ChosenViews {
    const chosen = this.#chosen;
    this.#check(count);
    const near = this.#nearest(Math.max(CANDIDATES, 8 * count), among);
    const best = this.#cheapest.clear(count + 1, this.#cost_m);
    for (let k = 0; k < near.count; k += 1) {
      const index = near.index[k] ?? 0;
      // The closest come first, and none costs less than it is far.
      if (best.count > count && at(this.#distance_m, index) + CLOSE_M >= best.largest) break;
      this.#measureCost(index, sceneDepth_m);
      best.add(index);
    }
    const numChosen = Math.min(best.count, count);
    const limit_m = best.count > count ? best.largest : RANGE * best.largest;
    for (let k = 0; k < numChosen; k += 1) {
      const index = best.index[k] ?? 0;
      const cost_m = at(this.#cost_m, index);
      chosen.index[k] = index;
      chosen.weight[k] = Math.max(1 - cost_m / limit_m, 1e-6) / cost_m;
    }
    return this.#normalized(numChosen);
  }

  #check(count: number): void {
    if (count >= 1 && count <= this.maxCount) return;
    throw new RangeError(`need 1 <= count <= ${this.maxCount}, got ${count}`);
  }

  #nearest(count: number, among: Among): Smallest {
    const near = this.#closest.clear(count, this.#distance_m);
    for (let i = 0; i < this.#cameras.length; i += 1) {
      if (among === null || among[i] === 1) near.add(i);
    }
    return near;
  }

  #measureCost(index: number, sceneDepth_m: number): void {
    const view = this.#cameras[index];
    const target = this.#target;
    if (view === undefined || target === null) return;
    const overlap = pointsSeen(view, target, sceneDepth_m) / NUM_POINTS;
    this.#cost_m[index] = (at(this.#distance_m, index) + CLOSE_M) / Math.max(overlap, MIN_OVERLAP);
  }

  #normalized(count: number): ChosenViews {
    const chosen = this.#chosen;
    let total = 0;
    for (let k = 0; k < count; k += 1) total += at(chosen.weight, k);
    for (let k = 0; k < count; k += 1) {
      chosen.weight[k] = at(chosen.weight, k) / total;
      chosen.distance_m[k] = at(this.#distance_m, chosen.index[k] ?? 0);
    }
    chosen.count = count;
    return chosen;
  }
}

/**
 * Indices of the smallest of some values, in order; of equal ones the first that was added comes
 * first. Numbers with a fraction stay in their arrays: handed over, each would be put into a box.
 */
class Smallest {
  readonly index: Int32Array;
  count = 0;
  #values: Float64Array = new Float64Array(0);
  #limit = 0;

  constructor(capacity: number) {
    this.index = new Int32Array(capacity);
  }

  /** Begin anew. @param limit How many are kept, at most. */
  clear(limit: number, values: Float64Array): this {
    this.count = 0;
    this.#limit = Math.min(limit, this.index.length);
    this.#values = values;
    return this;
  }

  /** The largest that was kept; 0 when there is none. */
  get largest(): number {
    return this.count === 0 ? 0 : at(this.#values, this.index[this.count - 1] ?? 0);
  }

  add(index: number): void {
    const value = at(this.#values, index);
    let k = this.count;
    if (k === this.#limit) {
      k -= 1;
      if (!(value < at(this.#values, this.index[k] ?? 0))) return;
    } else this.count += 1;
    for (; k > 0; k -= 1) {
      const before = this.index[k - 1] ?? 0;
      if (!(value < at(this.#values, before))) break;
      this.index[k] = before;
    }
    this.index[k] = index;
  }
}

/** The part of the target's picture that a view saw, if all is at `sceneDepth_m`. */
export function overlapShare(view: Camera, target: Camera, sceneDepth_m: number): number {
  return pointsSeen(view, target, sceneDepth_m) / NUM_POINTS;
}

function pointsSeen(view: Camera, target: Camera, sceneDepth_m: number): number {
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
  return seen;
}

/**
 * For one kind of array, and never outside of it: else engines put every number that is read here
 * into a box of its own.
 */
function at(values: Float64Array, index: number): number {
  return values[index] ?? NaN;
}
