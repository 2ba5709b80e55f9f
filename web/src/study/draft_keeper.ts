/**
 * Half-filled forms, kept: each change is on this device at once and on the server a moment later.
 * Only what changed is sent, so two tabs do not undo each other.
 */

import { dictionary, list, nullable, number, parseKept, text, union } from '../schema';
import { ApiError } from '../server/api';
import type { Answer, Answers } from './study_api';

export type Keeping = 'saved' | 'saving' | 'not_saved';

const WAIT_MS = 500;
const AGAIN_MS = 2500;

export class DraftKeeper {
  #unsent: Record<string, Answer>;
  #timer: ReturnType<typeof setTimeout> | null = null;
  #sending = false;
  #closed = false;

  /**
   * @param send Resolves when the server has it on its disk.
   * @param said Hears how it stands.
   */
  constructor(
    readonly key: string,
    readonly send: (answers: Answers) => Promise<unknown>,
    readonly said: (keeping: Keeping) => void,
    readonly storage: Pick<Storage, 'getItem' | 'setItem' | 'removeItem'> = localStorage,
  ) {
    this.#unsent = parsed(storage.getItem(key));
    if (Object.keys(this.#unsent).length > 0) this.#plan(0);
  }

  /** What this device has and the server perhaps not. */
  get unsent(): Answers {
    return this.#unsent;
  }

  change(item: string, answer: Answer): void {
    this.#unsent = { ...this.#unsent, [item]: answer };
    this.#store();
    this.said('saving');
    this.#plan(WAIT_MS);
  }

  /** The form was handed in: there is nothing to keep any more. */
  close(): void {
    this.#closed = true;
    if (this.#timer !== null) clearTimeout(this.#timer);
    this.storage.removeItem(this.key);
  }

  #plan(wait_ms: number): void {
    if (this.#timer !== null) clearTimeout(this.#timer);
    this.#timer = setTimeout(() => void this.#flush(), wait_ms);
  }

  async #flush(): Promise<void> {
    if (this.#closed) return;
    if (this.#sending) return this.#plan(WAIT_MS);
    const sent = this.#unsent;
    if (Object.keys(sent).length === 0) return;
    this.#sending = true;
    try {
      await this.send(sent);
      this.#settle(sent);
    } catch (error) {
      // The form's turn is over (another tab handed it in): it need not be kept.
      if (error instanceof ApiError && error.status === 409) this.#settle(sent);
      else if (!this.#closed) {
        this.said('not_saved');
        this.#plan(AGAIN_MS);
      }
    } finally {
      this.#sending = false;
    }
  }

  #settle(sent: Answers): void {
    if (this.#closed) return;
    const rest = Object.entries(this.#unsent).filter(([item, answer]) => sent[item] !== answer);
    this.#unsent = Object.fromEntries(rest);
    this.#store();
    if (rest.length === 0) this.said('saved');
    else this.#plan(WAIT_MS);
  }

  #store(): void {
    if (Object.keys(this.#unsent).length === 0) this.storage.removeItem(this.key);
    else this.storage.setItem(this.key, JSON.stringify(this.#unsent));
  }
}

const answersSchema = dictionary<Answer>(nullable(union(number(), text, list(text))));

function parsed(kept: string | null): Record<string, Answer> {
  return { ...parseKept(answersSchema, kept) };
}
