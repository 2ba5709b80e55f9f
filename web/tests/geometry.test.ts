import { describe, expect, test } from 'vitest';
import {
  compose, forwardOf, inverse, pinholeOfProjection, positionOf, resized, rigid,
  worldFromCamOfWebXr, type Cam, type World,
} from '../src/geometry';

const NEAR = 12;

/** A quarter turn about y (x to -z), then 1, 2, 3 m along. */
const TURNED = rigid<World, Cam>([0, 0, 1, 1, 0, 1, 0, 2, -1, 0, 0, 3]);

function expectRows(found: ArrayLike<number>, expected: readonly number[]): void {
  expect(found.length).toBe(expected.length);
  expected.forEach((value, i) => expect(found[i]).toBeCloseTo(value, NEAR));
}

describe('transforms', () => {
  test('an inverse undoes', () => {
    expectRows(compose(inverse(TURNED), TURNED).rows, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]);
    expectRows(inverse(TURNED).rows, [0, 0, -1, 3, 0, 1, 0, -2, 1, 0, 0, -1]);
  });

  test('the right factor acts first', () => {
    const along = rigid<Cam, Cam>([1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0]);
    expectRows(compose(TURNED, along).rows, [0, 0, 1, 1, 0, 1, 0, 2, -1, 0, 0, -2]);
  });

  test('position and forward of a turned camera', () => {
    const camera = { pinhole: pinholeOfProjection([], 1, 1), worldFromCam: TURNED };
    expect(positionOf(camera)).toEqual([1, 2, 3]);
    expect(forwardOf(camera)).toEqual([1, 0, 0]);
  });

  test('WebXR looks along -z with y up, and so does the turned camera', () => {
    const here = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 5, 6, 1];
    const worldFromCam = worldFromCamOfWebXr(here);
    const camera = { pinhole: pinholeOfProjection([], 1, 1), worldFromCam };
    expect(positionOf(camera)).toEqual([4, 5, 6]);
    expect(forwardOf(camera).map((v) => v + 0)).toEqual([0, 0, -1]);
    // y of the picture, which is down, is the world's -y
    expect(camera.worldFromCam.rows[5]).toBe(-1);
  });

  test('12 numbers are needed', () => {
    expect(() => rigid([1, 2, 3])).toThrow(RangeError);
  });
});

describe('pinholes', () => {
  test('a frustum of 90 degrees, its centre a quarter of the picture up and left', () => {
    const projection = [1, 0, 0, 0, 0, 2, 0, 0, 0.5, -0.5, -1, -1, 0, 0, -0.2, 0];
    expect(pinholeOfProjection(projection, 200, 100)).toEqual({
      width_px: 200, height_px: 100, fx_px: 100, fy_px: 100, cx_px: 50, cy_px: 25,
    });
  });

  test('the centre of a projected point lands where GL puts it, counted from the top', () => {
    const projection = [1.4, 0, 0, 0, 0, 0.9, 0, 0, 0.11, -0.07, -1, -1, 0, 0, -0.2, 0];
    const k = pinholeOfProjection(projection, 320, 480);
    const [x, y, z] = [0.3, -0.2, -1.7]; // in GL's axes
    const ndcX = (1.4 * x + 0.11 * z) / -z;
    const ndcY = (0.9 * y - 0.07 * z) / -z;
    expect((k.fx_px * x) / -z + k.cx_px).toBeCloseTo((320 * (ndcX + 1)) / 2, NEAR);
    expect((k.fy_px * -y) / -z + k.cy_px).toBeCloseTo((480 * (1 - ndcY)) / 2, NEAR);
  });

  test('another size scales each axis by its own factor', () => {
    const k = { width_px: 10, height_px: 20, fx_px: 8, fy_px: 9, cx_px: 5, cy_px: 11 };
    expect(resized(k, 20, 10)).toEqual({
      width_px: 20, height_px: 10, fx_px: 16, fy_px: 4.5, cx_px: 10, cy_px: 5.5,
    });
  });
});
