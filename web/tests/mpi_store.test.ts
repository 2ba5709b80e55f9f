import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { rigid, type Camera } from '../src/geometry';
import type { DecodedMpi } from '../src/mpi/decode';
import { MpiStore } from '../src/mpi/mpi_store';

const PINHOLE = { width_px: 4, height_px: 4, fx_px: 4, fy_px: 4, cx_px: 2, cy_px: 2 };
const POSE = rigid<never, never>([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]);
const CAMERA = { pinhole: PINHOLE, worldFromCam: POSE } as Camera;

/** Counts what is made and not deleted; everything else does nothing. */
function graphics(most = 4096): { gl: WebGL2RenderingContext; alive: Set<object> } {
  const alive = new Set<object>();
  const gl = new Proxy({}, {
    get: (_, name) => {
      const word = String(name);
      if (word === 'MAX_TEXTURE_SIZE') return word;
      if (/^[A-Z0-9_]+$/.test(word)) return 0;
      if (word === 'getParameter') {
        return (what: unknown) => (what === 'MAX_TEXTURE_SIZE' ? most : 0);
      }
      if (word.startsWith('create')) {
        return () => {
          const made = {};
          alive.add(made);
          return made;
        };
      }
      if (word.startsWith('delete')) return (made: object) => alive.delete(made);
      return () => undefined;
    },
  }) as WebGL2RenderingContext;
  return { gl, alive };
}

function decoded(textureRows = 1): DecodedMpi {
  return {
    pinhole: PINHOLE,
    worldFromCam: POSE.rows,
    planeDepths_m: Float64Array.of(4, 2, 1),
    places: Uint16Array.of(0, 0, 0),
    numTiles: 1,
    texels: new Uint8Array(2048 * 16 * textureRows * 4),
    textureRows,
  };
}

const decoder = { decode: async () => decoded() };
const file = async (): Promise<ArrayBuffer> => new ArrayBuffer(1);
const settle = async (): Promise<void> => { await vi.advanceTimersByTimeAsync(0); };

beforeEach(() => { vi.useFakeTimers(); });
afterEach(() => { vi.useRealTimers(); });

test('an MPI comes, is counted, and goes without a trace', async () => {
  const { gl, alive } = graphics();
  const store = new MpiStore(gl, { decoder, maxResident: 3 });
  store.add('a', CAMERA, file);
  expect(store.resident('a')).toBeNull();
  await settle();
  expect(store.resident('a')?.medianDepth_m).toBe(2);
  expect(store.residentBytes).toBe(2048 * 16 * 4 + 12);
  store.remove('a');
  expect(alive.size).toBe(0);
  expect(store.residentBytes).toBe(0);
  expect(store.cameras).toEqual([]);
});

test('one that is removed while it is on its way does not come', async () => {
  const { gl, alive } = graphics();
  const store = new MpiStore(gl, { decoder, maxResident: 3 });
  store.add('a', CAMERA, file);
  store.remove('a');
  await settle();
  expect(alive.size).toBe(0);
});

test('the ones that were not wanted for the longest time make room', async () => {
  const { gl, alive } = graphics();
  const store = new MpiStore(gl, { decoder, maxResident: 2 });
  for (const id of ['a', 'b', 'c']) {
    store.add(id, CAMERA, file);
    await settle();
    store.want('a');
  }
  expect(store.residentCount).toBe(2);
  expect(store.resident('b')).toBeNull();
  expect(alive.size).toBe(2 * 3);
  store.want('b');
  await settle();
  expect(store.resident('b')).not.toBeNull();
});

test('a session of 300 views, opened again, fetches what fits, the newest first', async () => {
  const { gl } = graphics();
  const store = new MpiStore(gl, { decoder, maxResident: 12 });
  const fetched: number[] = [];
  for (let i = 0; i < 300; i += 1) {
    store.add(String(i), CAMERA, async () => {
      fetched.push(i);
      return await file();
    });
  }
  for (let i = 0; i < 400; i += 1) await settle();
  expect(store.residentCount).toBe(12);
  // One more: the first begins before anyone can know of the others.
  expect(fetched.length).toBeLessThanOrEqual(14);
  expect(store.resident('299')).not.toBeNull();
});

describe('an MPI that cannot be read', () => {
  test('is said, and tried again ever more rarely', async () => {
    const { gl } = graphics();
    let tries = 0;
    const problems: string[] = [];
    const store = new MpiStore(gl, {
      decoder, maxResident: 2, onProblem: (id) => { problems.push(id); },
    });
    store.add('a', CAMERA, async () => {
      tries += 1;
      throw new Error('404');
    });
    for (let frame = 0; frame < 60 * 60; frame += 1) {
      store.want('a');
      await vi.advanceTimersByTimeAsync(1000 / 60);
    }
    expect(problems.length).toBe(tries);
    expect(tries).toBeGreaterThan(2);
    expect(tries).toBeLessThan(12);
  });

  test('comes when it can be read again', async () => {
    const { gl } = graphics();
    let offline = true;
    const store = new MpiStore(gl, { decoder, maxResident: 2 });
    store.add('a', CAMERA, async () => {
      if (offline) throw new Error('offline');
      return await file();
    });
    await settle();
    offline = false;
    for (let second = 0; second < 40; second += 1) {
      store.want('a');
      await vi.advanceTimersByTimeAsync(1000);
    }
    expect(store.resident('a')).not.toBeNull();
  });

  test('because the card takes no texture of its size', async () => {
    const { gl, alive } = graphics(2048);
    const problems: unknown[] = [];
    const store = new MpiStore(gl, {
      decoder: { decode: async () => decoded(129) },
      maxResident: 2,
      onProblem: (_, error) => { problems.push(error); },
    });
    store.add('a', CAMERA, file);
    await settle();
    expect(String(problems[0])).toMatch(/2064/);
    expect(alive.size).toBe(0);
  });
});

test('a better MPI takes the place of the first, which is shown until then', async () => {
  const { gl, alive } = graphics();
  const store = new MpiStore(gl, { decoder, maxResident: 3 });
  store.add('a', CAMERA, file);
  await settle();
  const first = store.resident('a');
  const made = alive.size;
  let arrive: (bytes: ArrayBuffer) => void = () => undefined;
  store.replace('a', () => new Promise((resolve) => { arrive = resolve; }));
  await settle();
  expect(store.want('a')).toBe(first);
  arrive(new ArrayBuffer(1));
  await settle();
  expect(store.resident('a')).not.toBe(first);
  expect(store.resident('a')).not.toBeNull();
  expect(alive.size).toBe(made);
});

test('one that is replaced while it is on its way comes twice, the better one last', async () => {
  const { gl, alive } = graphics();
  const asked: string[] = [];
  const store = new MpiStore(gl, { decoder, maxResident: 3 });
  const load = (name: string) => async (): Promise<ArrayBuffer> => {
    asked.push(name);
    return new ArrayBuffer(1);
  };
  store.add('a', CAMERA, load('first'));
  store.replace('a', load('better'));
  await settle();
  await settle();
  expect(asked).toEqual(['first', 'better']);
  store.remove('a');
  expect(alive.size).toBe(0);
});

test('a better one that cannot be had leaves the first in the picture', async () => {
  const { gl } = graphics();
  const onProblem = vi.fn<(id: string, error: unknown) => void>();
  const store = new MpiStore(gl, { decoder, maxResident: 3, onProblem });
  store.add('a', CAMERA, file);
  await settle();
  const first = store.resident('a');
  store.replace('a', async () => { throw new Error('gone'); });
  await settle();
  expect(store.resident('a')).toBe(first);
  expect(onProblem).toHaveBeenCalled();
});
