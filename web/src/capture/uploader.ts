/**
 * Brings captures from the phone's disk to the server's: one at a time, in order, until the server
 * has said that it has them. Only one tab of the browser works at a time (a Web Lock).
 */

import { ApiError, isRefusal, type Api } from '../server/api';
import { backoff_ms, browserPacing, type Pacing } from '../server/pacing';
import { PROTOCOL, type Capture } from '../wire';
import type { CaptureDb, StoredCapture, StoredSession } from './capture_db';
import { forgetErased } from './erased_sessions';
import { uploadBody } from './upload_body';

export type UploaderApi =
  Pick<Api, 'beginSession' | 'session' | 'uploadCapture' | 'removeCapture' | 'changeSession'>;

export interface UploaderListener {
  /** Something in the database changed. */
  onLocalChange(): void;
  /** The server answered with what it now holds. */
  onAnswer(capture: Capture): void;
  /** What is being sent now; null in between. */
  onUploading(captureId: string | null): void;
  /** Why nothing moves, for the photographer; null when it moves again. */
  onTrouble(problem: string | null): void;
  /** The server has the end of this session, and all its photos. */
  onFinished(sessionId: string): void;
  /** The server knows that this session goes on. */
  onReopened(sessionId: string): void;
  /** The session was erased on the server: this device holds nothing of it any more. */
  onErased(sessionId: string): void;
}

export interface UploaderOptions {
  readonly pacing?: Pacing;
  readonly locks?: Pick<LockManager, 'request'> | null;
  /** Fires `online`; a window. */
  readonly network?: EventTarget | null;
  /** Seconds since 1970, by the clock that photos are taken by. */
  readonly clock_s?: () => number;
}

/** What ends a rest early. */
type EndsBy = 'anything' | 'online' | 'time';

/** What became of one piece of work. */
type Outcome =
  | { readonly kind: 'nothing' }
  | { readonly kind: 'done' }
  | { readonly kind: 'again'; readonly wait_ms: number; readonly endsBy: EndsBy };

const NOTHING: Outcome = { kind: 'nothing' };
const DONE: Outcome = { kind: 'done' };
const LOCK = 'peaking-uploader';
const CUT_OFF_AT_MOST = 3;
/** A full disk and a lost pairing are put right by people. */
const SLOW_MS = 10_000;

export class Uploader {
  readonly #pacing: Pacing;
  readonly #locks: Pick<LockManager, 'request'> | null;
  readonly #network: EventTarget | null;
  readonly #clock_s: () => number;
  readonly #end = new AbortController();
  #rest = new AbortController();
  #restEndsBy: EndsBy = 'anything';
  #woken = false;
  #failures = 0;
  /** Captures at which the server itself failed (5xx) go behind the others. */
  readonly #serverFailed = new Map<string, number>();
  /** Sessions that were begun again since the server did not know them. */
  readonly #begunAgain = new Set<string>();
  /** Other sessions that this device holds, until the server has said that it did not erase them. */
  #unasked: readonly string[] | null = null;

  constructor(
    readonly api: UploaderApi, readonly db: CaptureDb, readonly currentSessionId: string,
    readonly listener: UploaderListener, options: UploaderOptions = {},
  ) {
    this.#pacing = options.pacing ?? browserPacing;
    this.#locks = options.locks === undefined
      ? globalThis.navigator?.locks ?? null : options.locks;
    this.#network = options.network === undefined ? globalThis : options.network;
    this.#clock_s = options.clock_s ?? (() => Date.now() / 1000);
  }

  /** Works until `stop()`; then resolves. */
  async run(): Promise<void> {
    const online = (): void => this.wake('online');
    this.#network?.addEventListener('online', online);
    try {
      while (!this.#end.signal.aborted) {
        const outcome = await this.#exclusively(() => this.#step());
        switch (outcome.kind) {
          case 'nothing': await this.#restFor(null, 'anything'); break;
          case 'again':
            await this.#restFor(outcome.wait_ms, outcome.endsBy);
            break;
          case 'done': break;
          default: outcome satisfies never;
        }
      }
    } finally {
      this.#network?.removeEventListener('online', online);
    }
  }

  /** There is new work, or the network is back. */
  wake(reason: 'work' | 'online'): void {
    this.#woken = true;
    if (reason === 'online') this.#failures = 0;
    const ends = this.#restEndsBy === 'anything'
      || (this.#restEndsBy === 'online' && reason === 'online');
    if (ends) this.#rest.abort();
  }

  stop(): void {
    this.#end.abort();
    this.#rest.abort();
  }

  async #exclusively(work: () => Promise<Outcome>): Promise<Outcome> {
    if (this.#locks === null) return work();
    try {
      const held = this.#locks.request(LOCK, { signal: this.#end.signal }, work);
      return await (held as unknown as Promise<Outcome>);
    } catch (error) {
      if (this.#end.signal.aborted) return DONE;
      throw error;
    }
  }

  async #restFor(wait_ms: number | null, endsBy: EndsBy): Promise<void> {
    if (endsBy === 'anything' && this.#woken) {
      this.#woken = false;
      return;
    }
    this.#rest = new AbortController();
    this.#restEndsBy = endsBy;
    const { signal } = this.#rest;
    if (!this.#end.signal.aborted) {
      if (wait_ms !== null) await this.#pacing.sleep(wait_ms, signal);
      else await new Promise((resolve) => signal.addEventListener('abort', resolve));
    }
    this.#woken = false;
  }

  /** The next piece of work, if any. Undoing is quick, so it goes first. */
  async #step(): Promise<Outcome> {
    if (this.#end.signal.aborted) return DONE;
    if (this.#unasked === null) return this.#askFirst();
    const captures = await this.db.captures();
    const removing = captures.find(({ state }) => state === 'removing');
    const waiting = this.#next(captures);
    const sessions = await this.db.sessions();
    // A finished session takes no photo: that it goes on is said first.
    const reopened = sessions.find(({ begun, pending }) => begun && pending?.finished === false);
    const next = removing ?? waiting;
    const toBegin = sessions.find(({ id, begun }) => !begun
      && id === (next?.sessionId ?? this.currentSessionId));
    try {
      if (toBegin !== undefined) await this.#begin(toBegin);
      else if (reopened !== undefined) await this.#tell(reopened);
      else if (removing !== undefined) await this.#remove(removing);
      else if (waiting !== null) await this.#upload(waiting);
      else {
        const changed = sessions.find(({ begun, pending }) => begun && pending !== null);
        if (changed === undefined) return await this.#askAgain();
        await this.#tell(changed);
      }
    } catch (error) {
      return await this.#failed(error, toBegin === undefined ? next : null, toBegin?.id)
        .catch((fault: unknown) => this.#fault(fault));
    } finally {
      this.listener.onLocalChange();
    }
    this.#failures = 0;
    this.listener.onTrouble(null);
    return DONE;
  }

  /** Whether the server erased what this device holds of other sessions. */
  async #askFirst(): Promise<Outcome> {
    const held = await this.db.sessionIds();
    try {
      await this.#ask(held.filter((id) => id !== this.currentSessionId));
      return DONE;
    } catch (error) {
      return this.#fault(error);
    } finally {
      this.listener.onLocalChange();
    }
  }

  /** There is nothing to send: ask about those sessions that could not be asked about before. */
  async #askAgain(): Promise<Outcome> {
    const unasked = await this.#ask(this.#unasked ?? []);
    return unasked.length === 0 ? NOTHING : this.#retry(0, 'anything');
  }

  async #ask(sessionIds: readonly string[]): Promise<readonly string[]> {
    this.#unasked = sessionIds;
    this.#unasked = await forgetErased(this.api, this.db, sessionIds, (id) => this.listener.onErased(id));
    return this.#unasked;
  }

  #next(captures: readonly StoredCapture[]): StoredCapture | null {
    const late = (capture: StoredCapture): number => this.#serverFailed.get(capture.id) ?? 0;
    return captures.filter(({ state }) => state === 'waiting')
      .sort((a, b) => late(a) - late(b) || a.order - b.order)[0] ?? null;
  }

  async #begin(session: StoredSession): Promise<void> {
    const { name, source, device } = session.request;
    await this.api.beginSession(session.id, {
      protocol: PROTOCOL, name, source, ...(device !== undefined && { device }),
    });
    await this.db.changeSession(session.id, (now) => ({ ...now, begun: true }));
  }

  async #upload({ id, sessionId }: StoredCapture): Promise<void> {
    const capture = await this.db.changeCapture(id, (now) =>
      now.state === 'waiting' ? { ...now, attempts: now.attempts + 1 } : null);
    if (capture === null) return;
    const photo = await this.db.photo(id);
    // Read whole before it is sent: a file that cannot be read must not look like a lost network.
    const bytes = await photo?.jpeg?.arrayBuffer().catch(() => null) ?? null;
    if (photo === null || bytes === null) {
      await this.#refuse(id, "This photo can no longer be read from the browser's storage.");
      return;
    }
    const jpeg = new Blob([bytes], { type: 'image/jpeg' });
    this.listener.onUploading(id);
    try {
      const answer = await this.api.uploadCapture(
        sessionId, id, uploadBody({ ...capture, sent_s: this.#clock_s(), jpeg, depth: photo.depth }),
        this.#end.signal);
      await this.db.acknowledge(id);
      this.#serverFailed.delete(id);
      this.#begunAgain.delete(sessionId);
      this.listener.onAnswer(answer);
    } finally {
      this.listener.onUploading(null);
    }
  }

  async #remove({ id, sessionId }: StoredCapture): Promise<void> {
    try {
      this.listener.onAnswer(await this.api.removeCapture(sessionId, id));
    } catch (error) {
      if (!(error instanceof ApiError) || error.status !== 404) throw error;
      // It never arrived there. If it still does, the mark that stays makes the session undo it.
      return this.db.confirmRemoval(id);
    }
    await this.db.forgetUndone(id);
  }

  async #tell({ id, pending }: StoredSession): Promise<void> {
    if (pending === null) return;
    try {
      await this.api.changeSession(id, pending);
    } catch (error) {
      if (!(error instanceof ApiError) || !isRefusal(error)) throw error;
      await this.db.changeSession(id, (now) => ({ ...now, pending: null }));
      throw error;
    }
    await this.db.changeSession(id, (now) =>
      ({ ...now, pending: now.pending === null || sameChange(now.pending, pending)
        ? null : now.pending }));
    if (pending.finished === false) this.listener.onReopened(id);
    if (pending.finished !== true) return;
    await this.db.forgetSession(id);
    this.listener.onFinished(id);
  }

  /** Keeps the photo; the photographer can download it, try again, or undo it. */
  async #refuse(id: string, problem: string): Promise<void> {
    await this.db.changeCapture(id, (now) =>
      now.state === 'waiting' ? { ...now, state: 'failed', problem } : null);
  }

  /** @param toBegin The session that could not be begun, if it was that. */
  async #failed(
    error: unknown, capture: StoredCapture | null, toBegin?: string,
  ): Promise<Outcome> {
    if (this.#end.signal.aborted) return DONE;
    if (!(error instanceof ApiError)) return this.#fault(error);
    const sessionId = capture?.sessionId ?? toBegin;
    if (isClosed(error) && sessionId !== undefined) return this.#closed(sessionId, error);
    if (isRefusal(error) && capture !== null) {
      if (error.status === 404 && !this.#begunAgain.has(capture.sessionId)) {
        this.#begunAgain.add(capture.sessionId);
        await this.db.changeSession(capture.sessionId, (now) => ({ ...now, begun: false }));
        return DONE;
      }
      // An undo that is refused for ever would hold up everything behind it.
      if (capture.state === 'removing') await this.db.confirmRemoval(capture.id);
      else await this.#refuse(capture.id, error.problem);
      return DONE;
    }
    this.listener.onTrouble(error.problem);
    switch (error.status) {
      case 401: return this.#retry(SLOW_MS, 'online');
      case 507: return this.#retry(SLOW_MS, 'time');
      case 0: return this.#retry(0, 'online');
      default:
        if (capture !== null && error.status !== 503) {
          // What arrives without its end each time lies here without it.
          if (error.kind === 'cut-off' && (this.#serverFailed.get(capture.id) ?? 0) + 1 >= CUT_OFF_AT_MOST) {
            this.#serverFailed.delete(capture.id);
            await this.#refuse(capture.id, error.problem);
            return DONE;
          }
          this.#sendLater(capture.id);
        }
        return this.#retry((error.retryAfter_s ?? 0) * 1000, 'time');
    }
  }

  /** The session takes nothing any more: the photos stay here, unless it was erased by right. */
  async #closed(sessionId: string, error: ApiError): Promise<Outcome> {
    if (error.kind === 'erased') {
      await this.db.eraseSession(sessionId);
      this.listener.onErased(sessionId);
      return DONE;
    }
    const captures = await this.db.captures(sessionId);
    for (const { id, state } of captures) {
      if (state === 'removing') await this.db.confirmRemoval(id);
      else await this.#refuse(id, error.problem);
    }
    if (captures.some(({ state }) => state === 'removing' || state === 'waiting')) return DONE;
    this.listener.onTrouble(error.problem);
    return this.#retry(SLOW_MS, 'time');
  }

  /** The database, or a fault of ours: said, and tried again; the photo is where it was. */
  #fault(error: unknown): Outcome {
    this.listener.onTrouble(`Upload failed: ${String(error)}`);
    return this.#retry(0, 'online');
  }

  #sendLater(id: string): void {
    this.#serverFailed.set(id, 1 + (this.#serverFailed.get(id) ?? 0));
  }

  #retry(atLeast_ms: number, endsBy: EndsBy): Outcome {
    this.#failures += 1;
    const wait_ms = Math.max(atLeast_ms, backoff_ms(this.#failures, this.#pacing));
    return { kind: 'again', wait_ms, endsBy };
  }
}

/** Whether nothing of this session will be taken, whatever is sent. */
function isClosed({ status, kind }: ApiError): boolean {
  return status === 410 || kind === 'not-admitted';
}

function sameChange(a: object, b: object): boolean {
  return JSON.stringify(a) === JSON.stringify(b);
}
