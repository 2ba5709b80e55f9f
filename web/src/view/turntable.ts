/** A camera that is turned around a point, by mouse, touch and keys. */

import { Vector3 as Vector, type PerspectiveCamera } from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { Vector3 } from '../geometry';
import { ARROWS_LOOK, WalkControls, type Walker } from '../walk_controls';

/** It never looks straight up or down: which way is ahead then nobody knows. */
const LEAST_ANGLE_RAD = 0.05;

/** What it tells. */
export interface TurntableHooks {
  /** Somebody takes hold of it. */
  onTouch(): void;
  /** It moved. */
  onMove(): void;
}

export class Turntable implements Walker, Disposable {
  readonly #camera: PerspectiveCamera;
  readonly #canvas: HTMLCanvasElement;
  readonly #hooks: TurntableHooks;
  readonly #keys: WalkControls;
  readonly #stop = new AbortController();
  #orbit: OrbitControls;
  #up: Vector;

  constructor(
    camera: PerspectiveCamera, canvas: HTMLCanvasElement, up: Vector3, hooks: TurntableHooks,
    keysOf: Window | HTMLElement,
  ) {
    this.#camera = camera;
    this.#canvas = canvas;
    this.#hooks = hooks;
    this.#up = new Vector(...up);
    camera.up.copy(this.#up);
    this.#orbit = this.#made();
    this.#keys = new WalkControls(this, {
      keys: ARROWS_LOOK, walk_m_per_s: 1, drag_rad_per_px: 0, wheel_m_per_px: 0, pinch_m_per_px: 0,
    });
    this.#keys.onInput = () => {
      hooks.onTouch();
      hooks.onMove();
    };
    this.#keys.attachKeys(keysOf, this.#stop.signal);
  }

  /** Whether keys are heard. */
  get active(): boolean {
    return this.#keys.enabled;
  }

  set active(active: boolean) {
    this.#keys.enabled = active;
  }

  /** Whether a key that moves it is held, or it still moves by one. */
  get moving(): boolean {
    return this.#keys.moving;
  }

  /** What it is turned around; may be written. */
  get target(): Vector {
    return this.#orbit.target;
  }

  /** Another way is up from now on. */
  setUp(up: Vector3): void {
    const target = this.target.clone();
    this.#up = new Vector(...up);
    this.#camera.up.copy(this.#up);
    this.#orbit.dispose();
    this.#orbit = this.#made();
    this.target.copy(target);
  }

  /** Turn around what lies so far ahead from now on. */
  aim(ahead: number): void {
    const forward = new Vector(0, 0, -1).applyQuaternion(this.#camera.quaternion);
    this.target.copy(this.#camera.position).addScaledVector(forward, ahead);
  }

  /** Let time pass for what keys move. */
  advance(step_ms: number): void {
    this.#keys.advance(step_ms);
  }

  /** Put the camera where it is by now. @returns Whether it moved. */
  update(): boolean {
    return this.#orbit.update();
  }

  turn(yaw_rad: number, pitch_rad: number): void {
    const offset = this.#camera.position.clone().sub(this.target);
    offset.applyAxisAngle(this.#up, -yaw_rad);
    const side = this.#up.clone().cross(offset).normalize();
    const angle = offset.angleTo(this.#up) + pitch_rad;
    if (angle > LEAST_ANGLE_RAD && angle < Math.PI - LEAST_ANGLE_RAD) offset.applyAxisAngle(side, pitch_rad);
    this.#camera.position.copy(this.target).add(offset);
  }

  /** Steps are shares of how far away it is. */
  walk(right: number, up: number, ahead: number): void {
    const offset = this.target.clone().sub(this.#camera.position);
    const distance = offset.length();
    const level = offset.clone().addScaledVector(this.#up, -offset.dot(this.#up)).normalize();
    const aside = level.clone().cross(this.#up);
    const step = level.multiplyScalar(ahead).addScaledVector(aside, right).addScaledVector(this.#up, up)
      .multiplyScalar(distance);
    this.#camera.position.add(step);
    this.target.add(step);
  }

  [Symbol.dispose](): void {
    this.#stop.abort();
    this.#orbit.dispose();
  }

  #made(): OrbitControls {
    const orbit = new OrbitControls(this.#camera, this.#canvas);
    orbit.enableDamping = true;
    orbit.dampingFactor = 0.12;
    orbit.addEventListener('start', () => this.#hooks.onTouch());
    orbit.addEventListener('change', () => this.#hooks.onMove());
    return orbit;
  }
}
