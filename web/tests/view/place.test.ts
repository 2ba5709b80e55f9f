import { expect, test } from 'vitest';
import { axesOf, cellFor } from '../../src/view/floor';
import { parsePlace, pathLength, upOf } from '../../src/view/place';
import { pointsOf } from '../../src/view/point_sets';
import { factsText } from '../../src/view/words';

const CAMERA = {
  pinhole: { width_px: 30, height_px: 40, fx_px: 35, fy_px: 35, cx_px: 15, cy_px: 20 },
  world_from_cam: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0],
};
const PLACE = {
  format: 'peaking place', version: 1, title: 'desk', licence: '', up: null, metric: true, shown: 'place',
  views: [0, 0.3].map((x, i) => ({
    name: `${i}`, photo: null, thumbnail: null, mpi: null,
    camera: { ...CAMERA, world_from_cam: CAMERA.world_from_cam.map((value, at) => (at === 3 ? x : value)) },
  })),
  points: null, splat: null, options: null, start: 7, loss_db: null, poster: null,
};

function read(change: object): ReturnType<typeof parsePlace> {
  return parsePlace(JSON.stringify({ ...PLACE, ...change }));
}

test('a place is read; a start that is not there is the last view', () => {
  const { place, address } = read({});
  expect(place.views).toHaveLength(2);
  expect(place.start).toBe(1);
  expect(place.points).toEqual([]);
  expect(address).toBeNull();
});

test('what is wrong is named', () => {
  expect(() => read({ format: 'something else' })).toThrow('format');
  expect(() => read({ version: 2 })).toThrow('version 2');
  expect(() => read({ views: [{ ...PLACE.views[0], camera: null }] })).toThrow('views');
  expect(() => parsePlace('<html>')).toThrow('not JSON');
});

test('up is what is told, or else as the pictures were held', () => {
  expect(upOf(read({ up: [0, 0, 1] }).place)).toEqual([0, 0, 1]);
  expect(upOf(read({}).place).map((value) => value + 0)).toEqual([0, -1, 0]);
  expect(upOf({ up: null, views: [] })).toEqual([0, 1, 0]);
});

test('what is said has units, and says when there are none', () => {
  const { place } = read({});
  expect(pathLength(place.views)).toBeCloseTo(0.3, 12);
  expect(factsText(place, { wide: 1, deep: 2.04, high: 3 })).toBe('2 views · 30\u00a0cm walked · 1.0 × 2.0\u00a0m, 3.0\u00a0m high');
  expect(factsText({ ...place, metric: false }, null)).toBe('2 views · scale unknown');
});

test('points are places, then colours; anything else is refused', () => {
  const bytes = new ArrayBuffer(30);
  new DataView(bytes).setFloat32(16, 1.5, true); // y of the second
  new Uint8Array(bytes)[27] = 200; // its red
  const { xyz, rgb } = pointsOf(bytes);
  expect(xyz).toHaveLength(6);
  expect(xyz[4]).toBe(1.5);
  expect(rgb[3]).toBe(200);
  expect(() => pointsOf(new ArrayBuffer(31))).toThrow('31');
});

test('the floor has squares of lengths that one knows', () => {
  expect([0.8, 2, 4, 7, 20, 0].map(cellFor)).toEqual([0.1, 0.25, 0.5, 1, 2.5, 1e-6]);
});

test('axes are level, at right angles, and there whatever is up', () => {
  for (const up of [[0, 1, 0], [0, 0, -1], [1, 0, 0]] as const) {
    for (const facing of [[1, 0, 0], [0, 0, 1], [0, 1, 0], up] as const) {
      const [right, ahead] = axesOf(up, facing);
      const dot = (a: readonly number[], b: readonly number[]): number =>
        a.reduce((sum, value, i) => sum + value * (b[i] ?? NaN), 0);
      expect(dot(right, up)).toBeCloseTo(0, 12);
      expect(dot(ahead, up)).toBeCloseTo(0, 12);
      expect(dot(right, ahead)).toBeCloseTo(0, 12);
      expect(dot(right, right)).toBeCloseTo(1, 12);
    }
  }
});
