/** How fast the camera moves; pictures taken in haste are blurred, and their poses lag. */

import { forwardOf, positionOf, type Camera, type Vector3 } from './geometry';

/** At 1 m and a focal length of 1000 px this is 0.8 px for every millisecond of exposure. */
export const TOO_FAST_M_PER_S = 0.8;
export const TOO_FAST_RAD_PER_S = 1.2;

/** Speeds are smoothed over about this long, so that one jump of the tracking is no alarm. */
const SMOOTHING_MS = 150;

export class Motion {
  private last: { time_ms: number; position: Vector3; forward: Vector3 } | null = null;
  private speed_m_per_s = 0;
  private turn_rad_per_s = 0;

  /** Tell where the camera is; null when nobody knows. */
  update(time_ms: number, camera: Camera | null): void {
    if (camera === null) {
      this.last = null;
      this.speed_m_per_s = 0;
      this.turn_rad_per_s = 0;
      return;
    }
    const now = { time_ms, position: positionOf(camera), forward: forwardOf(camera) };
    const before = this.last;
    this.last = now;
    if (before === null || time_ms <= before.time_ms) return;
    const step_ms = time_ms - before.time_ms;
    const keep = Math.exp(-step_ms / SMOOTHING_MS);
    const speed = (distance(before.position, now.position) / step_ms) * 1000;
    const turn = (angle(before.forward, now.forward) / step_ms) * 1000;
    this.speed_m_per_s = keep * this.speed_m_per_s + (1 - keep) * speed;
    this.turn_rad_per_s = keep * this.turn_rad_per_s + (1 - keep) * turn;
  }

  get tooFast(): boolean {
    return this.speed_m_per_s > TOO_FAST_M_PER_S || this.turn_rad_per_s > TOO_FAST_RAD_PER_S;
  }
}

/** How far a camera went and turned, metres and radians. */
export function motionBetween(
  before: Camera, now: Camera,
): { readonly step_m: number; readonly turn_rad: number } {
  return {
    step_m: distance(positionOf(before), positionOf(now)),
    turn_rad: angle(forwardOf(before), forwardOf(now)),
  };
}

function distance(a: Vector3, b: Vector3): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/** Between unit vectors, radians; exact for small angles too. */
function angle(a: Vector3, b: Vector3): number {
  return 2 * Math.asin(Math.min(distance(a, b) / 2, 1));
}
