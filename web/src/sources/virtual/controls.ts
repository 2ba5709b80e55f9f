/** Moves the virtual phone: drag to look, WASD or arrows to walk, within the room. */

import { ARROWS_WALK, WalkControls, type Walker } from '../../walk_controls';
import { WALKABLE } from './room';

/** Where the phone is: metres, y up; yaw to the left and pitch up, radians. */
export interface PhonePose {
  x_m: number;
  y_m: number;
  z_m: number;
  yaw_rad: number;
  pitch_rad: number;
}

const MAX_PITCH_RAD = 1.3;

export class PhoneControls implements Walker {
  readonly #controls = new WalkControls(this, {
    keys: ARROWS_WALK, walk_m_per_s: 0.5, drag_rad_per_px: 0.003, wheel_m_per_px: 0.0006, pinch_m_per_px: 0.002,
  });

  constructor(readonly pose: PhonePose) {}

  /** Listen until the signal aborts. */
  attach(element: HTMLElement, signal: AbortSignal): void {
    this.#controls.attach(element, signal);
  }

  /** Let time pass. */
  advance(step_ms: number): void {
    this.#controls.advance(step_ms);
  }

  turn(yaw_rad: number, pitch_rad: number): void {
    this.pose.yaw_rad += yaw_rad;
    this.pose.pitch_rad = clamp(this.pose.pitch_rad + pitch_rad, -MAX_PITCH_RAD, MAX_PITCH_RAD);
  }

  walk(right_m: number, up_m: number, ahead_m: number): void {
    const { pose } = this;
    const { low, high } = WALKABLE;
    const s = Math.sin(pose.yaw_rad);
    const c = Math.cos(pose.yaw_rad);
    pose.x_m = clamp(pose.x_m + c * right_m - s * ahead_m, low.x, high.x);
    pose.y_m = clamp(pose.y_m + up_m, low.y, high.y);
    pose.z_m = clamp(pose.z_m - s * right_m - c * ahead_m, low.z, high.z);
  }
}

function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}
