/**
 * What gives way when the device is too slow or too hot: frame times in, a level out. Each level takes
 * more away, what is missed least first; the shutter and the device's own tracking are never touched.
 */

import type { Options } from '../wire';

/** What a level leaves. */
export interface Allowance {
  /** Share of the pixels that are rendered and compared otherwise. */
  readonly pixels: number;
  /** Views that are blended, and views that fill, at most. */
  readonly blended: number;
  readonly filling: number;
  /** Alignments begin no more often than this. */
  readonly alignEvery_ms: number;
  /** Live depth is looked at, and the memory asked, after so many frames. */
  readonly rememberEvery: number;
}

/** From everything to the least. */
export const LEVELS: readonly [Allowance, ...Allowance[]] = [
  { pixels: 1, blended: Infinity, filling: Infinity, alignEvery_ms: 60, rememberEvery: 3 },
  { pixels: 1 / 2, blended: Infinity, filling: Infinity, alignEvery_ms: 60, rememberEvery: 3 },
  { pixels: 1 / 4, blended: Infinity, filling: Infinity, alignEvery_ms: 60, rememberEvery: 3 },
  { pixels: 1 / 4, blended: 2, filling: 1, alignEvery_ms: 60, rememberEvery: 3 },
  { pixels: 1 / 4, blended: 2, filling: 1, alignEvery_ms: 300, rememberEvery: 9 },
];

/** Cameras give 30 pictures a second. Between the two a level stands. */
export const FAST_MS = 40;
export const SLOW_MS = 55;

/** Frame times are smoothed over about this long. */
const SMOOTHING_MS = 500;
/** Slowness lasts so long before more is taken away. */
const RISE_AFTER_MS = 1000;
/** All is well for so long before something is given back; longer each time that was too early. */
const FALL_AFTER_MS = 3000;
const LONGEST_FALL_AFTER_MS = 48_000;
/** What was given back and is taken away again within this was given back too early. */
const RELAPSE_MS = 10_000;
/** A page that stood still says nothing of how fast it draws: one frame counts as so much, at most. */
const LONGEST_FRAME_MS = 1000;
/** In the mean, as so many times what is slow: one long frame is no alarm. */
const LONGEST_IN_MEAN = 2;

export class Governor {
  #level = 0;
  #last_ms: number | null = null;
  #mean_ms = 0;
  /** For how long the frames have been slow, and fast. */
  #slow_ms = 0;
  #fast_ms = 0;
  #fallAfter_ms = FALL_AFTER_MS;
  /** Since something was given back; null when that has proved right. */
  #sinceFall_ms: number | null = null;

  /** @param slow_ms Frames that take longer are too slow. */
  constructor(readonly slow_ms = SLOW_MS) {}

  get level(): number {
    return this.#level;
  }

  get allowance(): Allowance {
    return LEVELS[this.#level] ?? LEVELS[0];
  }

  /** What a frame takes, smoothed; very long frames count as less. */
  get frame_ms(): number {
    return this.#mean_ms;
  }

  /** Nothing is drawn for a while: the next frame does not count as one that took so long. */
  pause(): void {
    this.#last_ms = null;
  }

  /** Tell that a frame is drawn. Returns whether the level is another one now. */
  frame(time_ms: number): boolean {
    const passed_ms = Math.min(Math.max(time_ms - (this.#last_ms ?? time_ms), 0), LONGEST_FRAME_MS);
    this.#last_ms = time_ms;
    if (!(passed_ms > 0)) return false;
    const frame_ms = Math.min(passed_ms, LONGEST_IN_MEAN * this.slow_ms);
    const keep = this.#mean_ms === 0 ? 0 : Math.exp(-frame_ms / SMOOTHING_MS);
    this.#mean_ms = keep * this.#mean_ms + (1 - keep) * frame_ms;
    this.#slow_ms = this.#mean_ms > this.slow_ms ? this.#slow_ms + passed_ms : 0;
    this.#fast_ms = this.#mean_ms < this.slow_ms * (FAST_MS / SLOW_MS) ? this.#fast_ms + passed_ms : 0;
    if (this.#sinceFall_ms !== null) this.#sinceFall_ms += passed_ms;
    if (this.#sinceFall_ms !== null && this.#sinceFall_ms > RELAPSE_MS) {
      this.#sinceFall_ms = null;
      this.#fallAfter_ms = FALL_AFTER_MS;
    }
    if (this.#slow_ms >= RISE_AFTER_MS && this.#level < LEVELS.length - 1) {
      this.#rise();
      return true;
    }
    if (this.#fast_ms >= this.#fallAfter_ms && this.#level > 0) {
      this.#fall();
      return true;
    }
    return false;
  }

  #rise(): void {
    if (this.#sinceFall_ms !== null) {
      this.#fallAfter_ms = Math.min(2 * this.#fallAfter_ms, LONGEST_FALL_AFTER_MS);
      this.#sinceFall_ms = null;
    }
    this.#step(1);
  }

  #fall(): void {
    this.#step(-1);
    this.#sinceFall_ms = 0;
  }

  #step(by: number): void {
    this.#level += by;
    this.#slow_ms = 0;
    this.#fast_ms = 0;
  }
}

/**
 * `?governor=off` draws everything however long it takes, `?governor=200` finds frames of more than 200 ms
 * too slow. The paper's marks are always drawn in full: its rule is about their pixels.
 *
 * @throws RangeError It is neither.
 */
export function governorOf(query: URLSearchParams, { marks }: Pick<Options, 'marks'>): Governor | null {
  const asked = query.get('governor');
  if (asked === 'off' || marks === 'paper') return null;
  if (asked === null) return new Governor();
  const slow_ms = Number(asked);
  if (!(slow_ms > 0 && slow_ms < Infinity)) throw new RangeError(`governor must be off, or milliseconds; got ${asked}`);
  return new Governor(slow_ms);
}
