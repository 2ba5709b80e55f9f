/**
 * A session of captures, as the rest of the client sees it. It can begin, go on and end without a
 * server: everything is on this device's disk first, and is told to the server when there is one.
 */

import { wireOfCamera } from '../geometry';
import { ApiError, type Api } from '../server/api';
import { sessionEvents, type Connection } from '../server/events';
import type { Pacing } from '../server/pacing';
import type { Capture, DatasetQuery, NewSession, PeakedSample, Selection } from '../wire';
import { askToPersist, type CaptureDb } from './capture_db';
import {
  listsTheSame, NOTHING_KNOWN, reduce, restorableOf, risenOf, viewsOf, type CaptureAction, type CapturedView,
  type CaptureState,
} from './capture_state';
import { PeakedReporter } from './peaked_reporter';
import type { CapturedPhoto } from './photo';
import { Uploader, type UploaderListener } from './uploader';

export type { CapturedView, ViewState } from './capture_state';

/** What the screen shows of a session. Never changes; a new one is made for every change. */
export interface SessionSnapshot {
  readonly id: string;
  readonly name: string;
  /** The same array while none of them changes. */
  readonly views: readonly CapturedView[];
  /** Undone or set aside, and can be brought back. */
  readonly restorable: readonly CapturedView[];
  readonly connection: Connection;
  /** Why photos are not sent, or why the server's news do not come; null while all is well. */
  readonly trouble: string | null;
  /** The browser could not write to its disk: photos are in memory only. */
  readonly storageProblem: string | null;
  /** Changes when the server may have newer guidance. */
  readonly guidanceNews: number;
  /** Photos of earlier sessions in this browser that are still to be sent. */
  readonly waitingElsewhere: number;
  /** `pending`: asked for, and told to the server as soon as it has all photos. */
  readonly finished: 'no' | 'pending' | 'yes';
}

export interface CaptureSessionOptions {
  readonly api: Api;
  readonly db: CaptureDb;
  readonly source: NewSession['source'];
  /** For a new session. */
  readonly name: string;
  readonly device: string;
  /** `?session=` of the address: this one, begun if nobody knows it. */
  readonly sessionId?: string | null;
  /**
   * Go on with the last session of the same source in this browser. Not for WebXR, whose world has
   * another origin after a reload; what waits there is sent all the same.
   */
  readonly resume?: boolean;
  readonly newId?: () => string;
  readonly settings?: Pick<Storage, 'getItem' | 'setItem' | 'removeItem'>;
  readonly pacing?: Pacing;
  readonly network?: EventTarget | null;
  readonly locks?: Pick<LockManager, 'request'> | null;
  /** Tells other tabs of this browser that the database changed. */
  readonly tabs?: BroadcastChannel | null;
  readonly storage?: Pick<StorageManager, 'persist'>;
}

const CURRENT_SESSION = 'peaking.session';

export class CaptureSession implements Disposable {
  readonly #listeners = new Set<(snapshot: SessionSnapshot) => void>();
  readonly #end = new AbortController();
  readonly #thumbnails = new Map<string, string>();
  readonly #uploader: Uploader;
  readonly #reporter: PeakedReporter;
  readonly #tabs: BroadcastChannel | null;
  #state: CaptureState = NOTHING_KNOWN;
  #refusal: string | null = null;
  #waitingElsewhere = 0;
  #pendingName: string | null = null;
  #finished: SessionSnapshot['finished'] = 'no';
  /** It goes on, and the server may not know it yet. */
  #reopening = false;
  #snapshot: SessionSnapshot;
  /** What `views` and `restorable` of the snapshot were listed from. */
  #listed: CaptureState | null = null;
  #reading: Promise<void> = Promise.resolve();

  private constructor(readonly id: string, readonly options: CaptureSessionOptions) {
    const { api, db } = options;
    this.#uploader = new Uploader(api, db, id, this.#uploads(), {
      ...(options.pacing && { pacing: options.pacing }),
      ...(options.locks !== undefined && { locks: options.locks }),
      ...(options.network !== undefined && { network: options.network }),
    });
    this.#reporter = new PeakedReporter(
      (samples) => api.putPeaked(id, newIdOf(options), samples), () => this.#state.connection === 'online');
    this.#tabs = options.tabs === undefined
      ? new BroadcastChannel('peaking-captures') : options.tabs;
    if (this.#tabs !== null) this.#tabs.onmessage = () => void this.#readLocals();
    this.#snapshot = this.#makeSnapshot();
  }

  /** Begin a session, or go on with one; does not wait for the server. */
  static async open(options: CaptureSessionOptions): Promise<CaptureSession> {
    const { db } = options;
    await askToPersist(options.storage);
    const settings = settingsOf(options);
    const last = await db.session(settings?.getItem(CURRENT_SESSION) ?? '');
    const resumable = (options.resume ?? true) && last !== null
      && last.request.source === options.source && last.pending?.finished !== true;
    const id = options.sessionId ?? (resumable ? last.id : newIdOf(options));
    const known = await db.session(id);
    if (known === null) await db.putSession(newSession(id, options));
    settings?.setItem(CURRENT_SESSION, id);
    const session = new CaptureSession(id, options);
    session.#pendingName = known?.pending?.name ?? null;
    if (known?.pending?.finished === true) session.#finished = 'pending';
    session.#reopening = known?.pending?.finished === false;
    await session.#readLocals();
    session.#start();
    return session;
  }

  get snapshot(): SessionSnapshot {
    return this.#snapshot;
  }

  get views(): readonly CapturedView[] {
    return this.#snapshot.views;
  }

  /** Called at once and then at every change. @returns Call it to stop. */
  subscribe(listener: (snapshot: SessionSnapshot) => void): () => void {
    this.#listeners.add(listener);
    listener(this.#snapshot);
    return () => void this.#listeners.delete(listener);
  }

  /**
   * Keep a photo. When it resolves, the photo is on this device's disk (or `storageProblem` says
   * that it is in memory); that is the moment to confirm to the photographer.
   *
   * @returns Its id.
   */
  async shutter(photo: CapturedPhoto): Promise<string> {
    const id = newIdOf(this.options);
    await this.options.db.add({
      id,
      sessionId: this.id,
      camera: wireOfCamera(photo.camera),
      correctedPose: photo.correctedWorldFromCam == null ? null
        : Array.from(photo.correctedWorldFromCam.rows),
      time_s: photo.time_s,
      automatic: photo.automatic ?? false,
      state: 'waiting',
      attempts: 0,
      problem: null,
    }, { id, jpeg: photo.jpeg, thumbnail: photo.thumbnail, depth: photo.depth });
    await this.#localsChanged();
    this.#uploader.wake('work');
    return id;
  }

  /** Take a view back, in whatever state it is; the server is told when it can be reached. */
  async undo(id: string): Promise<void> {
    const remote = this.#state.remotes.get(id);
    await this.options.db.remove(id, remote === undefined ? null : {
      id,
      sessionId: this.id,
      camera: remote.camera,
      time_s: remote.time_s,
      attempts: 1,
      problem: null,
    });
    await this.#localsChanged();
    this.#uploader.wake('work');
  }

  /** Bring a view back that was undone or set aside; `trouble` says why where it cannot be done. */
  async restore(id: string): Promise<void> {
    await this.options.db.restore(id);
    await this.#localsChanged();
    if (this.#state.remotes.get(id)?.removed === true) {
      try {
        const capture = await this.options.api.restoreCapture(this.id, id);
        this.#heard({ type: 'CaptureChanged', capture });
      } catch (error) {
        if (!(error instanceof ApiError)) throw error;
        this.#apply({ type: 'Troubled', problem: error.problem });
      }
    }
    this.#uploader.wake('work');
  }

  /** Send a photo again that the server refused. */
  async retry(id: string): Promise<void> {
    await this.options.db.changeCapture(id, (capture) => capture.state === 'failed'
      ? { ...capture, state: 'waiting', problem: null } : null);
    await this.#localsChanged();
    this.#uploader.wake('work');
  }

  /** @returns The photo while it is on this device only, to download it; else null. */
  async photo(id: string): Promise<Blob | null> {
    return (await this.options.db.photo(id))?.jpeg ?? null;
  }

  /** @param name 1 to 80 characters. */
  async rename(name: string): Promise<void> {
    await this.#change({ name });
  }

  /** End the session; the server is told as soon as it has all photos. */
  async finish(name: string | null = null): Promise<void> {
    this.#finished = 'pending';
    settingsOf(this.options)?.removeItem(CURRENT_SESSION);
    this.#reopening = false;
    await this.#change({ ...(name !== null && { name }), finished: true });
  }

  /** Take views again after the end: the server is told before it gets any. */
  async reopen(): Promise<void> {
    const { db } = this.options;
    this.#finished = 'no';
    this.#reopening = true;
    settingsOf(this.options)?.setItem(CURRENT_SESSION, this.id);
    if (await db.session(this.id) === null) {
      await db.putSession({ ...newSession(this.id, this.options), begun: true });
    }
    await this.#change({ finished: false });
  }

  /** What was got, and how many of the views are enough. @throws ApiError */
  selection(signal?: AbortSignal): Promise<Selection> {
    return this.options.api.selection(this.id, signal);
  }

  /**
   * Have a data set made ready: of the best so many views or of all, in a format.
   *
   * @returns Where it is.
   * @throws ApiError
   */
  async dataset(query: DatasetQuery): Promise<string> {
    const { api } = this.options;
    await api.prepareDataset(this.id, query);
    return api.datasetUrl(this.id, query);
  }

  /** Whether `reportPeaked` would take a sample of this moment, seconds since 1970. */
  wantsPeaked(time_s: number): boolean {
    return this.#reporter.wants(time_s);
  }

  /** At most one a second goes out; none while there is no server. */
  reportPeaked(sample: PeakedSample): void {
    this.#reporter.report(sample);
  }

  /** The `.mpi` bytes, from this device if they were fetched before. @throws ApiError */
  async mpiBytes(id: string, version: number, signal?: AbortSignal): Promise<ArrayBuffer> {
    const { api, db } = this.options;
    const kept = await db.mpi(id, version);
    if (kept !== null) return kept;
    const bytes = await api.mpi(this.id, id, version, signal);
    const wanted = this.views.some((view) => view.id === id);
    if (wanted) await db.keepMpi(this.id, id, version, bytes);
    return bytes;
  }

  [Symbol.dispose](): void {
    this.#end.abort();
    this.#uploader.stop();
    this.#tabs?.close();
    for (const url of this.#thumbnails.values()) URL.revokeObjectURL(url);
    this.#thumbnails.clear();
    this.#listeners.clear();
  }

  #start(): void {
    const { api, pacing, network } = this.options;
    void this.#uploader.run();
    void sessionEvents(api, this.id, {
      onEvent: (event) => this.#heard(event),
      onConnection: (connection, refusal) => this.#connected(connection, refusal),
    }, this.#end.signal, {
      ...(pacing && { pacing }), ...(network !== undefined && { network }),
    });
  }

  #uploads(): UploaderListener {
    return {
      onLocalChange: () => void this.#localsChanged(),
      onAnswer: (capture: Capture) => this.#heard({ type: 'Answered', capture }),
      onUploading: (id) => this.#apply({ type: 'Uploading', id }),
      onTrouble: (problem) => this.#apply({ type: 'Troubled', problem }),
      onFinished: (id) => {
        if (id !== this.id) return;
        this.#finished = 'yes';
        this.#publish();
      },
      onReopened: (id) => { if (id === this.id) this.#reopened(); },
      onErased: (id) => { if (id === this.id) this.#erased(); },
    };
  }

  #connected(connection: Connection, refusal: ApiError | null): void {
    this.#refusal = refusal === null || refusal.status === 404 ? null : refusal.problem;
    this.#apply({ type: 'ConnectionChanged', connection });
    if (connection === 'online') this.#uploader.wake('online');
    // A server that does not know the session lost it, or was not told of it yet.
    if (refusal?.status === 404) void this.#beginAgain();
    if (refusal?.kind === 'erased') {
      void this.options.db.eraseSession(this.id).then(() => this.#erased());
    }
  }

  #erased(): void {
    this.#finished = 'yes';
    settingsOf(this.options)?.removeItem(CURRENT_SESSION);
    this.#apply({ type: 'Erased' });
  }

  async #beginAgain(): Promise<void> {
    if (this.#finished === 'yes') return;
    await this.options.db.changeSession(this.id, (session) => ({ ...session, begun: false }));
    this.#uploader.wake('work');
  }

  /** News of the server; what was undone here and is alive there is undone again. */
  #heard(action: CaptureAction): void {
    const before = this.#state.summary?.finished;
    this.#apply(action);
    for (const id of risenOf(this.#state)) void this.undo(id);
    if (this.#reopening) return;
    const after = this.#state.summary?.finished;
    if (after === true && this.#finished === 'no') {
      this.#finished = 'yes';
      this.#publish();
    } else if (before === true && after === false && this.#finished === 'yes') {
      this.#finished = 'no';
      this.#reopened();
    }
  }

  /** What was taken after the end, and refused for that, is sent again. */
  #reopened(): void {
    this.#reopening = false;
    this.#publish();
    void this.options.db.captures(this.id).then((captures) => {
      for (const { id, state } of captures) if (state === 'failed') void this.retry(id);
    });
  }

  async #change(change: { name?: string; finished?: boolean }): Promise<void> {
    if (change.name !== undefined) this.#pendingName = change.name;
    await this.options.db.changeSession(this.id, (session) =>
      ({ ...session, pending: { ...session.pending, ...change } }));
    this.#publish();
    this.#uploader.wake('work');
  }

  async #localsChanged(): Promise<void> {
    if (!this.#end.signal.aborted) this.#tabs?.postMessage('changed');
    await this.#readLocals();
  }

  /** One after the other, so that an older reading never replaces a newer one. */
  #readLocals(): Promise<void> {
    this.#reading = this.#reading.then(async () => {
      const { db } = this.options;
      const all = await db.captures();
      const locals = all.filter(({ sessionId }) => sessionId === this.id);
      for (const { id } of locals) {
        if (this.#thumbnails.has(id)) continue;
        const photo = await db.photo(id);
        if (photo !== null && !this.#end.signal.aborted) {
          this.#thumbnails.set(id, URL.createObjectURL(photo.thumbnail));
        }
      }
      this.#waitingElsewhere = all.filter(({ sessionId, state }) =>
        sessionId !== this.id && state === 'waiting').length;
      this.#apply({ type: 'LocalsRead', locals });
      this.#dropThumbnails();
    });
    return this.#reading;
  }

  #apply(action: CaptureAction): void {
    this.#state = reduce(this.#state, action);
    this.#publish();
  }

  #publish(): void {
    if (this.#end.signal.aborted) return;
    this.#snapshot = this.#makeSnapshot();
    for (const listener of this.#listeners) listener(this.#snapshot);
  }

  #makeSnapshot(): SessionSnapshot {
    const { api, db, name } = this.options;
    const thumbnailUrlOf = (id: string): string =>
      this.#thumbnails.get(id) ?? api.thumbnailUrl(this.id, id);
    // Of a long session the lists are long, and news about it come every few seconds.
    const isListed = this.#listed !== null && listsTheSame(this.#state, this.#listed);
    this.#listed = this.#state;
    return {
      id: this.id,
      name: this.#pendingName ?? this.#state.summary?.name ?? name,
      views: isListed ? this.#snapshot.views : viewsOf(this.#state, thumbnailUrlOf),
      restorable: isListed ? this.#snapshot.restorable : restorableOf(this.#state, thumbnailUrlOf),
      connection: this.#state.connection,
      trouble: this.#state.trouble ?? this.#refusal,
      storageProblem: db.problem,
      guidanceNews: this.#state.guidanceNews,
      waitingElsewhere: this.#waitingElsewhere,
      finished: this.#finished,
    };
  }

  /** Pictures of views that are no longer listed. */
  #dropThumbnails(): void {
    const { views, restorable } = this.#snapshot;
    const shown = new Set([...views, ...restorable].map(({ id }) => id));
    for (const [id, url] of this.#thumbnails) {
      if (shown.has(id)) continue;
      URL.revokeObjectURL(url);
      this.#thumbnails.delete(id);
    }
  }
}

function newSession(id: string, { name, source, device }: CaptureSessionOptions): {
  id: string; request: Omit<NewSession, 'protocol'>; begun: boolean; pending: null;
} {
  return { id, request: { name, source, device }, begun: false, pending: null };
}

function newIdOf({ newId }: CaptureSessionOptions): string {
  return newId === undefined ? crypto.randomUUID() : newId();
}

/** None where the browser forbids it. */
function settingsOf({ settings }: CaptureSessionOptions): CaptureSessionOptions['settings'] {
  if (settings !== undefined) return settings;
  try {
    return globalThis.localStorage;
  } catch {
    return undefined;
  }
}
