/** Whether a server makes MPIs at once: on its first start it compiles for a minute before that. */

import type { ServerInfo } from '../wire';
import type { Api } from './api';
import { browserPacing, type Pacing } from './pacing';

const EVERY_MS = 500;

export const STARTING = 'The server is getting ready.';
export const COMPILING = 'The server is getting ready, which takes a minute on its first start.';
export const SILENT = 'The server does not answer; trying again.';

export class Warmth {
  #share: number;
  #silent = false;
  #asking = false;

  /** @param onChange Called when anything below has changed. */
  constructor(
    readonly api: Pick<Api, 'server'>, info: Pick<ServerInfo, 'warm' | 'warm_share'>,
    readonly onChange: () => void = () => undefined, readonly pacing: Pacing = browserPacing,
  ) {
    this.#share = shareOf(info);
    if (!this.isWarm) void this.ask();
  }

  get isWarm(): boolean {
    return this.#share === 1;
  }

  /** How much is compiled, 0…1; null when the server is ready. */
  get share(): number | null {
    return this.isWarm ? null : this.#share;
  }

  /** What to say of it; null when the server is ready. */
  get sentence(): string | null {
    if (this.isWarm) return null;
    if (this.#silent) return SILENT;
    return this.#share === 0 ? STARTING : COMPILING;
  }

  /** Ask until it is ready: to be called when the server may be another one. */
  async ask(): Promise<void> {
    if (this.#asking) return;
    this.#asking = true;
    for (;;) {
      const before = this.#share, wasSilent = this.#silent;
      const info = await this.api.server().catch(() => null);
      this.#silent = info === null;
      if (info !== null) this.#share = shareOf(info);
      if (this.#share !== before || this.#silent !== wasSilent) this.onChange();
      if (this.isWarm) break;
      await this.pacing.sleep(EVERY_MS, NEVER);
    }
    this.#asking = false;
  }
}

const NEVER = new AbortController().signal;

function shareOf({ warm, warm_share }: Pick<ServerInfo, 'warm' | 'warm_share'>): number {
  return warm ? 1 : Math.min(warm_share, 0.99);
}
