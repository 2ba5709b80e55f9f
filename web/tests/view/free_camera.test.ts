import { expect, test } from 'vitest';
import { forwardOf, positionOf, rigid, type Camera } from '../../src/geometry';
import { between, FreeCamera } from '../../src/view/free_camera';
import { Volume } from '../../src/view/volume';

const PINHOLE = { width_px: 300, height_px: 400, fx_px: 350, fy_px: 350, cx_px: 150, cy_px: 200 };

/** At a place, looking along -z with y upwards, as WebXR's cameras do. */
function at(x: number, y: number, z: number): Camera {
  return { pinhole: PINHOLE, worldFromCam: rigid([1, 0, 0, x, 0, -1, 0, y, 0, 0, -1, z]) };
}

function view(camera: Camera): { name: string; camera: Camera; photo: null; thumbnail: null; mpi: null } {
  return { name: '', camera, photo: null, thumbnail: null, mpi: null };
}

test('standing where a camera stood, it is that camera', () => {
  const free = new FreeCamera([0, 1, 0], [0, 0, -1]);
  const wanted = at(1, 2, 3);
  free.stand = free.standOf(wanted);
  const { worldFromCam } = free.update(300, 400, PINHOLE);
  worldFromCam.rows.forEach((value, i) => expect(value).toBeCloseTo(wanted.worldFromCam.rows[i] ?? NaN, 12));
});

test('a camera that looks 30 degrees left and 20 down is met, whatever way is up', () => {
  const yaw = Math.PI / 6;
  const pitch = -Math.PI / 9;
  const forward = [-Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), -Math.cos(yaw) * Math.cos(pitch)];
  const rows = [1, 0, forward[0], 0, 0, -1, forward[1], 0, 0, 0, forward[2], 0].map((value) => value ?? 0);
  const free = new FreeCamera([0, 1, 0], [0, 0, -1]);
  const stand = free.standOf({ pinhole: PINHOLE, worldFromCam: rigid(rows) });
  expect(stand.yaw_rad).toBeCloseTo(yaw, 12);
  expect(stand.pitch_rad).toBeCloseTo(pitch, 12);
  free.stand = stand;
  const camera = free.update(300, 400, PINHOLE);
  forwardOf(camera).forEach((value, i) => expect(value).toBeCloseTo(forward[i] ?? NaN, 12));
});

test('its axes are those of a camera: right-handed, at right angles', () => {
  const free = new FreeCamera([0, 0, 1], [1, 0.2, 0.1]);
  free.turn(0.7, -0.4);
  const m = free.update(640, 480, PINHOLE).worldFromCam.rows;
  const column = (c: number): number[] => [m[c] ?? NaN, m[4 + c] ?? NaN, m[8 + c] ?? NaN];
  const [x, y, z] = [column(0), column(1), column(2)];
  const dot = (a: number[], b: number[]): number => a.reduce((sum, value, i) => sum + value * (b[i] ?? NaN), 0);
  const cross = [
    (x[1] ?? 0) * (y[2] ?? 0) - (x[2] ?? 0) * (y[1] ?? 0), (x[2] ?? 0) * (y[0] ?? 0) - (x[0] ?? 0) * (y[2] ?? 0),
    (x[0] ?? 0) * (y[1] ?? 0) - (x[1] ?? 0) * (y[0] ?? 0),
  ];
  expect(dot(x, y)).toBeCloseTo(0, 12);
  expect(dot(x, x)).toBeCloseTo(1, 12);
  cross.forEach((value, i) => expect(value).toBeCloseTo(z[i] ?? NaN, 12));
  expect(x[2]).toBeCloseTo(0, 12); // upright: its right is level
});

test('walking ahead goes where it looks, and stays level', () => {
  const free = new FreeCamera([0, 1, 0], [0, 0, -1]);
  free.turn(Math.PI / 2, -0.5); // to the left: along -x
  free.walk(0, 0, 2);
  const [x, y, z] = positionOf(free.update(300, 400, PINHOLE));
  expect(x).toBeCloseTo(-2, 12);
  expect(y).toBeCloseTo(0, 12);
  expect(z).toBeCloseTo(0, 12);
});

test('a screen of the same shape shows the same; another crops, and not too much', () => {
  const free = new FreeCamera([0, 1, 0], [0, 0, -1]);
  expect(free.update(600, 800, PINHOLE).pinhole.fx_px).toBeCloseTo(700, 9);
  const wide = free.update(1600, 400, PINHOLE).pinhole;
  expect(wide.fx_px).toBeCloseTo(2 * 350, 9); // twice what shows all of it
  expect(wide.cx_px).toBe(800);
});

test('between two stands it turns the shorter way', () => {
  const half = between(
    { position: [0, 0, 0], yaw_rad: 3, pitch_rad: 0 }, { position: [2, 0, 0], yaw_rad: -3, pitch_rad: 1 }, 0.5);
  expect(half.position).toEqual([1, 0, 0]);
  expect(half.pitch_rad).toBe(0.5);
  expect(half.yaw_rad).toBeCloseTo(Math.PI, 12);
});

test('nobody leaves the volume, however large the step', () => {
  const volume = new Volume([view(at(0, 0, 0)), view(at(1, 0, 0))]);
  expect(volume.radius).toBeCloseTo(1.5, 12);
  const free = new FreeCamera([0, 1, 0], [0, 0, -1]);
  free.volume = volume;
  free.walk(0, 0, 100);
  expect(positionOf(free.update(3, 4, PINHOLE))[2]).toBeCloseTo(-1.5, 6);
  expect(volume.edge).toBeCloseTo(1, 6);
});

test('towards the border steps get shorter, and back they do not', () => {
  const volume = new Volume([view(at(0, 0, 0)), view(at(1, 0, 0))]);
  const free = new FreeCamera([0, 1, 0], [0, 0, -1]);
  free.volume = volume;
  const reached = (): number => -positionOf(free.update(3, 4, PINHOLE))[2];
  free.walk(0, 0, 0.8);
  expect(reached()).toBeCloseTo(0.8, 12); // free inside
  const first = reached();
  free.walk(0, 0, 0.3);
  const second = reached();
  free.walk(0, 0, 0.3);
  expect(reached() - second).toBeLessThan(second - first);
  const outside = reached();
  free.walk(0, 0, -0.3);
  expect(outside - reached()).toBeCloseTo(0.3, 12);
});

test('a single view leaves a little room to lean', () => {
  expect(new Volume([view(at(5, 5, 5))]).radius).toBe(0.12);
});
