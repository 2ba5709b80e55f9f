/**
 * What happened during a capture, on this device until the server has it. Every event has an id, so
 * sending again is always right; the server keeps each once.
 */

import { list, parseKept } from '../schema';
import { ApiError } from '../server/api';
import { backoff_ms, browserPacing, type Pacing } from '../server/pacing';
import { ParticipantApi } from './study_api';
import { MAX_EVENTS, toldSchema, type Told } from './wire';

const PREFIX = 'peaking.study.outbox.';
const EVERY_MS = 1000;
/** Not valid, too much, of somebody who is erased or does not take part (404, 409, 410). */
const NEVER_TAKEN = new Set([400, 404, 409, 410, 413, 422]);

export class Outbox {
  #events: Told[];
  #sending: Promise<void> | null = null;

  /** @param send Resolves when the server has them on its disk. */
  constructor(
    readonly key: string,
    readonly send: (events: readonly Told[]) => Promise<unknown>,
    readonly storage: Pick<Storage, 'getItem' | 'setItem' | 'removeItem'> = localStorage,
  ) {
    this.#events = stored(storage.getItem(key));
  }

  /** Send about once a second, and less often while it fails, until the signal aborts. */
  async run(
    pacing: Pacing = browserPacing, signal: AbortSignal = new AbortController().signal,
  ): Promise<void> {
    let failures = 0;
    while (!signal.aborted) {
      await this.flush().then(() => { failures = 0; }, () => { failures += 1; });
      const wait_ms = failures === 0 ? EVERY_MS : backoff_ms(failures, pacing);
      await pacing.sleep(Math.max(EVERY_MS, wait_ms), signal);
    }
  }

  put(event: Told): void {
    this.#events.push(event);
    this.#store();
  }

  /** Send all that waits. @throws ApiError when the server cannot be reached. */
  async flush(): Promise<void> {
    while (this.#events.length > 0) {
      this.#sending ??= this.#sendSome().finally(() => { this.#sending = null; });
      await this.#sending;
    }
  }

  async #sendSome(): Promise<void> {
    const some = this.#events.slice(0, MAX_EVENTS);
    try {
      await this.send(some);
    } catch (error) {
      // What the server will never take must not keep the rest from it, nor stay on this device.
      if (!(error instanceof ApiError) || !NEVER_TAKEN.has(error.status)) throw error;
      console.error('the server refused events', error.problem, some);
    }
    this.#events = this.#events.slice(some.length);
    this.#store();
  }

  #store(): void {
    if (this.#events.length === 0) this.storage.removeItem(this.key);
    else this.storage.setItem(this.key, JSON.stringify(this.#events));
  }
}

/** The outbox of a capture session of a participant. */
export function outboxOf(study: ParticipantApi, session: string): Outbox {
  return new Outbox(prefixOf(study) + session, (events) =>
    study.tell(crypto.randomUUID(), session, events));
}

/**
 * Send what earlier pages of this phone could not; `own` is a session that has its outbox. What is of
 * a participant whose phone this no longer is does not stay here.
 */
export function sendLeftovers(study: ParticipantApi, own: string | null = null): void {
  for (const key of Object.keys(localStorage)) {
    if (!key.startsWith(PREFIX) || key === prefixOf(study) + own) continue;
    const [participant = '', session = ''] = key.slice(PREFIX.length).split('.');
    if (participant === study.participant) {
      void outboxOf(study, session).run();
      continue;
    }
    const theirs = new ParticipantApi(study.api, participant);
    void new Outbox(key, (events) => theirs.tell(crypto.randomUUID(), session, events)
      .catch((error: unknown) => {
        if (!(error instanceof ApiError) || error.status !== 403) throw error;
      })).run();
  }
}

function prefixOf(study: ParticipantApi): string {
  return `${PREFIX}${study.participant}.`;
}

function stored(text: string | null): Told[] {
  return [...parseKept(list(toldSchema), text) ?? []];
}
