import { afterEach, expect, test, vi } from 'vitest';
import { playedTrace } from '../../src/sources/trace';
import type { Trace, TracedFrame } from '../../src/wire';

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const at = (x: number): number[] => [...IDENTITY.slice(0, 12), x, 0, 0, 1];
const PROJECTION = [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, -1, 0, 0, -0.2, 0];
const PICTURE = { width_px: 4, height_px: 8 };

function traced(time_ms: number, changes: Partial<TracedFrame> = {}): TracedFrame {
  return {
    time_ms, began_ms: time_ms, took_ms: 1, world_from_view: at(time_ms), projection: PROJECTION,
    picture: PICTURE, ...changes,
  };
}

const LOST = { world_from_view: null, projection: null, picture: null };
const FRAMES: readonly TracedFrame[] = [
  traced(0), traced(30, { picture: null }), traced(100), traced(130, LOST),
  traced(160, { picture: null, resets: [at(-1000)] }), traced(200, {
    depth: {
      width_px: 8, height_px: 4, format: 'luminance-alpha', metres_per_unit: 0.002,
      // The buffer lies on its side, as ARCore's does: its x runs down the picture.
      buffer_from_view: [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1],
    },
  }),
];
const TRACE: Trace = { version: 1, made_s: 0, told: {}, frames: FRAMES };

afterEach(() => vi.unstubAllGlobals());

function played(): ReturnType<typeof playedTrace> & { readonly asked: string[] } {
  vi.stubGlobal('createImageBitmap', () => Promise.resolve('a picture'));
  const asked: string[] = [];
  const values = Uint16Array.from({ length: 32 }, (_, i) => 500 + i);
  const of = playedTrace({
    recording: () => Promise.reject(new Error('nobody asks')),
    recordedPhoto: (name, index) => {
      asked.push(`${name} photo ${index}`);
      return Promise.resolve(new Blob());
    },
    recordedDepth: (name, index) => {
      asked.push(`${name} depth ${index}`);
      return Promise.resolve(values.buffer);
    },
  }, 'a.zip', TRACE);
  return { ...of, asked };
}

test('frames with a picture are played at their own times, and those in which tracking was lost', () => {
  const trace = played();
  expect(trace.count).toBe(4);
  expect([0, 1, 2].map((i) => trace.duration_ms(i))).toEqual([100, 30, 70]);
  expect(trace.duration_ms(3)).toBeGreaterThan(0);
  expect(trace.camera(2)).toBeNull();
  expect(trace.camera(1)?.pinhole).toEqual({
    width_px: 4, height_px: 8, fx_px: 4, fy_px: 4, cx_px: 2, cy_px: 4,
  });
});

test('an origin that has moved is followed, also where no picture was kept', () => {
  const trace = played();
  const xOf = (i: number): number | undefined => trace.camera(i)?.worldFromCam.rows[3];
  expect([xOf(0), xOf(1), xOf(3)]).toEqual([0, 100, 200 - 1000]);
  expect([0, 1, 2, 3].map((i) => trace.resets(i)?.followed)).toEqual([0, 0, 0, 1]);
});

test('depth is turned here as it is on the phone', async () => {
  const trace = played();
  const { picture, depth } = await trace.load(3);
  expect(picture).toBe('a picture');
  expect(depth).toMatchObject({ width_px: 4, height_px: 8 });
  // The picture's top left is the first column of the buffer's last row.
  expect(depth?.depth_mm[0]).toBe(2 * (500 + 24));
  expect(depth?.depth_mm.at(-1)).toBe(2 * (500 + 7));
  expect(await trace.load(2)).toEqual({ picture: null, depth: null });
  expect((await trace.load(0)).depth).toBeNull();
  expect(trace.asked).toEqual(['a.zip photo 5', 'a.zip depth 5', 'a.zip photo 0']);
});
