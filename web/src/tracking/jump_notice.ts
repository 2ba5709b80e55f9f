/** What the photographer is told when the device's world has moved under it. */

import type { WorldResets } from '../sources/frame_source';

const SHOWN_MS = 6000;
const MOVED = 'The phone found its place again. Earlier views were moved along.';
const LOST = 'The phone lost its place in this room, so earlier views no longer fit. '
  + 'Finish, and begin a new session.';

export class JumpNotice {
  #jumps = 0;
  #followed = 0;
  #lost = 0;
  #until_ms = -Infinity;

  /** @param jumps As `TrackingState` counts them. @returns A sentence, or null; what is lost stays said. */
  of(time_ms: number, jumps: number, { followed, lost }: WorldResets): string | null {
    if (jumps > this.#jumps || followed > this.#followed) this.#until_ms = time_ms + SHOWN_MS;
    this.#jumps = jumps;
    this.#followed = followed;
    this.#lost = lost;
    if (this.#lost > 0) return LOST;
    return time_ms < this.#until_ms ? MOVED : null;
  }
}
