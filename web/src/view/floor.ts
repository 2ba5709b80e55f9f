/** A floor of squares below a place, which says how large it is. */

import { GridHelper, Group, Matrix4, Vector3 as Vector } from 'three';
import type { Vector3 } from '../geometry';

const CELLS = 20;
/** The place takes up about so many of them. */
const ACROSS = 8;
const MIDDLE = 0x3a414d;
const LINES = 0x232831;

/** Two level axes, and up. */
export type Axes = readonly [right: Vector3, ahead: Vector3, up: Vector3];
/** From and to along each of them. */
export type Extent = readonly [Span, Span, Span];
export type Span = readonly [low: number, high: number];

export class Floor implements Disposable {
  readonly group = new Group();
  #grid: GridHelper | null = null;

  /** Lie below something from now on. */
  fit(axes: Axes, [across, along, upwards]: Extent): void {
    this[Symbol.dispose]();
    const cell = cellFor(Math.max(across[1] - across[0], along[1] - along[0]));
    const grid = new GridHelper(CELLS * cell, CELLS, MIDDLE, LINES);
    const [right, ahead, up] = axes.map((axis) => new Vector(...axis)) as [Vector, Vector, Vector];
    grid.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(right, up, ahead.clone().negate()));
    grid.position.set(0, 0, 0)
      .addScaledVector(right, (across[0] + across[1]) / 2)
      .addScaledVector(ahead, (along[0] + along[1]) / 2)
      .addScaledVector(up, upwards[0]);
    this.group.add(grid);
    this.#grid = grid;
  }

  [Symbol.dispose](): void {
    this.#grid?.dispose();
    this.group.clear();
    this.#grid = null;
  }
}

/** The side of a square for something so large: 0.1, 0.25, 0.5, 1 … */
export function cellFor(extent: number): number {
  const wanted = Math.max(extent / ACROSS, 1e-6);
  const ten = 10 ** Math.floor(Math.log10(wanted));
  return ten * ([1, 2.5, 5, 10].find((step) => step * ten >= wanted) ?? 10);
}

/** Level axes of a world, of which the second is about where somebody looks. */
export function axesOf(up: Vector3, facing: Vector3): Axes {
  const vertical = new Vector(...up);
  const ahead = levelled(new Vector(...facing), vertical) ?? levelled(new Vector(up[1], up[2], up[0]), vertical)
    ?? levelled(new Vector(1, 0, 0), vertical) ?? new Vector(0, 0, 1);
  const right = ahead.clone().cross(vertical);
  return [[right.x, right.y, right.z], [ahead.x, ahead.y, ahead.z], up];
}

/** Null where nothing of it is level. */
function levelled(vector: Vector, up: Vector): Vector | null {
  vector.addScaledVector(up, -vector.dot(up));
  return vector.lengthSq() < 1e-6 ? null : vector.normalize();
}
