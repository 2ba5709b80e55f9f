/** What every guide is: targets in the room, and when one counts as taken; twin of guidance/guide.py. */

import {
  angleBetween, distanceBetween, type Cam, type Camera, type Rigid, type World,
} from '../geometry';

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
  return nearest(guide.targets, view, takenBy, guide.nearEnough);
}

/** The open target nearest to where the camera is now; null when all are taken. */
export function nextTarget(guide: Guide, view: Camera, takenBy: TakenBy): number | null {
  return nearest(guide.targets, view, takenBy, ANYWHERE);
}

export function numTaken(takenBy: TakenBy): number {
  let count = 0;
  for (let i = 0; i < takenBy.length; i += 1) if (takenBy[i] !== null) count += 1;
  return count;
}

const ANYWHERE: Tolerance = { position_m: Infinity, direction_rad: Infinity };

/** Asked at every frame, so nothing is made here. */
function nearest(
  targets: Guide['targets'], view: Camera, takenBy: TakenBy, within: Tolerance,
): number | null {
  let best: number | null = null;
  let closest_m = Infinity;
  for (let i = 0; i < targets.length; i += 1) {
    const target = targets[i];
    if (target === undefined || takenBy[i] !== null) continue;
    const distance_m = distanceBetween(target, view.worldFromCam);
    if (distance_m >= closest_m || distance_m > within.position_m) continue;
    if (angleBetween(target, view.worldFromCam) > within.direction_rad) continue;
    closest_m = distance_m;
    best = i;
  }
  return best;
}
