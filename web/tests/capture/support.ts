import { rigid } from '../../src/geometry';
import { Api } from '../../src/server/api';
import type { Pacing } from '../../src/server/pacing';
import { CaptureDb } from '../../src/capture/capture_db';
import { CaptureSession, type CaptureSessionOptions } from '../../src/capture/capture_session';
import type { CapturedPhoto } from '../../src/capture/photo';
import type { ModelServer } from './model_server';

/** Time that passes only when everything else is done. */
export class ModelClock implements Pacing {
  now_ms = 0;
  readonly waits_ms: number[] = [];
  readonly #sleepers = new Set<{ until_ms: number; wake: () => void }>();

  constructor(readonly random: () => number = () => 0.5) {}

  sleep(duration_ms: number, signal: AbortSignal): Promise<void> {
    this.waits_ms.push(duration_ms);
    return new Promise((resolve) => {
      const sleeper = { until_ms: this.now_ms + duration_ms, wake: resolve };
      this.#sleepers.add(sleeper);
      const stop = (): void => { this.#sleepers.delete(sleeper); resolve(); };
      if (signal.aborted) stop();
      else signal.addEventListener('abort', stop);
    });
  }

  /** Lets everything run, and time pass, until it is true. */
  async until(isTrue: () => boolean | Promise<boolean>, longest_ms = 600_000): Promise<void> {
    const end_ms = this.now_ms + longest_ms;
    for (;;) {
      await settle(isTrue);
      if (await isTrue()) return;
      const next = [...this.#sleepers].sort((a, b) => a.until_ms - b.until_ms)[0];
      if (next === undefined || next.until_ms > end_ms) throw new Error('it never became true');
      this.now_ms = next.until_ms;
      this.#sleepers.delete(next);
      next.wake();
    }
  }
}

/** fake-indexeddb and streams go on in macrotasks. */
export async function settle(isTrue: () => boolean | Promise<boolean> = () => false,
): Promise<void> {
  for (let i = 0; i < 60; i++) {
    if (i % 10 === 0 && await isTrue()) return;
    await new Promise((resolve) => setImmediate(resolve));
  }
}

/** `navigator.locks` of one browser. */
export function modelLocks(): Pick<LockManager, 'request'> {
  let last: Promise<unknown> = Promise.resolve();
  const request = (_name: string, _options: LockOptions, work: () => Promise<unknown>) => {
    const result = last.then(work);
    last = result.catch(() => undefined);
    return result;
  };
  return { request: request as unknown as LockManager['request'] };
}

export function modelSettings(): Pick<Storage, 'getItem' | 'setItem' | 'removeItem'> {
  const values = new Map<string, string>();
  return {
    getItem: (key) => values.get(key) ?? null,
    setItem: (key, value) => void values.set(key, value),
    removeItem: (key) => void values.delete(key),
  };
}

export function photo(time_s: number, text = `photo at ${time_s}`): CapturedPhoto {
  return {
    camera: {
      pinhole: { width_px: 4, height_px: 2, fx_px: 3, fy_px: 3, cx_px: 2, cy_px: 1 },
      worldFromCam: rigid([1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, time_s]),
    },
    jpeg: new Blob([text], { type: 'image/jpeg' }),
    thumbnail: new Blob(['small'], { type: 'image/jpeg' }),
    depth: { width_px: 2, height_px: 1, depth_mm: Uint16Array.of(258, 65535) },
    time_s,
  };
}

let browsers = 0;

/** One browser: a database, settings and locks that outlive its pages. */
export class ModelBrowser {
  readonly name = `browser-${browsers++}`;
  readonly settings = modelSettings();
  readonly locks = modelLocks();
  readonly network = new EventTarget();
  readonly #pages: { session: CaptureSession; db: CaptureDb }[] = [];
  #ids = 0;

  constructor(readonly server: ModelServer, readonly clock = new ModelClock()) {}

  async open(options: Partial<CaptureSessionOptions> = {}): Promise<CaptureSession> {
    const db = await CaptureDb.open(this.name);
    const session = await CaptureSession.open({
      api: new Api('http://server', { fetch: this.server.fetch }),
      db, source: 'virtual', name: 'desk', device: 'model', settings: this.settings,
      locks: this.locks, network: this.network, pacing: this.clock, tabs: null,
      newId: () => `${this.name}-id-${String(this.#ids++).padStart(4, '0')}`, ...options,
    });
    this.#pages.push({ session, db });
    return session;
  }

  /** All pages vanish, as in a reload. */
  close(): void {
    for (const { session, db } of this.#pages.splice(0)) {
      session[Symbol.dispose]();
      db.close();
    }
  }
}
