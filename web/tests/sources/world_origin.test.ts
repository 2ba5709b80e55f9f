import { expect, test } from 'vitest';
import { compose, inverse, rigid, type Cam, type World } from '../../src/geometry';
import { WorldOrigin } from '../../src/sources/world_origin';

/** Turned about the vertical, somewhere. */
function motion(x_m: number, z_m: number, turn_rad: number): number[] {
  const [c, s] = [Math.cos(turn_rad), Math.sin(turn_rad)];
  return [c, 0, s, x_m, 0, 1, 0, 0, -s, 0, c, z_m];
}

function columnMajor(rows: readonly number[]): number[] {
  const at = (r: number, c: number): number => (r < 3 ? rows[4 * r + c] ?? NaN : c === 3 ? 1 : 0);
  return [0, 1, 2, 3].flatMap((c) => [0, 1, 2, 3].map((r) => at(r, c)));
}

test('before a reset poses are as they come', () => {
  const origin = new WorldOrigin();
  const pose = rigid<World, Cam>(motion(1, 2, 0.5));
  origin.follow(pose);
  expect([...pose.rows]).toEqual(motion(1, 2, 0.5));
});

test('a camera that stands still goes on standing still', () => {
  const origin = new WorldOrigin();
  const here = rigid<World, Cam>(motion(1, 2, 0.5));
  let device = here;
  // Twice: the second is told in the world of the first.
  for (const given of [motion(0.3, -0.2, 0.1), motion(-1, 0.4, -0.7)]) {
    origin.reset(columnMajor(given));
    device = compose(inverse(rigid<World, World>(given)), device);
    const pose = rigid<World, Cam>(device.rows);
    origin.follow(pose);
    here.rows.forEach((value, i) => expect(pose.rows[i]).toBeCloseTo(value, 12));
  }
  expect(origin.resets).toEqual({ followed: 2, lost: 0 });
});

test('where the device does not know, it is said', () => {
  const origin = new WorldOrigin();
  origin.reset(null);
  expect(origin.resets).toEqual({ followed: 0, lost: 1 });
});
