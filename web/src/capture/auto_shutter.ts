/**
 * The automatic shutter: takes a view when the phone is steady and what is captured lacks what it
 * sees. It takes more than are needed; which of them are kept is chosen later, from all of them.
 */

import type { PictureFault } from './picture_gate';

/** What keeps the shutter from working, where it can be said in a word. */
export type AutoHindrance = 'too-fast' | 'tracking-lost' | 'no-depth' | 'busy' | 'other';

/** What it goes by. The object may be used again for the next frame. */
export interface AutoMoment {
  readonly time_ms: number;
  /** Null: the shutter works. */
  readonly hindrance: AutoHindrance | null;
  /** What is wrong with the picture. */
  readonly fault: PictureFault | null;
  readonly steady: boolean;
  readonly views: number;
  /** Of these, whose MPI takes part already. */
  readonly ready: number;
  /** What a view from here mends, 0…1 of what is visible; null: not known. */
  readonly peakedShare: number | null;
}

/** Why it does not take a view now. */
export type AutoWait = 'first-view' | 'unsteady' | 'on-its-way' | 'nothing-new' | AutoHindrance | PictureFault;

export const AUTO_WAITS: Readonly<Record<AutoWait, string>> = {
  'first-view': 'Auto: begins after your first view',
  'too-fast': 'Auto: too fast',
  'tracking-lost': 'Auto: tracking is lost',
  'no-depth': 'Auto: no depth yet',
  busy: 'Auto: takes a view',
  other: 'Auto: waits',
  blurred: 'Auto: blurred, hold still',
  'too-dark': 'Auto: too dark',
  'too-bright': 'Auto: too bright',
  unsteady: 'Auto: hold still for a moment',
  'on-its-way': 'Auto: looking at the last view',
  'nothing-new': 'Auto: nothing new from here',
};
export const AUTO_TAKES = 'Auto: takes a view';

/** A quarter of the paper's threshold: four times as many are held as are wanted in the end. */
export const WORTH_SHARE = 0.0428 / 4;
/** It has to last so long, so that a flicker is no view. */
export const LASTS_MS = 250;
/** Between two views, at least. */
export const PAUSE_MS = 700;
/** After this a view that has not come is not waited for. */
export const PATIENCE_MS = 3000;

export class AutoShutter {
  on = false;
  /** Why it does not take a view; null where it is about to. */
  waits: AutoWait | null = 'first-view';
  #takenAt_ms = -Infinity;
  #worthSince_ms: number | null = null;

  /** Look at a frame; true: take a view now. */
  look(now: AutoMoment): boolean {
    this.waits = this.#wait(now);
    if (this.waits !== null) {
      this.#worthSince_ms = null;
      return false;
    }
    this.#worthSince_ms ??= now.time_ms;
    if (now.time_ms - this.#worthSince_ms < LASTS_MS) return false;
    if (now.time_ms - this.#takenAt_ms < PAUSE_MS) return false;
    this.#takenAt_ms = now.time_ms;
    this.#worthSince_ms = null;
    return true;
  }

  /** What it says of itself; null when it is off. */
  get sentence(): string | null {
    if (!this.on) return null;
    return this.waits === null ? AUTO_TAKES : AUTO_WAITS[this.waits];
  }

  #wait(
    { time_ms, hindrance, fault, steady, views, ready, peakedShare }: AutoMoment,
  ): AutoWait | null {
    if (views === 0) return 'first-view';
    if (hindrance !== null) return hindrance;
    // Until it takes part, what it shows would be taken again.
    if (ready < views && time_ms - this.#takenAt_ms < PATIENCE_MS) return 'on-its-way';
    if (peakedShare === null || peakedShare < WORTH_SHARE) return 'nothing-new';
    return fault ?? (steady ? null : 'unsteady');
  }
}
