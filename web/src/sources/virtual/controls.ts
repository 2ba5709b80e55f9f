/** Mouse, touch and keys that move the virtual phone: drag to look, WASD or arrows to walk. */

import { WALKABLE } from './room';

/** Where the phone is: metres, y up; yaw to the left and pitch up, radians. */
export interface PhonePose {
  x_m: number;
  y_m: number;
  z_m: number;
  yaw_rad: number;
  pitch_rad: number;
}

const WALK_M_PER_S = 0.5;
const DRAG_RAD_PER_PX = 0.003;
const WHEEL_M_PER_PX = 0.0006;
const PINCH_M_PER_PX = 0.002;
const MAX_PITCH_RAD = 1.3;
/** Speeds follow the keys with this time constant, as an arm does. */
const INERTIA_MS = 120;

const KEYS: Readonly<Record<string, readonly [right: number, up: number, ahead: number]>> = {
  KeyW: [0, 0, 1], ArrowUp: [0, 0, 1], KeyS: [0, 0, -1], ArrowDown: [0, 0, -1],
  KeyA: [-1, 0, 0], ArrowLeft: [-1, 0, 0], KeyD: [1, 0, 0], ArrowRight: [1, 0, 0],
  KeyE: [0, 1, 0], KeyQ: [0, -1, 0],
};

export class PhoneControls {
  readonly #held = new Set<string>();
  readonly #pointers = new Map<number, { x: number; y: number }>();
  #spreadBefore_px = 0;
  readonly #speed = { right: 0, up: 0, ahead: 0 };

  constructor(readonly pose: PhonePose) {}

  /** Listen until the signal aborts. */
  attach(element: HTMLElement, signal: AbortSignal): void {
    const options = { signal };
    window.addEventListener('keydown', (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
      if (!(event.code in KEYS)) return;
      this.#held.add(event.code);
      event.preventDefault();
    }, options);
    window.addEventListener('keyup', (event) => this.#held.delete(event.code), options);
    window.addEventListener('blur', () => this.#held.clear(), options);
    element.style.touchAction = 'none';
    element.addEventListener('pointerdown', (event) => {
      this.#pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      this.#spreadBefore_px = this.#spread_px();
      element.setPointerCapture(event.pointerId);
    }, options);
    element.addEventListener('pointermove', (event) => this.#drag(event), options);
    for (const name of ['pointerup', 'pointercancel'] as const) {
      element.addEventListener(name, (event) => {
        this.#pointers.delete(event.pointerId);
        this.#spreadBefore_px = this.#spread_px();
      }, options);
    }
    element.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.#move(0, 0, -event.deltaY * WHEEL_M_PER_PX);
    }, { signal, passive: false });
  }

  /** Let time pass. */
  advance(step_ms: number): void {
    const keep = Math.exp(-step_ms / INERTIA_MS);
    const speed = this.#speed;
    speed.right = this.#towards(0, keep, speed.right);
    speed.up = this.#towards(1, keep, speed.up);
    speed.ahead = this.#towards(2, keep, speed.ahead);
    const step_m = (WALK_M_PER_S * step_ms) / 1000;
    this.#move(speed.right * step_m, speed.up * step_m, speed.ahead * step_m);
  }

  /** The speed along one axis of `KEYS`, a moment later. */
  #towards(axis: 0 | 1 | 2, keep: number, speed: number): number {
    let aim = 0;
    for (const code of this.#held) aim += KEYS[code]?.[axis] ?? 0;
    const next = keep * speed + (1 - keep) * aim;
    return Math.abs(next) < 1e-3 ? 0 : next;
  }

  #drag(event: PointerEvent): void {
    const last = this.#pointers.get(event.pointerId);
    if (last === undefined) return;
    const dx = event.clientX - last.x;
    const dy = event.clientY - last.y;
    last.x = event.clientX;
    last.y = event.clientY;
    if (this.#pointers.size > 1) {
      // Two fingers carry the phone; each of them brings half. Apart, they bring the scene closer.
      const spread_px = this.#spread_px();
      const ahead_m = (spread_px - this.#spreadBefore_px) * PINCH_M_PER_PX;
      this.#spreadBefore_px = spread_px;
      this.#move((-dx * PINCH_M_PER_PX) / 2, (dy * PINCH_M_PER_PX) / 2, ahead_m);
      return;
    }
    this.pose.yaw_rad += dx * DRAG_RAD_PER_PX;
    this.pose.pitch_rad = clamp(
      this.pose.pitch_rad + dy * DRAG_RAD_PER_PX, -MAX_PITCH_RAD, MAX_PITCH_RAD);
  }

  /** How far the first two fingers are apart; 0 when there are not two. */
  #spread_px(): number {
    const [a, b] = this.#pointers.values();
    return a === undefined || b === undefined ? 0 : Math.hypot(a.x - b.x, a.y - b.y);
  }

  /** Walking is level, wherever the phone looks. */
  #move(right_m: number, up_m: number, ahead_m: number): void {
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

function isTyping(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.closest('input, textarea, select') !== null;
}
