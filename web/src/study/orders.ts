/**
 * What the experimenter orders is sent until the server answers, each time with the same id: when
 * only the answer was lost, it still counts once.
 */

import { ApiError, NotUnderstood } from '../server/api';
import { backoff_ms, browserPacing, type Pacing } from '../server/pacing';

export interface OrdersOptions {
  /** Called whenever there was no answer, before trying again. */
  readonly onSilence: () => void;
  readonly pacing?: Pacing;
  readonly newId?: () => string;
}

export class Orders {
  readonly #unanswered = new Set<string>();

  constructor(readonly options: OrdersOptions) {}

  /**
   * @param what The same order, given again before it is answered, is not sent a second time.
   * @param send With the id of the order.
   * @returns The answer; null for an order that is still being sent.
   * @throws ApiError when the server refuses.
   */
  async give<T>(what: string, send: (id: string) => Promise<T>): Promise<T | null> {
    if (this.#unanswered.has(what)) return null;
    this.#unanswered.add(what);
    try {
      return await this.#untilAnswered(send);
    } finally {
      this.#unanswered.delete(what);
    }
  }

  async #untilAnswered<T>(send: (id: string) => Promise<T>): Promise<T> {
    const { onSilence, pacing = browserPacing, newId = () => crypto.randomUUID() } = this.options;
    const id = newId();
    for (let failures = 1; ; failures += 1) {
      try {
        return await send(id);
      } catch (error) {
        if (!(error instanceof ApiError) || error.status !== 0 || error instanceof NotUnderstood) {
          throw error;
        }
      }
      onSilence();
      await pacing.sleep(backoff_ms(failures, pacing), new AbortController().signal);
    }
  }
}
