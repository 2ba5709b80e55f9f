/**
 * What the phone holds: captures until the server has them, and MPIs so that a reload needs no
 * download. IndexedDB; what it will not take (storage full, or none in this browser) is held in
 * memory, and `problem` says so.
 */

import { openDB, type DBSchema, type IDBPDatabase } from 'idb';

import type { DepthMap } from '../sources/frame_source';
import type { Camera, NewSession, SessionChange } from '../wire';

/**
 * `waiting`: to be sent. `failed`: the server refused it; the photo stays here. `stored`: the
 * server has it on disk. `removing`: undone, the server must still be told. `removed`: undone, and
 * the server never had it; the photo stays until the session is finished, so that it can be brought
 * back, and so does this mark, in case an upload arrives there late.
 */
export type StoredState = 'waiting' | 'failed' | 'stored' | 'removing' | 'removed';

export interface StoredCapture {
  readonly id: string;
  readonly sessionId: string;
  /** In which they were taken: goes up, over all sessions of this browser. */
  readonly order: number;
  readonly camera: Camera;
  /** Where the picture shows that it was taken, as on the wire; earlier versions did not know. */
  readonly correctedPose?: readonly number[] | null;
  /** Seconds since 1970. */
  readonly time_s: number;
  /** Taken by the automatic shutter; earlier versions had none. */
  readonly automatic?: boolean;
  readonly state: StoredState;
  /** How often it was begun to be sent; written before the first byte goes out. */
  readonly attempts: number;
  /** When `failed`: why. */
  readonly problem: string | null;
}

export interface StoredPhoto {
  readonly id: string;
  /** Null once the server has it. */
  readonly jpeg: Blob | null;
  readonly thumbnail: Blob;
  readonly depth: DepthMap | null;
}

export interface StoredSession {
  readonly id: string;
  /** Earlier versions kept more with it. */
  readonly request: Omit<NewSession, 'protocol'>;
  /** Whether the server knows it. */
  readonly begun: boolean;
  /** A name or an end that the server has not been told yet. */
  readonly pending: SessionChange | null;
}

interface StoredMpi {
  readonly id: string;
  readonly sessionId: string;
  readonly version?: number;
  readonly bytes: ArrayBuffer;
}

interface Schema extends DBSchema {
  captures: { key: string; value: StoredCapture; indexes: { sessionId: string } };
  photos: { key: string; value: StoredPhoto };
  sessions: { key: string; value: StoredSession };
  mpis: { key: string; value: StoredMpi; indexes: { sessionId: string } };
}

type Change<T> = (value: T) => T | null;

const IN_MEMORY = 'Photos are only in memory. Keep this page open until they are uploaded.';
const FULL = `This browser's storage is full. ${IN_MEMORY}`;
const NONE = `This browser does not save data (a private window?). ${IN_MEMORY}`;
const BROKEN = "This browser's storage stopped working. Reload the page once everything is uploaded. "
  + IN_MEMORY;

/** Written through to the disk, not to a cache of the operating system. */
const STRICT = { durability: 'strict' } as const;

export class CaptureDb {
  /** What the disk would not take, or all of it when there is none. */
  readonly #captures = new Map<string, StoredCapture>();
  readonly #photos = new Map<string, StoredPhoto>();
  readonly #sessions = new Map<string, StoredSession>();
  #problem: string | null;

  private constructor(readonly disk: IDBPDatabase<Schema> | null) {
    this.#problem = disk === null ? NONE : null;
  }

  /** Never rejects: without IndexedDB everything is in memory, and `problem` says it. */
  static async open(name = 'peaking'): Promise<CaptureDb> {
    try {
      return new CaptureDb(await openDB<Schema>(name, 1, {
        upgrade(db) {
          db.createObjectStore('captures', { keyPath: 'id' }).createIndex('sessionId', 'sessionId');
          db.createObjectStore('photos', { keyPath: 'id' });
          db.createObjectStore('sessions', { keyPath: 'id' });
          db.createObjectStore('mpis', { keyPath: 'id' }).createIndex('sessionId', 'sessionId');
        },
      }));
    } catch {
      return new CaptureDb(null);
    }
  }

  /** A sentence while something is only in memory, else null. */
  get problem(): string | null {
    const inMemory = [...this.#photos.values()].some(({ jpeg }) => jpeg !== null);
    return inMemory || this.#problem !== FULL ? this.#problem : null;
  }

  close(): void {
    this.disk?.close();
  }

  /** Keep a new photo. When it resolves it is on the disk, or `problem` says that it is not. */
  async add(capture: Omit<StoredCapture, 'order'>, photo: StoredPhoto): Promise<void> {
    if (this.disk !== null) {
      try {
        return await this.#write(this.disk, capture, photo);
      } catch {
        // Caches go before photos do: an MPI can be fetched again.
        await this.disk.clear('mpis').catch(() => undefined);
      }
      try {
        return await this.#write(this.disk, capture, photo);
      } catch (error) {
        this.#problem = isQuota(error) ? FULL : BROKEN;
      }
    }
    const order = nextOrder(await this.captures());
    this.#captures.set(capture.id, { ...capture, order });
    this.#photos.set(photo.id, photo);
  }

  /** In the order they were taken; of one session, or of all. */
  async captures(sessionId?: string): Promise<readonly StoredCapture[]> {
    const onDisk = await this.#read((disk) => sessionId === undefined
      ? disk.getAll('captures')
      : disk.getAllFromIndex('captures', 'sessionId', sessionId)) ?? [];
    const inMemory = [...this.#captures.values()]
      .filter((capture) => sessionId === undefined || capture.sessionId === sessionId);
    return [...onDisk.filter(({ id }) => !this.#captures.has(id)), ...inMemory]
      .sort((a, b) => a.order - b.order);
  }

  async photo(id: string): Promise<StoredPhoto | null> {
    return this.#photos.get(id) ?? await this.#read((disk) => disk.get('photos', id)) ?? null;
  }

  /**
   * Change a capture, in one transaction with looking at it: two tabs do not cross. Null from
   * `change` leaves it as it is.
   *
   * @returns It as changed; null when there is none or `change` gave null.
   */
  async changeCapture(
    id: string, change: Change<StoredCapture>,
  ): Promise<StoredCapture | null> {
    const inMemory = this.#captures.get(id);
    if (inMemory !== undefined) {
      const next = change(inMemory);
      if (next !== null) this.#captures.set(id, next);
      return next;
    }
    if (this.disk === null) return null;
    const tx = this.disk.transaction('captures', 'readwrite', STRICT);
    const current = await tx.store.get(id);
    const next = current === undefined ? null : change(current);
    if (next !== null) await tx.store.put(next);
    await tx.done;
    return next;
  }

  /** The server has it: its photo goes, its thumbnail stays. An undo meanwhile is kept. */
  async acknowledge(id: string): Promise<void> {
    await this.changeCapture(id, (capture) => {
      const undone = capture.state === 'removing' || capture.state === 'removed';
      return { ...capture, state: undone ? 'removing' : 'stored', problem: null };
    });
    await this.#dropPhoto(id);
  }

  /**
   * Undo. The server is told of any but those that were never begun to be sent. `known` serves for a
   * capture that only the server has.
   */
  async remove(id: string, known: Omit<StoredCapture, 'order' | 'state'> | null): Promise<void> {
    const changed = await this.changeCapture(id, (capture) =>
      ({ ...capture, state: capture.attempts === 0 ? 'removed' : 'removing' }));
    if (changed === null && known !== null) await this.#addMark({ ...known, state: 'removing' });
    await this.forgetMpi(id);
  }

  /** Take an undo back that the server was not told of. */
  async restore(id: string): Promise<void> {
    const hasPhoto = (await this.photo(id))?.jpeg != null;
    await this.changeCapture(id, (capture) => capture.state === 'removing' || capture.state === 'removed'
      ? { ...capture, state: hasPhoto ? 'waiting' : 'stored' } : null);
  }

  /** The server was told of the undo, and never had the capture. */
  async confirmRemoval(id: string): Promise<void> {
    await this.changeCapture(id, (capture) =>
      capture.state === 'removing' ? { ...capture, state: 'removed' } : null);
  }

  /** The server has the capture among those that were undone: nothing of it is needed here. */
  async forgetUndone(id: string): Promise<void> {
    const undone = await this.changeCapture(id, (capture) =>
      capture.state === 'removing' ? { ...capture, state: 'removed' } : null);
    if (undone !== null) await this.#forgetCapture(id);
  }

  async session(id: string): Promise<StoredSession | null> {
    return this.#sessions.get(id) ?? await this.#read((disk) => disk.get('sessions', id)) ?? null;
  }

  async sessions(): Promise<readonly StoredSession[]> {
    const onDisk = await this.#read((disk) => disk.getAll('sessions')) ?? [];
    return [...onDisk.filter(({ id }) => !this.#sessions.has(id)), ...this.#sessions.values()];
  }

  /** Of all sessions of which this device holds anything. */
  async sessionIds(): Promise<readonly string[]> {
    const ids = new Set<string>();
    for (const { id } of await this.sessions()) ids.add(id);
    for (const { sessionId } of await this.captures()) ids.add(sessionId);
    await this.#read(async (disk) => {
      const index = disk.transaction('mpis').store.index('sessionId');
      let cursor = await index.openKeyCursor(null, 'nextunique');
      for (; cursor !== null; cursor = await cursor.continue()) ids.add(cursor.key);
    });
    return [...ids];
  }

  async putSession(session: StoredSession): Promise<void> {
    try {
      if (this.disk === null) throw new Error(NONE);
      await this.disk.put('sessions', session);
      this.#sessions.delete(session.id);
    } catch {
      this.#sessions.set(session.id, session);
    }
  }

  async changeSession(id: string, change: Change<StoredSession>): Promise<void> {
    const inMemory = this.#sessions.get(id);
    if (inMemory !== undefined || this.disk === null) {
      const next = inMemory === undefined ? null : change(inMemory);
      if (next !== null) this.#sessions.set(id, next);
      return;
    }
    const tx = this.disk.transaction('sessions', 'readwrite');
    const current = await tx.store.get(id);
    const next = current === undefined ? null : change(current);
    if (next !== null) await tx.store.put(next);
    await tx.done;
  }

  /** A session is finished: all that the server has goes; photos it refused stay. */
  async forgetSession(sessionId: string): Promise<void> {
    let kept = 0;
    for (const { id, state } of await this.captures(sessionId)) {
      await this.forgetMpi(id);
      if (state !== 'stored' && state !== 'removed') { kept += 1; continue; }
      await this.#forgetCapture(id);
    }
    await this.#forgetMpis((mpi) => mpi.sessionId === sessionId);
    if (kept > 0) return;
    await this.#forgetSession(sessionId);
  }

  /** A session was erased, by right: all that this device holds of it goes, photos too. */
  async eraseSession(sessionId: string): Promise<void> {
    for (const { id } of await this.captures(sessionId)) await this.#forgetCapture(id);
    await this.#forgetMpis((mpi) => mpi.sessionId === sessionId);
    await this.#forgetSession(sessionId);
  }

  async mpi(id: string, version: number): Promise<ArrayBuffer | null> {
    const kept = await this.#read((disk) => disk.get('mpis', id));
    // Those kept before there were versions are first ones.
    return kept != null && (kept.version ?? 1) === version ? kept.bytes : null;
  }

  /**
   * A cache only: when there is no room, the MPI is fetched again next time. The newest version takes
   * the place of older ones.
   */
  async keepMpi(
    sessionId: string, id: string, version: number, bytes: ArrayBuffer,
  ): Promise<void> {
    await this.disk?.put('mpis', { id, sessionId, version, bytes }).catch(() => undefined);
  }

  async forgetMpi(id: string): Promise<void> {
    await this.disk?.delete('mpis', id);
  }

  async #forgetCapture(id: string): Promise<void> {
    this.#captures.delete(id);
    this.#photos.delete(id);
    await this.disk?.delete('captures', id);
    await this.disk?.delete('photos', id);
  }

  async #forgetSession(id: string): Promise<void> {
    this.#sessions.delete(id);
    await this.disk?.delete('sessions', id);
  }

  async #write(
    disk: IDBPDatabase<Schema>, capture: Omit<StoredCapture, 'order'>, photo: StoredPhoto,
  ): Promise<void> {
    const tx = disk.transaction(['captures', 'photos'], 'readwrite', STRICT);
    tx.done.catch(() => undefined);
    try {
      const captures = tx.objectStore('captures');
      const order = nextOrder([...await captures.getAll(), ...this.#captures.values()]);
      await captures.put({ ...capture, order });
      await tx.objectStore('photos').put(photo);
    } catch (error) {
      abort(tx);
      throw error;
    }
    await tx.done;
  }

  /** Null, and a `problem`, when the disk cannot be read any more. */
  async #read<T>(read: (disk: IDBPDatabase<Schema>) => Promise<T>): Promise<T | null> {
    if (this.disk === null) return null;
    try {
      return await read(this.disk);
    } catch {
      this.#problem = BROKEN;
      return null;
    }
  }

  async #forgetMpis(which: (mpi: { id: string; sessionId: string }) => boolean): Promise<void> {
    if (this.disk === null) return;
    const tx = this.disk.transaction('mpis', 'readwrite');
    for await (const cursor of tx.store) if (which(cursor.value)) await cursor.delete();
    await tx.done;
  }

  async #addMark(capture: Omit<StoredCapture, 'order'>): Promise<void> {
    const mark = { ...capture, order: nextOrder(await this.captures()) };
    try {
      if (this.disk === null) throw new Error(NONE);
      await this.disk.put('captures', mark);
    } catch {
      this.#captures.set(mark.id, mark);
    }
  }

  /** All but its thumbnail. */
  async #dropPhoto(id: string): Promise<void> {
    const photo = await this.photo(id);
    if (photo === null) return;
    const rest = { ...photo, jpeg: null, depth: null };
    if (this.#photos.has(id)) this.#photos.set(id, rest);
    else await this.disk?.put('photos', rest);
  }
}

/** So that a capture is never there without its photo. */
function abort(tx: { abort(): void }): void {
  try {
    tx.abort();
  } catch {
    // It was aborted by the failure itself.
  }
}

function isQuota(error: unknown): boolean {
  return error instanceof DOMException && error.name === 'QuotaExceededError';
}

function nextOrder(captures: readonly StoredCapture[]): number {
  return 1 + captures.reduce((latest, { order }) => Math.max(latest, order), 0);
}

/** Ask the browser not to clear our storage when it needs room. @returns Whether it promised. */
export async function askToPersist(
  storage: Pick<StorageManager, 'persist'> | undefined = globalThis.navigator?.storage,
): Promise<boolean> {
  try {
    return await storage?.persist?.() ?? false;
  } catch {
    return false;
  }
}
