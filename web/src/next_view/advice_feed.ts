/** The newest guidance of the server: asked for when there is news of it, one question at a time. */

import { ApiError, type Api } from '../server/api';
import type { Guidance } from '../wire';

export class AdviceFeed {
  #newest: Guidance | null = null;
  #heard = 0;
  #asked = 0;
  #asking = false;

  constructor(
    private readonly api: Pick<Api, 'guidance'>, private readonly sessionId: string,
    private readonly onNew: (guidance: Guidance) => void,
  ) {}

  /** Null while there is none. */
  get newest(): Guidance | null {
    return this.#newest;
  }

  /** @param news Counts what was heard of it; the same number again is no news. */
  heard(news: number): void {
    this.#heard = news;
    if (!this.#asking && news !== this.#asked) void this.#ask();
  }

  async #ask(): Promise<void> {
    this.#asking = true;
    try {
      while (this.#asked !== this.#heard) {
        this.#asked = this.#heard;
        const guidance = await this.api.guidance(this.sessionId);
        if (guidance.revision === 0 || guidance.revision === this.#newest?.revision) continue;
        this.#newest = guidance;
        this.onNew(guidance);
      }
    } catch (error) {
      // Not vital: the next news ask again.
      if (!(error instanceof ApiError)) throw error;
    } finally {
      this.#asking = false;
    }
  }
}
