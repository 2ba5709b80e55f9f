import { describe, expect, it } from 'vitest';
import { rigid, type Camera } from '../../src/geometry';
import { WrongPlaces, type LookedAt } from '../../src/memory/wrong_places';

const PINHOLE = { width_px: 60, height_px: 120, fx_px: 80, fy_px: 80, cx_px: 30, cy_px: 60 };

/** At the origin, turned to the right by so many degrees. */
function camera(right_deg: number, x_m = 0): Camera {
  const a = right_deg * Math.PI / 180;
  return {
    pinhole: PINHOLE,
    worldFromCam: rigid([Math.cos(a), 0, Math.sin(a), x_m, 0, 1, 0, 0, -Math.sin(a), 0, Math.cos(a), 0]),
  };
}

/** A wall all over the picture, wrong where asked (column and row of 9 × 18, from the bottom left). */
function wall(share: (column: number, row: number) => number, depth_m = 2): LookedAt {
  const cols = 9;
  const rows = 18;
  return {
    cols, rows, depth_m: new Float32Array(cols * rows).fill(depth_m),
    share: Float32Array.from({ length: cols * rows }, (_, i) => share(i % cols, Math.floor(i / cols))),
  };
}

const FINE = wall(() => 0);
const WRONG = wall(() => 1);

describe('what is wrong outside the picture', () => {
  it('is where it was seen, until it is seen to be right', () => {
    const places = new WrongPlaces();
    places.remember(camera(0), WRONG);
    expect(places.direction(camera(0))).toBeNull(); // it is in the picture
    places.remember(camera(90), FINE);
    const [right, , ahead] = places.direction(camera(90)) ?? [NaN, NaN, NaN];
    expect(right).toBeLessThan(-1.5);
    expect(Math.abs(ahead)).toBeLessThan(0.5);
    expect(places.direction(camera(-70))?.[0]).toBeGreaterThan(1.5); // the arrow goes with the camera
    expect(places.direction(camera(0))).toBeNull();
    for (let i = 0; i < 6; i += 1) places.remember(camera(0), FINE);
    expect(places.count).toBe(0);
    places.remember(camera(90), FINE);
    expect(places.direction(camera(90))).toBeNull();
  });

  it('is pointed at where most of it is', () => {
    const places = new WrongPlaces();
    places.remember(camera(100), wall((column, row) => column > 3 && row > 8 ? 1 : 0));
    places.remember(camera(-100), WRONG);
    places.remember(camera(0), FINE);
    expect(places.direction(camera(0))?.[0]).toBeLessThan(-1);
  });

  it('is not pointed at when it is a trifle', () => {
    const places = new WrongPlaces();
    places.remember(camera(100), wall((column, row) => column === 4 && row === 9 ? 1 : 0));
    places.remember(camera(0), FINE);
    expect(places.count).toBe(1);
    expect(places.direction(camera(0))).toBeNull();
  });

  it('lies nowhere without depth, and nowhere beyond the cells', () => {
    const places = new WrongPlaces();
    places.remember(camera(0), wall(() => 1, 0));
    places.remember(camera(0, 1e7), WRONG);
    expect(places.count).toBe(0);
  });

  it('is forgotten when the world has moved', () => {
    const places = new WrongPlaces();
    places.remember(camera(90), WRONG);
    places.remember(camera(0), FINE);
    expect(places.direction(camera(0))).not.toBeNull();
    places.clear();
    expect(places.direction(camera(0))).toBeNull();
  });
});
