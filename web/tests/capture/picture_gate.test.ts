import { expect, test } from 'vitest';
import { AT_LEAST, BLURRED, NEAR_M, PictureGate, REMEMBERED, type PictureFault } from '../../src/capture/picture_gate';
import { rigid, type Cam, type Rigid, type World } from '../../src/geometry';

const GOOD = { sharpness: 1, grey: 110, burntOut: 0.02 };

function at(x_m: number): Rigid<World, Cam> {
  return rigid<World, Cam>([1, 0, 0, x_m, 0, 1, 0, 0, 0, 0, 1, 0]);
}

/** A gate that has seen so many good pictures from one place. */
function seasoned(count: number): PictureGate {
  const gate = new PictureGate();
  for (let i = 0; i < count; i += 1) expect(gate.judge(GOOD, at(0))).toBeNull();
  return gate;
}

test('a picture is blurred beside sharper ones from there', () => {
  const faultOf = (sharpness: number, count: number, x_m = 0): PictureFault | null =>
    seasoned(count).judge({ ...GOOD, sharpness }, at(x_m));
  expect(faultOf(BLURRED - 0.01, AT_LEAST)).toBe('blurred');
  expect(faultOf(BLURRED + 0.01, AT_LEAST)).toBeNull();
  expect(faultOf(0.1, AT_LEAST - 1)).toBeNull();
  expect(faultOf(0.1, AT_LEAST, 1.1 * NEAR_M)).toBeNull();
});

test('a wall without texture is not called blurred for long', () => {
  const gate = seasoned(REMEMBERED);
  const faults = Array.from({ length: REMEMBERED }, () => gate.judge({ ...GOOD, sharpness: 0.3 }, at(0)));
  expect(faults[0]).toBe('blurred');
  expect(faults.at(-1)).toBeNull();
});

test('exposure is judged without others', () => {
  const gate = new PictureGate();
  expect(gate.judge({ ...GOOD, grey: 10 }, at(0))).toBe('too-dark');
  expect(gate.judge({ ...GOOD, grey: 230, burntOut: 0.7 }, at(0))).toBe('too-bright');
});
