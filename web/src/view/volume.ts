/** The room in which a light field shows something: around the places from which it was captured. */

import { positionOf } from '../geometry';
import type { PlaceView } from './place';

/** Within this part of the radius one walks freely; from there on it gets heavier. */
const FREE = 0.6;
/** As a share of the median distance from view to nearest view … */
const SPACINGS = 1.5;
/** … and of how large all of it is. */
const LEAST_OF_EXTENT = 0.25;
/** A single view, or several in one place: so far one can step aside. */
const LEAST = 0.12;

export class Volume {
  /** 0 well inside … 1 at the border; of what was held last. */
  edge = 0;
  /** How far one may be from the nearest view. */
  readonly radius: number;
  readonly #positions: Float64Array;
  /** Where the nearest view is in `#positions`. */
  #nearest = 0;

  constructor(views: readonly PlaceView[]) {
    this.#positions = Float64Array.from(views.flatMap(({ camera }) => positionOf(camera)));
    this.radius = radiusOf(this.#positions);
  }

  /**
   * Hold a step in the volume: beyond `FREE` of the radius a step outwards gets ever shorter, so that
   * one is slowed down and never stopped with a jerk.
   *
   * @param from Where the step begins.
   * @param to Where it ends; written to.
   */
  hold(from: Float64Array, to: Float64Array): void {
    if (this.#positions.length === 0) return;
    const before = this.#fromNearest(from);
    let after = this.#fromNearest(to);
    const free = FREE * this.radius;
    const room = this.radius - free;
    if (after > before && after > free) {
      this.#fromNearest(from);
      this.#shortenOutwards(from, to, before, Math.min(Math.max((before - free) / room, 0), 1));
      after = this.#fromNearest(to);
    }
    if (after > this.radius) this.#pull(to, after);
    this.edge = Math.min(Math.max((after - free) / room, 0), 1);
  }

  /** Take away this share of what leads away from the nearest view: along the border one walks freely. */
  #shortenOutwards(from: Float64Array, to: Float64Array, distance: number, share: number): void {
    if (distance < 1e-9) return;
    let outwards = 0;
    for (let axis = 0; axis < 3; axis += 1) {
      const away = ((from[axis] ?? 0) - (this.#positions[this.#nearest + axis] ?? 0)) / distance;
      outwards += away * ((to[axis] ?? 0) - (from[axis] ?? 0));
    }
    if (outwards <= 0) return;
    for (let axis = 0; axis < 3; axis += 1) {
      const away = ((from[axis] ?? 0) - (this.#positions[this.#nearest + axis] ?? 0)) / distance;
      to[axis] = (to[axis] ?? 0) - share * outwards * away;
    }
  }

  /** Put a position back to the border. */
  #pull(at: Float64Array, distance: number): void {
    const keep = this.radius / distance;
    for (let axis = 0; axis < 3; axis += 1) {
      const centre = this.#positions[this.#nearest + axis] ?? 0;
      at[axis] = centre + keep * ((at[axis] ?? 0) - centre);
    }
  }

  #fromNearest(at: Float64Array): number {
    const p = this.#positions;
    let least = Infinity;
    for (let i = 0; i < p.length; i += 3) {
      const d = Math.hypot((p[i] ?? 0) - (at[0] ?? 0), (p[i + 1] ?? 0) - (at[1] ?? 0), (p[i + 2] ?? 0) - (at[2] ?? 0));
      if (d >= least) continue;
      least = d;
      this.#nearest = i;
    }
    return least;
  }
}

function radiusOf(p: Float64Array): number {
  const nearest: number[] = [];
  const low: [number, number, number] = [Infinity, Infinity, Infinity];
  const high: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < p.length; i += 3) {
    let least = Infinity;
    for (let j = 0; j < p.length; j += 3) if (j !== i) least = Math.min(least, between(p, i, j));
    if (least < Infinity) nearest.push(least);
    for (let axis = 0; axis < 3; axis += 1) {
      low[axis] = Math.min(low[axis] ?? 0, p[i + axis] ?? 0);
      high[axis] = Math.max(high[axis] ?? 0, p[i + axis] ?? 0);
    }
  }
  if (nearest.length === 0) return LEAST;
  nearest.sort((a, b) => a - b);
  const spacing = nearest[Math.floor(nearest.length / 2)] ?? 0;
  const extent = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  return Math.max(SPACINGS * spacing, LEAST_OF_EXTENT * extent, LEAST);
}

function between(p: Float64Array, i: number, j: number): number {
  return Math.hypot(
    (p[i] ?? 0) - (p[j] ?? 0), (p[i + 1] ?? 0) - (p[j + 1] ?? 0), (p[i + 2] ?? 0) - (p[j + 2] ?? 0));
}
