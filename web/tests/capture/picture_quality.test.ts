import { expect, test } from 'vitest';
import { PictureMeter, type PictureQuality } from '../../src/capture/picture_quality';

const WIDTH = 64;
const HEIGHT = 48;

/** `floor(128 + 90 sin(x / 3 + y / 7) + 30 sin(x y / 40))`, as grey. */
function picture(scale = 1): Uint8Array {
  const rgba = new Uint8Array(4 * WIDTH * HEIGHT);
  for (let y = 0; y < HEIGHT; y += 1) {
    for (let x = 0; x < WIDTH; x += 1) {
      const value = Math.floor(128 + 90 * Math.sin(x / 3 + y / 7) + 30 * Math.sin((x * y) / 40));
      rgba.fill(Math.floor(scale * value), 4 * (y * WIDTH + x), 4 * (y * WIDTH + x) + 4);
    }
  }
  return rgba;
}

function movedAlongX(rgba: Uint8Array, by_px: number): Uint8Array {
  return rgba.map((_, at) => {
    let sum = 0;
    for (let k = 0; k < by_px; k += 1) sum += rgba[Math.min(at + 4 * k, rgba.length - 4 + (at % 4))] ?? 0;
    return sum / by_px;
  });
}

function measure(rgba: Uint8Array): PictureQuality {
  return new PictureMeter().measure(rgba, WIDTH, HEIGHT);
}

test('sharpness is what the choice of frames calls so', () => {
  // peaking.selection.blur.sharpness of the same picture.
  expect(measure(picture()).sharpness).toBeCloseTo(0.4856, 3);
});

test('blur takes it away, and so little does darkness', () => {
  const { sharpness } = measure(picture());
  expect(measure(movedAlongX(picture(), 7)).sharpness).toBeLessThan(0.6 * sharpness);
  expect(measure(picture(0.5)).sharpness).toBeGreaterThan(0.9 * sharpness);
});

test('tells dark from burnt out', () => {
  const white = new Uint8Array(4 * WIDTH * HEIGHT).fill(255);
  expect(measure(white)).toMatchObject({ grey: expect.closeTo(255, 3), burntOut: 1 });
  white.fill(20, 0, white.length / 2);
  expect(measure(white)).toMatchObject({ grey: expect.closeTo(137.5, 3), burntOut: 0.5 });
});

test('pictures of one pixel and of another size can be measured', () => {
  const meter = new PictureMeter();
  expect(meter.measure(new Uint8Array([9, 9, 9, 255]), 1, 1)).toEqual({ sharpness: 0, grey: expect.closeTo(9, 3), burntOut: 0 });
  expect(meter.measure(picture(), WIDTH, HEIGHT)).toEqual(measure(picture()));
});
