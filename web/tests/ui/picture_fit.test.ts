import { expect, test } from 'vitest';
import { placeInBox, placeInPicture, visiblePart, type Fit, type Size } from '../../src/ui/picture_fit';

const size = (width: number, height: number): Size => ({ width, height });

test.each<[string, Size, Size, Fit, [number, number, number, number]]>([
  ['a box as broad as high cuts a tall picture above and below', size(100, 200), size(50, 50), 'cover', [0, 0.25, 1, 0.75]],
  ['a narrow box cuts a broad picture at the sides', size(300, 100), size(100, 100), 'cover', [1 / 3, 0, 2 / 3, 1]],
  ['with bars nothing is cut', size(100, 200), size(50, 50), 'contain', [0, 0, 1, 1]],
  ['of the same form nothing is cut', size(100, 200), size(37, 74), 'cover', [0, 0, 1, 1]],
  ['what has no size yet is whole', size(100, 200), size(0, 0), 'cover', [0, 0, 1, 1]],
])('%s', (_, picture, box, fit, [left, top, right, bottom]) => {
  const part = visiblePart(picture, box, fit);
  [part.left, part.top, part.right, part.bottom].forEach((edge, i) =>
    expect(edge).toBeCloseTo([left, top, right, bottom][i] ?? NaN, 9));
});

test('a corner of the box is a corner of what is visible', () => {
  const picture = size(441, 958);
  const box = size(412, 915);
  const { left, top, right, bottom } = visiblePart(picture, box, 'cover');
  const [x = NaN, y = NaN] = placeInPicture(picture, box, 'cover', 0, 0) ?? [];
  expect(x).toBeCloseTo(left, 9);
  expect(y).toBeCloseTo(top, 9);
  const [x1 = NaN, y1 = NaN] = placeInPicture(picture, box, 'cover', 412, 915) ?? [];
  expect(x1).toBeCloseTo(right, 9);
  expect(y1).toBeCloseTo(bottom, 9);
});

test('the bars beside a picture are not the picture', () => {
  const place = (x: number): unknown => placeInPicture(size(100, 200), size(100, 100), 'contain', x, 50);
  expect(place(50)).toEqual([0.5, 0.5]);
  expect(place(24)).toBeNull();
  expect(place(76)).toBeNull();
});

test.each(['contain', 'cover'] as const)('a place in a picture and in its box, %s: there and back', (fit) => {
  const picture = { width: 300, height: 600 };
  const box = { width: 412, height: 700 };
  const [x_px, y_px] = placeInBox(picture, box, fit, 0.4, 0.55, [0, 0]);
  const back = placeInPicture(picture, box, fit, x_px, y_px);
  expect(back?.[0]).toBeCloseTo(0.4, 9);
  expect(back?.[1]).toBeCloseTo(0.55, 9);
});
