/** One way to show a place; each has a canvas of its own, of which one is visible. */

import type { Camera } from '../geometry';
import type { Place } from './place';

export interface Layer extends Disposable {
  readonly canvas: HTMLCanvasElement;
  /** It is the one that is visible, and hears keys. */
  active: boolean;
  /** The place has changed. */
  update(place: Place): void;
  /** The canvas has this size, in pixels of the device. */
  resize(width_px: number, height_px: number, pixelRatio: number): void;
  /** Look as a camera does; gradually, if there is time. */
  lookFrom(camera: Camera, gradually: boolean): void;
  /** From where it is looked now. */
  camera(): Camera;
  /**
   * Draw if something is new.
   *
   * @returns Whether there is more to come without anybody asking.
   */
  draw(time_ms: number): boolean;
}

/** What layers tell whoever shows them. */
export interface LayerHooks {
  /** Something is new: draw soon. */
  wake(): void;
  /** A sentence for people. */
  onProblem(problem: string): void;
  /** Someone pointed at a view. */
  onPick(view: number): void;
  /** How near the border of what was captured one is, 0…1. */
  onEdge(edge: number): void;
  /** The first picture is there. */
  onFirstPicture(): void;
}

/** After rest, the first step takes as long as a frame of a usual screen. */
export const FIRST_STEP_MS = 16;

/** A moment between two frames may be as long as this. */
export const LONGEST_STEP_MS = 250;

/** Movements take so long. */
export const FLIGHT_MS = 700;

/** Slowly at first, and at last; `share` of the time to share of the way. */
export function eased(share: number): number {
  const t = Math.min(Math.max(share, 0), 1);
  return t * t * (3 - 2 * t);
}

export function wantsLessMotion(): boolean {
  return matchMedia('(prefers-reduced-motion: reduce)').matches;
}
