/** The points of a place: fetched file by file, as they come, in their colours or by how well they are covered. */

import { BufferAttribute, BufferGeometry, Group, Points, PointsMaterial } from 'three';
import type { Vector3 } from '../geometry';
import type { Axes, Extent, Span } from './floor';

const BYTES_PER_POINT = 15;
/** So many files are fetched at the same time. */
const AT_ONCE = 3;
/** A file that could not be had is tried again so often, after so long and longer. */
const TRIES = 3;
const RETRY_MS = 3000;
/** Cells in which it is counted who sees a point, along the largest side. */
const CELLS = 70;
/** Seen by one view, by two, by three and more. */
const COVERAGE = [[1, 0.78, 0.34], [0.72, 0.85, 0.42], [0.36, 0.84, 0.54]] as const;

export interface PointSet {
  readonly xyz: Float32Array;
  /** sRGB. */
  readonly rgb: Uint8Array;
}

/** @throws RangeError The length is not that of points. */
export function pointsOf(bytes: ArrayBuffer): PointSet {
  const count = bytes.byteLength / BYTES_PER_POINT;
  if (!Number.isInteger(count)) throw new RangeError(`points: need a multiple of ${BYTES_PER_POINT} bytes, got ${bytes.byteLength}`);
  return { xyz: new Float32Array(bytes, 0, 3 * count), rgb: new Uint8Array(bytes, 12 * count, 3 * count) };
}

export class PointSets implements Disposable {
  readonly group = new Group();
  readonly #fetch: (file: string) => Promise<ArrayBuffer>;
  readonly #wake: () => void;
  readonly #onProblem: (problem: string) => void;
  readonly #material = new PointsMaterial({ size: 2, sizeAttenuation: false, vertexColors: true });
  /** Null: on its way. */
  readonly #sets = new Map<string, { readonly points: Points; readonly set: PointSet } | null>();
  #wanted: readonly string[] = [];
  #loading = 0;
  #byCoverage = false;
  /** How often a file could not be had. */
  readonly #failures = new Map<string, number>();

  constructor(
    fetch: (file: string) => Promise<ArrayBuffer>, wake: () => void, onProblem: (problem: string) => void,
  ) {
    this.#fetch = fetch;
    this.#wake = wake;
    this.#onProblem = onProblem;
  }

  /** Show the points of these files from now on. */
  update(files: readonly string[]): void {
    this.#wanted = files;
    const wanted = new Set(files);
    for (const [file, entry] of Array.from(this.#sets)) {
      if (wanted.has(file)) continue;
      this.#sets.delete(file);
      if (entry !== null) this.#remove(entry.points);
    }
    this.#fetchNext();
  }

  set pixelRatio(ratio: number) {
    this.#material.size = 2 * ratio;
  }

  /** How many points there are. */
  get count(): number {
    let sum = 0;
    for (const entry of this.#sets.values()) sum += entry === null ? 0 : entry.set.xyz.length / 3;
    return sum;
  }

  set byCoverage(on: boolean) {
    this.#byCoverage = on;
    this.#paint();
    this.#wake();
  }

  /** From the 2nd to the 98th percentile along three axes; null while there are too few. */
  extent(axes: Axes): Extent | null {
    const sets = this.#here();
    if (this.count < 50) return null;
    const every = Math.max(1, Math.floor(this.count / 20_000));
    const span = ([x, y, z]: Vector3): Span => {
      const along: number[] = [];
      for (const { xyz } of sets) {
        for (let i = 0; i < xyz.length; i += 3 * every) {
          along.push(x * (xyz[i] ?? 0) + y * (xyz[i + 1] ?? 0) + z * (xyz[i + 2] ?? 0));
        }
      }
      along.sort((a, b) => a - b);
      const at = (share: number): number => along[Math.floor(share * (along.length - 1))] ?? 0;
      return [at(0.02), at(0.98)];
    };
    return [span(axes[0]), span(axes[1]), span(axes[2])];
  }

  [Symbol.dispose](): void {
    this.#wanted = [];
    for (const entry of this.#sets.values()) if (entry !== null) this.#remove(entry.points);
    this.#sets.clear();
    this.#material.dispose();
  }

  #here(): PointSet[] {
    return Array.from(this.#sets.values()).flatMap((entry) => (entry === null ? [] : [entry.set]));
  }

  #fetchNext(): void {
    for (const file of this.#wanted) {
      if (this.#loading >= AT_ONCE) return;
      if (this.#sets.has(file)) continue;
      this.#sets.set(file, null);
      this.#loading += 1;
      void this.#load(file).finally(() => {
        this.#loading -= 1;
        this.#fetchNext();
      });
    }
  }

  async #load(file: string): Promise<void> {
    try {
      const set = pointsOf(await this.#fetch(file));
      if (!this.#wanted.includes(file)) return void this.#sets.delete(file);
      const geometry = new BufferGeometry();
      geometry.setAttribute('position', new BufferAttribute(set.xyz, 3));
      const points = new Points(geometry, this.#material);
      this.#sets.set(file, { points, set });
      this.group.add(points);
      if (this.#byCoverage) this.#paint();
      else paintPoints(points, linearOf(set.rgb));
      this.#wake();
    } catch (error) {
      this.#failed(file, error);
    }
  }

  /** It is tried again some times, unless nobody wants it any more. */
  #failed(file: string, error: unknown): void {
    if (!this.#wanted.includes(file)) return void this.#sets.delete(file);
    const failures = (this.#failures.get(file) ?? 0) + 1;
    this.#failures.set(file, failures);
    this.#onProblem(error instanceof Error ? error.message : String(error));
    if (failures > TRIES) return;
    setTimeout(() => {
      if (this.#sets.get(file) === null) this.#sets.delete(file);
      this.#fetchNext();
    }, failures * RETRY_MS);
  }

  #remove(points: Points): void {
    this.group.remove(points);
    points.geometry.dispose();
  }

  #paint(): void {
    const cells = this.#byCoverage ? new Coverage(this.#here()) : null;
    for (const entry of this.#sets.values()) {
      if (entry === null) continue;
      const { set, points } = entry;
      paintPoints(points, cells === null ? linearOf(set.rgb) : cells.colours(set));
    }
  }
}

function paintPoints(points: Points, colours: Float32Array): void {
  points.geometry.setAttribute('color', new BufferAttribute(colours, 3));
}

/** How many views see each cell of the room. */
class Coverage {
  readonly #low: readonly [number, number, number];
  readonly #size: number;
  readonly #seenBy = new Map<number, number>();

  constructor(sets: readonly PointSet[]) {
    const low: [number, number, number] = [Infinity, Infinity, Infinity];
    let most = 0;
    for (const { xyz } of sets) {
      for (let i = 0; i < xyz.length; i += 1) low[i % 3] = Math.min(low[i % 3] ?? 0, xyz[i] ?? 0);
    }
    for (const { xyz } of sets) {
      for (let i = 0; i < xyz.length; i += 1) most = Math.max(most, (xyz[i] ?? 0) - (low[i % 3] ?? 0));
    }
    this.#low = low;
    this.#size = Math.max(most / CELLS, 1e-6);
    for (const { xyz } of sets) {
      const mine = new Set<number>();
      for (let i = 0; i < xyz.length; i += 3) mine.add(this.#cell(xyz, i));
      for (const cell of mine) this.#seenBy.set(cell, (this.#seenBy.get(cell) ?? 0) + 1);
    }
  }

  colours({ xyz }: PointSet): Float32Array {
    const colours = new Float32Array(xyz.length);
    for (let i = 0; i < xyz.length; i += 3) {
      const count = Math.min(this.#seenBy.get(this.#cell(xyz, i)) ?? 1, COVERAGE.length);
      const paint = COVERAGE[count - 1] ?? COVERAGE[0];
      for (let c = 0; c < 3; c += 1) colours[i + c] = toLinear(paint[c] ?? 0);
    }
    return colours;
  }

  #cell(xyz: Float32Array, i: number): number {
    let key = 0;
    for (let axis = 0; axis < 3; axis += 1) {
      key = key * 1024 + Math.floor(((xyz[i + axis] ?? 0) - (this.#low[axis] ?? 0)) / this.#size);
    }
    return key;
  }
}

function linearOf(rgb: Uint8Array): Float32Array {
  return Float32Array.from(rgb, (value) => toLinear(value / 255));
}

function toLinear(encoded: number): number {
  return encoded <= 0.04045 ? encoded / 12.92 : ((encoded + 0.055) / 1.055) ** 2.4;
}
