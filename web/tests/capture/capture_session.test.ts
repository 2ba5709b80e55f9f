import 'fake-indexeddb/auto';

import { IDBObjectStore } from 'fake-indexeddb';
import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';

import { CaptureDb, type StoredSession } from '../../src/capture/capture_db';
import type { CaptureSession } from '../../src/capture/capture_session';
import { PROTOCOL } from '../../src/wire';
import { ModelServer, problem } from './model_server';
import { ModelBrowser, ModelClock, photo, settle } from './support';

let server: ModelServer;
let browser: ModelBrowser;
let clock: ModelClock;

beforeEach(() => {
  server = new ModelServer();
  clock = new ModelClock();
  browser = new ModelBrowser(server, clock);
});

afterEach(() => {
  browser.close();
  vi.restoreAllMocks();
});

const states = (session: CaptureSession): string[] => session.views.map(({ state }) => state);
const allQueued = (session: CaptureSession, count: number) => (): boolean =>
  states(session).join() === Array<string>(count).fill('queued').join();

test('a photo is on disk before the shutter confirms, until the server has it', async () => {
  server.stop();
  const session = await browser.open();
  const id = await session.shutter(photo(1));
  const db = await CaptureDb.open(browser.name);
  expect(await (await db.photo(id))?.jpeg?.text()).toBe('photo at 1');
  expect(states(session)).toEqual(['waiting']);
  server.start();
  await clock.until(allQueued(session, 1));
  expect((await db.photo(id))?.jpeg).toBeNull();
  expect(server.alive()).toEqual([id]);
  server.ready(id);
  await clock.until(() => session.views[0]?.state === 'ready');
  expect(session.views[0]).toMatchObject({ number: 1, problem: null, onServer: true });
  db.close();
});

test('a lost reply, then a retry: one capture', async () => {
  const session = await browser.open();
  let lost = 0;
  server.fault = (what) => what.startsWith('PUT b') && lost++ < 2 ? 'reply lost' : null;
  const id = await session.shutter(photo(1));
  await clock.until(allQueued(session, 1));
  await clock.until(async () => await session.photo(id) === null);
  expect(lost).toBe(3);
  expect(server.writes).toEqual(new Map([[id, 1]]));
});

test('five captures offline, then online: all of them, in order', async () => {
  const session = await browser.open();
  await clock.until(() => session.snapshot.connection === 'online');
  server.stop();
  await clock.until(() => session.snapshot.connection === 'offline');
  const ids: string[] = [];
  for (let i = 0; i < 5; i++) ids.push(await session.shutter(photo(i + 1)));
  await clock.until(() => session.snapshot.trouble !== null);
  expect(states(session).filter((state) => state === 'queued')).toEqual([]);
  server.start();
  browser.network.dispatchEvent(new Event('online'));
  await clock.until(allQueued(session, 5));
  await clock.until(() => session.snapshot.connection === 'online');
  await clock.until(() => session.snapshot.trouble === null);
  expect(server.alive()).toEqual(ids);
  expect(session.views.map(({ number }) => number)).toEqual([1, 2, 3, 4, 5]);
});

test('news that are not of its views leave the lists as they are', async () => {
  const session = await browser.open();
  const id = await session.shutter(photo(1));
  await clock.until(allQueued(session, 1));
  await clock.until(() => session.snapshot.connection === 'online');
  await clock.until(async () => await session.photo(id) === null);
  await settle(); // until that is listed too
  const { views, restorable } = session.snapshot;
  server.rename('another');
  await clock.until(() => session.snapshot.name === 'another');
  expect(session.snapshot.views).toBe(views);
  expect(session.snapshot.restorable).toBe(restorable);
  server.ready(id);
  await clock.until(() => session.views[0]?.state === 'ready');
  expect(session.views).not.toBe(views);
});

test('the network coming back ends the backoff at once', async () => {
  server.stop();
  const session = await browser.open();
  await session.shutter(photo(1));
  await clock.until(() => clock.now_ms > 60_000);
  server.start();
  const before_ms = clock.now_ms;
  browser.network.dispatchEvent(new Event('online'));
  await settle(allQueued(session, 1));
  expect(states(session)).toEqual(['queued']);
  expect(clock.now_ms).toBe(before_ms);
});

test('a reload in the middle goes on where it was', async () => {
  server.stop();
  let session = await browser.open();
  const first = await session.shutter(photo(1));
  const { id } = session;
  browser.close();
  session = await browser.open();
  expect(session.id).toBe(id);
  expect(states(session)).toEqual(['waiting']);
  const second = await session.shutter(photo(2));
  server.fault = (what) => what === `PUT ${first}` ? 'reply lost' : null;
  server.start();
  await clock.until(() => server.alive().includes(first));
  browser.close();
  server.fault = () => null;
  session = await browser.open();
  await clock.until(allQueued(session, 2));
  expect(server.alive()).toEqual([first, second]);
  expect(server.writes.get(first)).toBe(1);
});

test('without resuming, an old session is sent while a new one begins', async () => {
  server.stop();
  const old = await browser.open();
  const id = await old.shutter(photo(1));
  browser.close();
  const session = await browser.open({ resume: false });
  expect(session.id).not.toBe(old.id);
  expect(session.snapshot.waitingElsewhere).toBe(1);
  server.start();
  await clock.until(() => session.snapshot.waitingElsewhere === 0 && server.alive().length === 1);
  expect(server.sessions.get(old.id)?.captures.map((capture) => capture.id)).toEqual([id]);
});

test('a server that restarts without knowing the session is told of it again', async () => {
  const session = await browser.open();
  const first = await session.shutter(photo(1));
  await clock.until(allQueued(session, 1));
  server.stop();
  server.sessions.clear();
  const second = await session.shutter(photo(2));
  server.start();
  await clock.until(() => server.alive().includes(second));
  expect(server.sessions.has(session.id)).toBe(true);
  expect(first).not.toBe(second);
});

describe('refusals', () => {
  test('a full disk keeps the capture here and says so', async () => {
    const session = await browser.open();
    let full = true;
    server.fault = (what) => full && what.startsWith('PUT b') ? 507 : null;
    const id = await session.shutter(photo(1));
    await clock.until(() => session.snapshot.trouble !== null);
    expect(session.snapshot.trouble).toBe('fault 507');
    expect(await session.photo(id)).not.toBeNull();
    expect(states(session)).toEqual(['waiting']);
    full = false;
    await clock.until(allQueued(session, 1));
    await clock.until(() => session.snapshot.trouble === null);
    expect(await session.photo(id)).toBeNull();
  });

  test('without the pairing everything waits', async () => {
    const session = await browser.open();
    let paired = false;
    server.fault = () => paired ? null : new Response('', { status: 401 });
    const id = await session.shutter(photo(1));
    await clock.until(() => session.snapshot.trouble?.includes('not paired') ?? false);
    expect(await session.photo(id)).not.toBeNull();
    paired = true;
    await clock.until(allQueued(session, 1));
  });

  test('a photo that is refused stays, and the next goes on', async () => {
    const session = await browser.open();
    let strict = true;
    const first = await (async () => {
      server.fault = (what) => strict && what.endsWith('0001') ? 413 : null;
      return session.shutter(photo(1));
    })();
    const second = await session.shutter(photo(2));
    await clock.until(() => server.alive().includes(second));
    await clock.until(() => states(session).join() === 'failed,queued');
    expect(session.views[0]?.problem).toBe('fault 413');
    expect(await (await session.photo(first))?.text()).toBe('photo at 1');
    strict = false;
    await session.retry(first);
    await clock.until(allQueued(session, 2));
  });

  test.each([[2, 'queued,queued'], [3, 'failed,queued']])(
    'a photo that was cut off %i times on the way', async (times, become) => {
      const session = await browser.open();
      let left = times;
      server.fault = (what) => what.endsWith('0001') && left-- > 0
        ? problem(400, 'cut off', {}, 'urn:peaking:problem:cut-off') : null;
      await session.shutter(photo(1));
      await session.shutter(photo(2));
      await clock.until(() => states(session).join() === become);
      expect(left).toBe(times === 2 ? -1 : 0); // was sent once more, or not
    });

  test('Retry-After is kept, whatever is pressed meanwhile', async () => {
    const session = await browser.open();
    await clock.until(() => session.snapshot.connection === 'online');
    let busy = true;
    server.fault = (what) => {
      if (!busy || !what.startsWith('PUT b')) return null;
      busy = false;
      return problem(503, 'busy', { 'Retry-After': '7' });
    };
    const began_ms = clock.now_ms;
    await session.shutter(photo(1));
    await clock.until(() => session.snapshot.trouble === 'busy');
    await session.shutter(photo(2));
    browser.network.dispatchEvent(new Event('online'));
    await clock.until(allQueued(session, 2));
    expect(clock.now_ms - began_ms).toBeGreaterThanOrEqual(7000);
  });

  test('a photo at which the server fails does not hold up the others', async () => {
    const session = await browser.open();
    server.fault = (what) => what.startsWith('PUT b') && what.endsWith('0001') ? 500 : null;
    const first = await session.shutter(photo(1));
    const second = await session.shutter(photo(2));
    await clock.until(() => server.alive().includes(second));
    expect(await session.photo(first)).not.toBeNull();
  });

  test('a Wi-Fi login page is not taken for the server', async () => {
    const session = await browser.open();
    let portal = true;
    server.fault = (what) => portal && what.startsWith('PUT b')
      ? new Response('<html>Welcome!</html>') : null;
    const id = await session.shutter(photo(1));
    await clock.until(() => session.snapshot.trouble?.includes('login page') ?? false);
    expect(await session.photo(id)).not.toBeNull();
    portal = false;
    await clock.until(allQueued(session, 1));
  });
});

describe('undo', () => {
  test('of a waiting one that was never sent: it never is', async () => {
    server.stop();
    const session = await browser.open();
    const id = await session.shutter(photo(1));
    await session.undo(id);
    expect(session.views).toEqual([]);
    server.start();
    await clock.until(() => session.snapshot.connection === 'online');
    await settle();
    expect(server.log.filter((what) => what.includes(id))).toEqual([]);
    expect(await session.photo(id)).not.toBeNull(); // until the session is finished
    await session.finish();
    await clock.until(async () => await session.photo(id) === null);
  });

  test('is taken back: of one that was never sent', async () => {
    server.stop();
    const session = await browser.open();
    const id = await session.shutter(photo(1));
    await session.undo(id);
    expect(session.snapshot.restorable.map((view) => view.id)).toEqual([id]);
    await session.restore(id);
    expect(session.snapshot.restorable).toEqual([]);
    server.start();
    await clock.until(allQueued(session, 1));
    expect(server.alive()).toEqual([id]);
  });

  test('is taken back: of one that the server has, also by another phone', async () => {
    const session = await browser.open();
    const id = await session.shutter(photo(1));
    await clock.until(allQueued(session, 1));
    await session.undo(id);
    await clock.until(() => server.alive().length === 0);
    await clock.until(() => session.snapshot.restorable.length === 1);
    await session.restore(id);
    await clock.until(allQueued(session, 1));
    await session.undo(id);
    await clock.until(() => server.alive().length === 0);
    const other = new ModelBrowser(server, clock);
    const second = await other.open({ sessionId: session.id });
    await clock.until(() => second.snapshot.restorable.length === 1);
    await second.restore(id);
    await clock.until(() => session.views.length === 1 && second.views.length === 1);
    await settle();
    expect(server.alive()).toEqual([id]);
    other.close();
  });

  test('is not taken back without the server: it is said', async () => {
    const session = await browser.open();
    const id = await session.shutter(photo(1));
    await clock.until(allQueued(session, 1));
    await session.undo(id);
    await clock.until(() => session.snapshot.restorable.length === 1 && server.alive().length === 0);
    server.fault = (what) => what === `PATCH ${id}` ? 409 : null;
    await session.restore(id);
    expect(session.views).toEqual([]);
  });

  test('while it is on its way', async () => {
    const session = await browser.open();
    let undone: Promise<void> | null = null;
    server.fault = (what) => {
      if (what.startsWith('PUT b')) undone = session.undo(what.slice(4));
      return null;
    };
    const id = await session.shutter(photo(1));
    await clock.until(() => server.log.includes(`DELETE ${id}`));
    await settle();
    expect(undone).not.toBeNull();
    expect(server.alive()).toEqual([]);
    expect(session.views).toEqual([]);
  });

  test('of one whose reply was lost', async () => {
    const session = await browser.open();
    server.fault = (what) => what.startsWith('PUT b') ? 'reply lost' : null;
    const id = await session.shutter(photo(1));
    await clock.until(() => server.alive().includes(id));
    await session.undo(id);
    expect(session.views).toEqual([]);
    await clock.until(() => server.alive().length === 0);
  });

  test('of one that arrives there after its undo', async () => {
    const session = await browser.open();
    server.fault = (what) => what.startsWith('PUT b') ? 'late' : null;
    const id = await session.shutter(photo(1));
    await clock.until(() => session.snapshot.trouble !== null);
    await session.undo(id);
    await clock.until(() => server.log.includes(`DELETE ${id}`));
    await settle();
    await server.deliverLate();
    expect(server.alive()).toEqual([id]);
    await clock.until(() => server.alive().length === 0);
    expect(session.views).toEqual([]);
  });

  test('of one that is ready, its MPI goes too', async () => {
    const session = await browser.open();
    const id = await session.shutter(photo(1));
    await clock.until(allQueued(session, 1));
    server.ready(id);
    await clock.until(() => states(session)[0] === 'ready');
    expect(new Uint8Array(await session.mpiBytes(id, 1))).toEqual(Uint8Array.of(1, 2, 3));
    const fetched = server.log.length;
    await session.mpiBytes(id, 1);
    expect(server.log.length).toBe(fetched);
    await session.undo(id);
    await clock.until(() => server.alive().length === 0);
    const db = await CaptureDb.open(browser.name);
    expect(await db.mpi(id, 1)).toBeNull();
    db.close();
  });

  test('a better MPI takes the place of the first on this device too', async () => {
    const session = await browser.open();
    const id = await session.shutter(photo(1));
    await clock.until(allQueued(session, 1));
    server.ready(id);
    await clock.until(() => states(session)[0] === 'ready');
    await session.mpiBytes(id, 1);
    await session.mpiBytes(id, 2);
    const db = await CaptureDb.open(browser.name);
    expect(await db.mpi(id, 1)).toBeNull();
    expect(await db.mpi(id, 2)).not.toBeNull();
    db.close();
  });

  test('of one that failed', async () => {
    const session = await browser.open();
    server.fault = (what) => what.startsWith('PUT b') ? 422 : null;
    const id = await session.shutter(photo(1));
    await clock.until(() => states(session)[0] === 'failed');
    await session.undo(id);
    await clock.until(() => server.log.includes(`DELETE ${id}`));
    expect(session.views).toEqual([]);
  });

  test('of one that only the server has, offline', async () => {
    const session = await browser.open();
    const id = await session.shutter(photo(1));
    await clock.until(allQueued(session, 1));
    const other = new ModelBrowser(server, clock);
    const second = await other.open({ sessionId: session.id });
    await clock.until(allQueued(second, 1));
    server.stop();
    await second.undo(id);
    expect(second.views).toEqual([]);
    server.start();
    await clock.until(() => server.alive().length === 0);
    other.close();
  });
});

describe('a session that takes nothing any more', () => {
  test('was erased: this device keeps nothing of it and begins nothing', async () => {
    const session = await browser.open();
    const first = await session.shutter(photo(1));
    await clock.until(allQueued(session, 1));
    server.stop();
    const second = await session.shutter(photo(2));
    server.sessions.delete(session.id);
    server.gone.set(session.id, 'erased');
    server.start();
    await clock.until(async () => await session.photo(second) === null);
    await settle();
    expect(session.views).toEqual([]);
    expect(server.sessions.size).toBe(0);
    const db = await CaptureDb.open(browser.name);
    expect([await db.captures(), await db.sessions()]).toEqual([[], []]);
    expect([await db.photo(first), await db.photo(second)]).toEqual([null, null]);
    db.close();
  });

  test('was erased while no page of it was open: the next page keeps nothing of it', async () => {
    const session = await browser.open();
    const [sent, undone] = [await session.shutter(photo(1)), await session.shutter(photo(2))];
    await clock.until(allQueued(session, 2));
    server.ready(sent);
    await clock.until(() => states(session).includes('ready'));
    await session.mpiBytes(sent, 1);
    server.stop();
    const unsent = await session.shutter(photo(3));
    await session.undo(undone);
    browser.close();
    server.start();
    server.erase(session.id);
    // Its answer is lost at first, and what is new is sent all the same.
    let losses = 2;
    server.fault = (what) => what === 'GET /sessions/S' && losses-- > 0 ? 'reply lost' : null;
    const next = await browser.open({ sessionId: 'the-next-one' });
    await next.shutter(photo(4));
    await clock.until(allQueued(next, 1));
    const db = await CaptureDb.open(browser.name);
    await clock.until(async () => (await db.sessionIds()).length === 1);
    expect(await db.sessionIds()).toEqual([next.id]);
    expect(await db.captures(session.id)).toEqual([]);
    for (const id of [sent, undone, unsent]) expect(await db.photo(id)).toBeNull();
    expect(await db.mpi(sent, 1)).toBeNull();
    expect(server.sessions.has(session.id)).toBe(false);
    db.close();
  });

  test('is asked about once: others of this browser stay', async () => {
    const session = await browser.open();
    await session.shutter(photo(1));
    await clock.until(allQueued(session, 1));
    browser.close();
    const next = await browser.open({ sessionId: 'the-next-one' });
    await next.shutter(photo(2));
    await clock.until(allQueued(next, 1));
    await settle();
    expect(server.log.filter((what) => what === 'GET /sessions/S').length).toBe(1);
    const db = await CaptureDb.open(browser.name);
    expect((await db.captures(session.id)).length).toBe(1);
    db.close();
  });

  test('was deleted: photos stay here, and others are sent', async () => {
    const session = await browser.open();
    server.gone.set(session.id, 'deleted');
    const id = await session.shutter(photo(1));
    await clock.until(() => states(session)[0] === 'failed');
    expect(session.views[0]?.problem).toBe('it was deleted');
    expect(await session.photo(id)).not.toBeNull();
    server.gone.clear();
    await session.retry(id);
    await clock.until(allQueued(session, 1));
  });
});

test('two tabs: every capture is written once, one at a time', async () => {
  const left = await browser.open();
  const right = await browser.open();
  expect(right.id).toBe(left.id);
  for (let i = 0; i < 4; i++) {
    await Promise.all([left.shutter(photo(2 * i)), right.shutter(photo(2 * i + 1))]);
  }
  await clock.until(() => left.views.length === 8 && right.views.length === 8
    && [...states(left), ...states(right)].every((state) => state === 'queued'));
  expect(server.mostUploadsAtOnce).toBe(1);
  expect([...server.writes.values()]).toEqual(Array(8).fill(1));
  expect(server.log.filter((what) => what.startsWith('PUT b'))).toHaveLength(8);
});

test('a full phone: the photo is in memory, it is said, and it is sent', async () => {
  server.stop();
  const session = await browser.open();
  const put = vi.spyOn(IDBObjectStore.prototype, 'put').mockImplementation(() => {
    throw new DOMException('no room', 'QuotaExceededError');
  });
  const id = await session.shutter(photo(1));
  expect(put).toHaveBeenCalled();
  expect(session.snapshot.storageProblem).toMatch(/storage is full.*Keep this page open/);
  expect(await session.photo(id)).not.toBeNull();
  server.start();
  put.mockRestore();
  await clock.until(allQueued(session, 1));
  expect(server.alive()).toEqual([id]);
  await clock.until(() => session.snapshot.storageProblem === null);
});

test('no database at all: it works in memory and says so', async () => {
  const db = await (async () => {
    const open = vi.spyOn(indexedDB, 'open').mockImplementation(() => {
      throw new DOMException('forbidden', 'SecurityError');
    });
    const opened = await CaptureDb.open('none');
    open.mockRestore();
    return opened;
  })();
  const session = await browser.open({ db });
  expect(session.snapshot.storageProblem).toMatch(/private window/);
  const id = await session.shutter(photo(1));
  await clock.until(allQueued(session, 1));
  expect(server.alive()).toEqual([id]);
});

test('finish, offline: told to the server after all photos; the next session is new', async () => {
  server.stop();
  const session = await browser.open();
  const id = await session.shutter(photo(1));
  await session.finish('kitchen');
  expect(session.snapshot).toMatchObject({ name: 'kitchen', finished: 'pending' });
  server.start();
  await clock.until(() => session.snapshot.finished === 'yes');
  expect(server.sessions.get(session.id)).toMatchObject({ name: 'kitchen', finished: true });
  expect(server.alive()).toEqual([id]);
  const db = await CaptureDb.open(browser.name);
  expect(await db.captures()).toEqual([]);
  db.close();
  const next = await browser.open();
  expect(next.id).not.toBe(session.id);
});

test('after the end more views can be taken: the server is told first', async () => {
  const session = await browser.open();
  await session.shutter(photo(1));
  await session.finish();
  await clock.until(() => session.snapshot.finished === 'yes');
  server.stop();
  await session.reopen();
  expect(session.snapshot.finished).toBe('no');
  const id = await session.shutter(photo(2));
  server.start();
  await clock.until(() => server.alive().includes(id));
  expect(server.sessions.get(session.id)).toMatchObject({ finished: false });
  expect(session.snapshot.finished).toBe('no');
  expect((await browser.open()).id).toBe(session.id);
});

test('a photo that was taken after the end is kept here, and sent when somebody goes on', async () => {
  const session = await browser.open();
  await session.shutter(photo(1));
  await clock.until(allQueued(session, 1));
  server.stop(); // so this phone does not hear that another one finishes
  server.finish(true);
  const id = await session.shutter(photo(2));
  server.start();
  await clock.until(() => session.snapshot.views.some(({ state }) => state === 'failed'));
  expect(session.snapshot.views.at(-1)).toMatchObject({ id, problem: 'it is finished' });
  expect(await session.photo(id)).not.toBeNull();
  await clock.until(() => session.snapshot.finished === 'yes');
  server.finish(false);
  await clock.until(allQueued(session, 2));
  expect(server.alive()).toContain(id);
  expect(session.snapshot.finished).toBe('no');
});

test('snapshots do not change, and every change is told', async () => {
  const session = await browser.open();
  const seen: (readonly unknown[])[] = [];
  const stop = session.subscribe(({ views }) => void seen.push(views));
  await session.shutter(photo(1));
  await clock.until(allQueued(session, 1));
  expect(seen[0]).toEqual([]);
  const heard = seen.length;
  stop();
  await session.shutter(photo(2));
  expect(seen.length).toBe(heard);
});

test('a session that an earlier version of this page kept is begun in the words of today', async () => {
  const db = await CaptureDb.open(browser.name);
  const request = { id: 'kept-long-ago', protocol: 1, name: 'old', source: 'virtual', device: 'x' };
  await db.putSession({ id: request.id, request, begun: false, pending: null } as StoredSession);
  db.close();
  const session = await browser.open({ sessionId: request.id });
  await clock.until(() => session.snapshot.connection === 'online');
  expect(server.sessions.get(request.id)?.request)
    .toEqual({ protocol: PROTOCOL, name: 'old', source: 'virtual', device: 'x' });
});
