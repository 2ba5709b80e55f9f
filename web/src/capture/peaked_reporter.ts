/** Tells the server what the photographer saw: for the dashboard and for studies, not vital. */

import type { PeakedSample } from '../wire';

const EVERY_S = 1;
const BATCH = 3;

/** At most one sample a second, three to a request; what cannot be sent is dropped. */
export class PeakedReporter {
  #last_s = -Infinity;
  #batch: PeakedSample[] = [];

  constructor(
    readonly put: (samples: readonly PeakedSample[]) => Promise<unknown>,
    readonly isOnline: () => boolean,
  ) {}

  /** Whether a sample of this moment would be taken: it is not made for nothing. */
  wants(time_s: number): boolean {
    const since_s = time_s - this.#last_s;
    // A clock that was set back must not silence it.
    return since_s < 0 || since_s >= EVERY_S;
  }

  report(sample: PeakedSample): void {
    if (!this.wants(sample.time_s)) return;
    this.#last_s = sample.time_s;
    if (!this.isOnline()) {
      this.#batch = [];
      return;
    }
    this.#batch.push(sample);
    if (this.#batch.length < BATCH) return;
    const batch = this.#batch;
    this.#batch = [];
    this.put(batch).catch(() => undefined);
  }
}
