/**
 * How far the device's pose is off, as a rigid transform of the world: found for one frame, it serves
 * those that follow until the next is found. It is faded in, so that nothing is seen to jump.
 */

import {
  angleBetween, composeInto, distanceBetween, identity, type Cam, type Rigid, type World,
} from '../geometry';

/** A correction further than this from what was carried along is not believed. */
const MAX_MOVE_M = 0.1;
const MAX_TURN_RAD = (5 * Math.PI) / 180;

/** Between two alignments a device does not drift so far: its world has jumped. */
export const JUMP_M = 0.05;
export const JUMP_RAD = (3 * Math.PI) / 180;
/** A jump is believed when the next alignment finds it too, to within this. */
const SAME_JUMP_M = 0.02;
const SAME_JUMP_RAD = (1 * Math.PI) / 180;

/** What is shown follows what was found with this time constant. */
const FADING_MS = 120;
const LONGEST_FRAME_MS = 50;
/** Less than this is no news: else a picture that stands still would be drawn again and again. */
const NO_NEWS_M = 3e-4;
const NO_NEWS_RAD = 2e-4;
const NOTHING_LEFT = 1e-5;
/** After so long without an alignment the device is believed again. */
const HOLD_MS = 3000;
/** So long the last alignment says how far the device is off. */
const FRESH_MS = 1500;

/** Written anew; the object is used again. */
export interface TrackingState {
  /** How far the device's pose is off; null while nobody knows. */
  readonly moved_m: number | null;
  readonly turned_rad: number | null;
  /** How often the device's world jumped, and the views were carried along. */
  readonly jumps: number;
}

type WorldMotion = Rigid<World, World>;

export class PoseCorrection {
  readonly state: { -readonly [K in keyof TrackingState]: TrackingState[K] } =
    { moved_m: null, turned_rad: null, jumps: 0 };

  /** Of all jumps so far: the session's world from the device's. */
  readonly #carried = identity<World, World>();
  readonly #target = identity<World, World>();
  readonly #shown = identity<World, World>();
  readonly #jump = identity<World, World>();
  #jumpSeen = false;
  #lastFound_ms: number | null = null;
  #lastShown_ms: number | null = null;
  readonly #a = identity<World, Cam>();
  readonly #b = identity<World, Cam>();
  readonly #found = identity<World, World>();

  /** The last alignment would be a jump, which the next one has to confirm. */
  get asksAgain(): boolean {
    return this.#jumpSeen;
  }

  /** Where the device is in the session's world: as it says itself, but for jumps. */
  carried(device: Rigid<World, Cam>, out: Rigid<World, Cam>): Rigid<World, Cam> {
    return composeInto(this.#carried, device, out);
  }

  /** The best that is known of where the device is; null while nothing is. */
  suggested(
    time_ms: number, device: Rigid<World, Cam>, out: Rigid<World, Cam>,
  ): Rigid<World, Cam> | null {
    if (!this.#isFresh(time_ms)) return null;
    return composeInto(this.#target, device, out);
  }

  /** Where to render from. To be called once a frame. */
  shown(time_ms: number, device: Rigid<World, Cam>, out: Rigid<World, Cam>): Rigid<World, Cam> {
    if (!this.#isFresh(time_ms)) {
      this.state.moved_m = null;
      this.state.turned_rad = null;
    }
    if (this.#lastFound_ms !== null && time_ms - this.#lastFound_ms > HOLD_MS) {
      this.#target.rows.set(this.#carried.rows);
      this.#lastFound_ms = null;
      this.#jumpSeen = false;
    }
    // A page that stood still for a while fades as slowly.
    const passed_ms = Math.min(Math.max(time_ms - (this.#lastShown_ms ?? time_ms), 0), LONGEST_FRAME_MS);
    this.#lastShown_ms = time_ms;
    composeInto(this.#target, device, this.#a);
    composeInto(this.#shown, device, this.#b);
    const share = 1 - Math.exp(-passed_ms / FADING_MS);
    const near = distanceBetween(this.#a, this.#b) < NOTHING_LEFT
      && angleBetween(this.#a, this.#b) < NOTHING_LEFT;
    if (near) this.#shown.rows.set(this.#target.rows);
    else towards(this.#shown, this.#target, share);
    return composeInto(this.#shown, device, out);
  }

  /**
   * An alignment succeeded.
   *
   * @param device Where the device said that the picture was taken.
   * @param corrected Where it was taken.
   * @param sure All of the pose is known from the picture; only then a jump is believed. Where some of
   *   it is not, that part is as it was rendered.
   */
  found(
    time_ms: number, device: Rigid<World, Cam>, corrected: Rigid<World, Cam>, sure = true,
  ): void {
    const before = composeInto(this.#target, device, this.#a);
    const step_m = distanceBetween(before, corrected);
    const step_rad = angleBetween(before, corrected);
    worldMotion(corrected, device, this.#found);
    if (this.#lastFound_ms !== null && (step_m > JUMP_M || step_rad > JUMP_RAD)) {
      if (sure) this.#maybeJumped(time_ms, device, corrected);
      return;
    }
    this.#jumpSeen = false;
    const untold = this.carried(device, this.#b);
    const moved_m = distanceBetween(untold, corrected);
    const turned_rad = angleBetween(untold, corrected);
    if (moved_m > MAX_MOVE_M || turned_rad > MAX_TURN_RAD) return;
    this.#lastFound_ms = time_ms;
    this.state.moved_m = moved_m;
    this.state.turned_rad = turned_rad;
    if (step_m > NO_NEWS_M || step_rad > NO_NEWS_RAD) this.#target.rows.set(this.#found.rows);
  }

  /** Nothing has changed since the last alignment, which is as good as new. */
  stands(time_ms: number): void {
    if (this.#lastFound_ms !== null) this.#lastFound_ms = time_ms;
  }

  #maybeJumped(time_ms: number, device: Rigid<World, Cam>, corrected: Rigid<World, Cam>): void {
    const seen = composeInto(this.#jump, device, this.#b);
    const again = this.#jumpSeen && distanceBetween(seen, corrected) < SAME_JUMP_M
      && angleBetween(seen, corrected) < SAME_JUMP_RAD;
    this.#jump.rows.set(this.#found.rows);
    this.#jumpSeen = !again;
    if (!again) return;
    // What was there before goes along: the room stands still, the device's numbers have moved.
    for (const each of [this.#carried, this.#target, this.#shown]) each.rows.set(this.#found.rows);
    this.#lastFound_ms = time_ms;
    this.state.moved_m = 0;
    this.state.turned_rad = 0;
    this.state.jumps += 1;
  }

  #isFresh(time_ms: number): boolean {
    return this.#lastFound_ms !== null && time_ms - this.#lastFound_ms < FRESH_MS;
  }
}

/** The motion of the world that takes one camera to another: `to ∘ from⁻¹`. */
function worldMotion(to: Rigid<World, Cam>, from: Rigid<World, Cam>, out: WorldMotion): void {
  const a = to.rows;
  const b = from.rows;
  for (let r = 0; r < 12; r += 4) {
    for (let c = 0; c < 3; c += 1) {
      out.rows[r + c] = (a[r] ?? NaN) * (b[4 * c] ?? NaN) + (a[r + 1] ?? NaN) * (b[4 * c + 1] ?? NaN)
        + (a[r + 2] ?? NaN) * (b[4 * c + 2] ?? NaN);
    }
    out.rows[r + 3] = (a[r + 3] ?? NaN) - ((out.rows[r] ?? NaN) * (b[3] ?? NaN)
      + (out.rows[r + 1] ?? NaN) * (b[7] ?? NaN) + (out.rows[r + 2] ?? NaN) * (b[11] ?? NaN));
  }
}

/** Moves by a share of the way; the two are a few degrees apart, so numbers may be mixed. */
function towards(moving: WorldMotion, goal: WorldMotion, share: number): void {
  const m = moving.rows;
  for (let k = 0; k < 12; k += 1) m[k] = (m[k] ?? NaN) + share * ((goal.rows[k] ?? NaN) - (m[k] ?? NaN));
  // Gram-Schmidt over the rows.
  normalize(m, 0);
  const along = (m[0] ?? NaN) * (m[4] ?? NaN) + (m[1] ?? NaN) * (m[5] ?? NaN) + (m[2] ?? NaN) * (m[6] ?? NaN);
  for (let c = 0; c < 3; c += 1) m[4 + c] = (m[4 + c] ?? NaN) - along * (m[c] ?? NaN);
  normalize(m, 4);
  for (let c = 0; c < 3; c += 1) {
    const next = (c + 1) % 3;
    const last = (c + 2) % 3;
    m[8 + c] = (m[next] ?? NaN) * (m[4 + last] ?? NaN) - (m[last] ?? NaN) * (m[4 + next] ?? NaN);
  }
}

function normalize(m: Float64Array, start: number): void {
  const length = Math.hypot(m[start] ?? NaN, m[start + 1] ?? NaN, m[start + 2] ?? NaN);
  for (let c = 0; c < 3; c += 1) m[start + c] = (m[start + c] ?? NaN) / length;
}
