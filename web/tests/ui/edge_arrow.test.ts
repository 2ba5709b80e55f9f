import { expect, test } from 'vitest';
import type { Vector3 } from '../../src/geometry';
import { edgePlace, type EdgePlace } from '../../src/ui/edge_arrow';

const WIDTH = 400;
const HEIGHT = 900;
/** The middle between what lies above and below. */
const MIDDLE = (118 + 900 - 250) / 2;

function place(direction: Vector3): EdgePlace {
  const found = edgePlace(direction, WIDTH, HEIGHT);
  if (found === null) throw new Error('no place');
  return found;
}

test.each<[string, Vector3, number, number, number]>([
  ['right', [1, 0, 0.2], WIDTH - 27, MIDDLE, 0],
  ['left', [-1, 0, 0.2], 27, MIDDLE, Math.PI],
  ['up', [0, -1, 0.2], WIDTH / 2, 118 + 17, -Math.PI / 2],
  ['down', [0, 1, 0.2], WIDTH / 2, 900 - 250 - 17, Math.PI / 2],
  ['behind', [0, 0, -1], WIDTH - 27, MIDDLE, 0],
  ['behind, to the left', [-0.1, 0, -1], 27, MIDDLE, Math.PI],
])('%s', (_, direction, x_px, y_px, angle_rad) => {
  const found = place(direction);
  expect(found.x_px).toBeCloseTo(x_px, 6);
  expect(found.y_px).toBeCloseTo(y_px, 6);
  expect(Math.cos(found.angle_rad - angle_rad)).toBeCloseTo(1, 6);
});

test('what is behind and above asks to turn around, not to bend backwards', () => {
  const { x_px, angle_rad } = place([0.05, -0.3, -1]);
  expect(x_px).toBeCloseTo(WIDTH - 27, 6);
  expect(angle_rad).toBeGreaterThan(-0.2);
  expect(angle_rad).toBeLessThan(0);
});

test('length does not matter, and straight ahead is nowhere', () => {
  expect(place([2, 1, 3])).toEqual(place([4, 2, 6]));
  expect(edgePlace([0, 0, 5], WIDTH, HEIGHT)).toBeNull();
});

test('it stays on the screen, wherever it points and however small the screen', () => {
  for (const [width, height] of [[400, 900], [320, 480], [900, 400]] as const) {
    for (let i = 0; i < 60; i += 1) {
      const found = edgePlace([Math.sin(i), Math.sin(2.1 * i), Math.cos(1.3 * i)], width, height);
      if (found === null) continue;
      expect(found.x_px).toBeGreaterThanOrEqual(17);
      expect(found.x_px).toBeLessThanOrEqual(width - 17);
      expect(found.y_px).toBeGreaterThanOrEqual(17);
      expect(found.y_px).toBeLessThanOrEqual(height - 17);
    }
  }
});
