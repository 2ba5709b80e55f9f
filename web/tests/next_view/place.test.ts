import { describe, expect, test } from 'vitest';
import { rigid, type Cam, type Camera, type Rigid, type World } from '../../src/geometry';
import { AHEAD_M, frameOf, INNER, moveTo, newFrame } from '../../src/next_view/place';

const LENS = { width_px: 300, height_px: 600, fx_px: 300, fy_px: 300, cx_px: 150, cy_px: 300 };
/** The server's is smaller, with the same field of view. */
const SMALL = { width_px: 30, height_px: 60, fx_px: 30, fy_px: 30, cx_px: 15, cy_px: 30 };

function pose(x: number, y: number, z: number, yaw = 0): Rigid<World, Cam> {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
  return rigid([c, 0, s, x, 0, 1, 0, y, -s, 0, c, z]);
}

const live = (x = 0, y = 0, z = 0, yaw = 0): Camera => ({ pinhole: LENS, worldFromCam: pose(x, y, z, yaw) });
const place = (x = 0, y = 0, z = 0, yaw = 0): Camera => ({ pinhole: SMALL, worldFromCam: pose(x, y, z, yaw) });

describe('the frame of a suggested view', () => {
  test('from the view itself it surrounds the middle, and is reached', () => {
    const frame = frameOf(live(), place(), newFrame());
    const low = 0.5 - INNER / 2;
    const high = 0.5 + INNER / 2;
    const expected = [low, low, high, low, high, high, low, high];
    expected.forEach((value, i) => expect(frame.corners[i]).toBeCloseTo(value, 9));
    expect(frame.inside).toBe(true);
    expect(frame.reached).toBe(true);
  });

  test('by hand: 0.07 m to the right it is a tenth of the focal length aside', () => {
    const frame = frameOf(live(), place(0.07), newFrame());
    const shift = (300 * 0.07) / AHEAD_M / 300;
    expect(frame.corners[0]).toBeCloseTo(0.2 + shift, 9);
    expect(frame.corners[1]).toBeCloseTo(0.2, 9);
    expect(frame.reached).toBe(false);
    expect(frame.direction[0]).toBeCloseTo(0.07, 9);
  });

  test('farther ahead it is smaller, and not reached', () => {
    const frame = frameOf(live(), place(0, 0, AHEAD_M), newFrame());
    expect((frame.corners[2] ?? 0) - (frame.corners[0] ?? 0)).toBeCloseTo(INNER / 2, 9);
    expect(frame.inside).toBe(true);
    expect(frame.reached).toBe(false);
  });

  test.each([
    ['to the side', place(0.6)], ['turned away', place(0, 0, 0, 1.2)],
    ['behind', place(0, 0, -AHEAD_M - 0.2)], ['looking back', place(0, 0, 0, Math.PI)],
  ])('%s it is outside the picture', (_, suggested) => {
    const frame = frameOf(live(), suggested, newFrame());
    expect(frame.inside).toBe(false);
    expect(frame.reached).toBe(false);
  });

  test('at the edge it does not flicker', () => {
    const frame = newFrame();
    const at = (share: number): boolean =>
      frameOf(live(), place(0.5 * share * AHEAD_M), frame).inside;
    expect(at(0.8)).toBe(false); // from outside it must come farther in
    expect(at(0.7)).toBe(true);
    expect(at(0.8)).toBe(true); // from inside it may go farther out
    expect(at(0.95)).toBe(false);
    expect(at(0.8)).toBe(false);
  });

  test('it stays where it is in the room when the world is turned as a whole', () => {
    const a = frameOf(live(), place(0.1, 0.05, 0.2, 0.1), newFrame());
    const turn = 0.9;
    const [c, s] = [Math.cos(turn), Math.sin(turn)];
    const moved = place(c * 0.1 + s * 0.2, 0.05, -s * 0.1 + c * 0.2, 0.1 + turn);
    const b = frameOf(live(0, 0, 0, turn), moved, newFrame());
    a.corners.forEach((value, i) => expect(b.corners[i]).toBeCloseTo(value, 9));
  });
});

test.each([
  ['right', place(0.2)], ['left', place(-0.2)], ['down', place(0, 0.2)], ['up', place(0, -0.2)],
  ['closer', place(0, 0, 0.2)], ['back', place(0, 0, -0.2)],
  ['turn-right', place(0.05, 0, 0, 0.4)], ['turn-left', place(0.05, 0, 0, -0.4)],
] as const)('the way is %s', (move, suggested) => {
  expect(moveTo(live(), suggested, false)).toBe(move);
});

test('there is no way to go from where it is reached', () => {
  expect(moveTo(live(), place(0.01), true)).toBe('here');
});
