/** What every guide is: targets in the room, and when one counts as taken; twin of guidance/guide.py. */

import { forwardOf, positionOf, type Cam, type Camera, type Rigid, type World } from '../geometry';

/** How near a view must be to a target to take it. */
export interface Tolerance {
  /** Largest distance of the two centres of projection. */
  readonly position_m: number;
  /** Largest angle between the two viewing directions; a turn about them does not count. */
  readonly direction_rad: number;
}

export const DIRECTION_TOLERANCE_RAD = (10 * Math.PI) / 180;

/** Where views are wanted. It is fixed when the session starts. */
export interface Guide {
  /** The poses to take views from, in the order in which they are counted. */
  readonly targets: readonly Rigid<World, Cam>[];
  readonly nearEnough: Tolerance;
}

/** For each target the index of the view that took it, or null while it is open. */
export type TakenBy = readonly (number | null)[];

/**
 * Say which targets the captured views have taken: view by view, each takes the nearest target within
 * the tolerance that is still open (of equally near ones the first), and no other.
 */
export function progress(guide: Guide, views: readonly Camera[]): TakenBy {
  const takenBy: (number | null)[] = guide.targets.map(() => null);
  views.forEach((view, index) => {
    const target = withinReach(guide, view, takenBy);
    if (target !== null) takenBy[target] = index;
  });
  return takenBy;
}

/** The open target that this view would take. */
export function withinReach(guide: Guide, view: Camera, takenBy: TakenBy): number | null {
  const { position_m, direction_rad } = guide.nearEnough;
  return nearest(guide, view, takenBy, (target, distance_m) =>
    distance_m <= position_m && angleTo(target, view) <= direction_rad);
}

/** The open target nearest to where the camera is now; null when all are taken. */
export function nextTarget(guide: Guide, view: Camera, takenBy: TakenBy): number | null {
  return nearest(guide, view, takenBy, () => true);
}

export function numTaken(takenBy: TakenBy): number {
  return takenBy.reduce<number>((sum, view) => sum + (view === null ? 0 : 1), 0);
}

function nearest(
  guide: Guide, view: Camera, takenBy: TakenBy,
  fits: (target: Rigid<World, Cam>, distance_m: number) => boolean,
): number | null {
  const here = positionOf(view);
  let best: number | null = null;
  let least_m = Infinity;
  guide.targets.forEach((target, i) => {
    if (takenBy[i] !== null) return;
    const m = target.rows;
    const distance_m = Math.hypot(
      (m[3] ?? NaN) - here[0], (m[7] ?? NaN) - here[1], (m[11] ?? NaN) - here[2]);
    if (distance_m >= least_m || !fits(target, distance_m)) return;
    least_m = distance_m;
    best = i;
  });
  return best;
}

/** Between the viewing directions; exact for small angles too. */
function angleTo(target: Rigid<World, Cam>, view: Camera): number {
  const m = target.rows;
  const ahead = forwardOf(view);
  const chord = Math.hypot(
    (m[2] ?? NaN) - ahead[0], (m[6] ?? NaN) - ahead[1], (m[10] ?? NaN) - ahead[2]);
  return 2 * Math.asin(Math.min(chord / 2, 1));
}
