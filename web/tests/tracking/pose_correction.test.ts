import { expect, test } from 'vitest';
import { angleBetween, compose, composeInto, distanceBetween, identity, inverse, rigid, type Cam, type Rigid, type World } from '../../src/geometry';
import { PoseCorrection } from '../../src/tracking/pose_correction';

type Pose = Rigid<World, Cam>;

/** Turned about the vertical, somewhere. */
function pose(x_m: number, y_m: number, z_m: number, turn_rad: number): Pose {
  const [c, s] = [Math.cos(turn_rad), Math.sin(turn_rad)];
  return rigid([c, 0, s, x_m, 0, 1, 0, y_m, -s, 0, c, z_m]);
}

/** What the device says when it believes the world to be elsewhere. */
function seenBy(deviceFromWorld: Rigid<World, World>, truth: Pose): Pose {
  return compose(deviceFromWorld, truth);
}

function shift(x_m: number, turn_rad = 0): Rigid<World, World> {
  const [c, s] = [Math.cos(turn_rad), Math.sin(turn_rad)];
  return rigid([c, 0, s, x_m, 0, 1, 0, 0, -s, 0, c, 0]);
}

function shownAt(correction: PoseCorrection, time_ms: number, device: Pose): Pose {
  return correction.shown(time_ms, device, identity());
}

const FAR = pose(4, 1.5, -3, 0.8);
const SAME_M = 2e-5;

test('without an alignment the device is believed', () => {
  const correction = new PoseCorrection();
  expect(shownAt(correction, 0, FAR).rows).toEqual(FAR.rows);
  expect(correction.suggested(0, FAR, identity())).toBeNull();
  expect(correction.state).toEqual({ moved_m: null, turned_rad: null, jumps: 0 });
});

test('what was found for one frame serves the frames that follow', () => {
  const correction = new PoseCorrection();
  const wrong = shift(0.006, 0.003);
  correction.found(0, seenBy(wrong, FAR), FAR);
  expect(correction.state.turned_rad).toBeCloseTo(0.003, 6);
  shownAt(correction, 0, seenBy(wrong, FAR));
  const later = pose(4.2, 1.4, -2.8, 0.7);
  let shown = identity<World, Cam>();
  for (let time_ms = 16; time_ms < 900; time_ms += 16) shown = shownAt(correction, time_ms, seenBy(wrong, later));
  expect(distanceBetween(shown, later)).toBeLessThan(SAME_M);
  expect(angleBetween(shown, later)).toBeLessThan(SAME_M);
  const suggested = correction.suggested(900, seenBy(wrong, later), identity());
  expect(suggested).not.toBeNull();
  expect(distanceBetween(suggested ?? identity(), later)).toBeLessThan(1e-9);
});

test('it comes in slowly', () => {
  const correction = new PoseCorrection();
  const device = pose(0, 0, 0, 0);
  shownAt(correction, 0, device);
  correction.found(0, device, pose(0.01, 0, 0, 0));
  let before = 0;
  for (let time_ms = 16; time_ms < 600; time_ms += 16) {
    const x_m = shownAt(correction, time_ms, device).rows[3] ?? NaN;
    expect(x_m).toBeGreaterThanOrEqual(before);
    expect(x_m - before).toBeLessThan(0.0015);
    before = x_m;
  }
  expect(before).toBeCloseTo(0.01, 3);
});

test('what is shown stays a rotation', () => {
  const correction = new PoseCorrection();
  shownAt(correction, 0, FAR);
  correction.found(0, FAR, compose(shift(0.02, 0.04), FAR));
  const { rows } = shownAt(correction, 40, FAR);
  const back = compose(inverse(rigid<World, Cam>(rows)), rigid<World, Cam>(rows));
  identity().rows.forEach((value, i) => expect(back.rows[i]).toBeCloseTo(value, 12));
});

test('a picture that stands still is not drawn again and again', () => {
  const correction = new PoseCorrection();
  shownAt(correction, 0, FAR);
  correction.found(0, FAR, compose(shift(0.004), FAR));
  let time_ms = 0;
  for (; time_ms < 2000; time_ms += 16) {
    shownAt(correction, time_ms, FAR);
    const jitter = (time_ms % 3) * 5e-5;
    correction.found(time_ms, FAR, compose(shift(0.004 + jitter), FAR));
  }
  const once = shownAt(correction, time_ms, FAR).rows;
  expect(shownAt(correction, time_ms + 16, FAR).rows).toEqual(once);
});

test('after some seconds without an alignment the device is believed again, slowly', () => {
  const correction = new PoseCorrection();
  const device = pose(0, 0, 0, 0);
  correction.found(0, device, pose(0.01, 0, 0, 0));
  for (let time_ms = 0; time_ms < 1600; time_ms += 16) shownAt(correction, time_ms, device);
  expect(correction.state.moved_m).toBeNull();
  expect(correction.suggested(1600, device, identity())).toBeNull();
  expect(shownAt(correction, 1600, device).rows[3]).toBeCloseTo(0.01, 4);
  shownAt(correction, 3010, device);
  expect(shownAt(correction, 3026, device).rows[3]).toBeGreaterThan(0.005);
  for (let time_ms = 3026; time_ms < 4500; time_ms += 16) shownAt(correction, time_ms, device);
  expect(shownAt(correction, 4500, device).rows[3]).toBeCloseTo(0, 4);
});

test('while nothing changes, what was found stays', () => {
  const correction = new PoseCorrection();
  const device = pose(0, 0, 0, 0);
  correction.found(0, device, pose(0.01, 0, 0, 0));
  for (let time_ms = 0; time_ms < 9000; time_ms += 16) {
    shownAt(correction, time_ms, device);
    correction.stands(time_ms);
  }
  expect(correction.state.moved_m).toBeCloseTo(0.01, 9);
  expect(shownAt(correction, 9000, device).rows[3]).toBeCloseTo(0.01, 4);
});

test('one alignment that is far off is not believed', () => {
  const correction = new PoseCorrection();
  correction.found(0, FAR, FAR);
  correction.found(60, FAR, compose(shift(0.08), FAR));
  correction.found(120, FAR, FAR);
  expect(correction.state.jumps).toBe(0);
  expect(correction.state.moved_m).toBeLessThan(1e-9);
});

test('a jump that is found twice carries the views along', () => {
  const correction = new PoseCorrection();
  shownAt(correction, 0, FAR);
  correction.found(0, FAR, FAR);
  const jumped = shift(-0.07, 0.01);
  const here = seenBy(jumped, FAR);
  correction.found(60, here, FAR);
  expect(correction.state.jumps).toBe(0);
  correction.found(120, here, FAR);
  expect(correction.state.jumps).toBe(1);
  expect(correction.state.moved_m).toBe(0);
  // At once: it was the device's numbers that jumped, not the room.
  const later = pose(4.1, 1.5, -3, 0.85);
  expect(distanceBetween(shownAt(correction, 130, seenBy(jumped, later)), later)).toBeLessThan(1e-9);
  expect(distanceBetween(correction.carried(seenBy(jumped, later), identity()), later)).toBeLessThan(1e-9);
  // And for good.
  for (let time_ms = 130; time_ms < 9000; time_ms += 16) shownAt(correction, time_ms, here);
  expect(distanceBetween(shownAt(correction, 9000, here), FAR)).toBeLessThan(1e-9);
  correction.found(9016, here, compose(shift(0.004), FAR));
  expect(correction.state.moved_m).toBeCloseTo(0.004, 6);
});

test('a jump of which not all is known is not believed', () => {
  const correction = new PoseCorrection();
  correction.found(0, FAR, FAR);
  for (const time_ms of [60, 120, 180]) correction.found(time_ms, FAR, compose(shift(0.07), FAR), false);
  expect(correction.state.jumps).toBe(0);
  expect(correction.asksAgain).toBe(false);
});

test('what is further away than devices drift is not believed', () => {
  const correction = new PoseCorrection();
  correction.found(0, FAR, compose(shift(0.2), FAR));
  expect(correction.state.moved_m).toBeNull();
});

test('composing makes nothing and agrees with compose', () => {
  const a = shift(0.3, 0.2);
  composeInto(a, FAR, identity()).rows.forEach((value, i) => expect(value).toBeCloseTo(compose(a, FAR).rows[i] ?? NaN, 12));
});
