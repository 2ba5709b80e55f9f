import { describe, expect, test } from 'vitest';
import { depthMapOf, known, type DepthFormat, type RawDepth } from '../../src/sources/depth';

/** Column-major: u' = a·u + c·v + e, v' = b·u + d·v + f. */
function matrix(a: number, b: number, c: number, d: number, e: number, f: number): Float32Array {
  return Float32Array.of(a, b, 0, 0, c, d, 0, 0, 0, 0, 1, 0, e, f, 0, 1);
}

const AS_IT_IS = matrix(1, 0, 0, 1, 0, 0);

function rawOf(
  width: number, values: readonly number[], as: DepthFormat, how: Partial<RawDepth> & {
    readonly turned?: Float32Array } = {},
): RawDepth {
  const data = as === 'float32' ? Float32Array.from(values).buffer : Uint16Array.from(values).buffer;
  const { turned = AS_IT_IS, ...rest } = how;
  return {
    width, height: values.length / width, data, rawValueToMeters: 0.001,
    normDepthBufferFromNormView: { matrix: turned }, ...rest,
  };
}

/** Rows of the map. */
function rowsOf(raw: RawDepth, format: DepthFormat, aspect: number): number[][] {
  const map = depthMapOf(raw, format, aspect);
  return Array.from({ length: map.height_px }, (_, y) =>
    Array.from(map.depth_mm.subarray(y * map.width_px, (y + 1) * map.width_px)));
}

/** Three beside each other, two below each other. */
const BUFFER = [
  100, 200, 300,
  400, 500, 600,
] as const;

describe('how the buffer lies in the picture', () => {
  test('as it is', () => {
    expect(rowsOf(rawOf(3, BUFFER, 'unsigned-short'), 'unsigned-short', 3 / 2))
      .toEqual([[100, 200, 300], [400, 500, 600]]);
  });

  test('a quarter turn, as ARCore has it: its x runs down the picture, its y to the left', () => {
    const turned = matrix(0, -1, 1, 0, 0, 1);
    expect(rowsOf(rawOf(3, BUFFER, 'unsigned-short', { turned }), 'unsigned-short', 2 / 3))
      .toEqual([[400, 100], [500, 200], [600, 300]]);
  });

  test('the other quarter turn', () => {
    const turned = matrix(0, 1, -1, 0, 1, 0);
    expect(rowsOf(rawOf(3, BUFFER, 'unsigned-short', { turned }), 'unsigned-short', 2 / 3))
      .toEqual([[300, 600], [200, 500], [100, 400]]);
  });

  test('upside down', () => {
    const turned = matrix(-1, 0, 0, -1, 1, 1);
    expect(rowsOf(rawOf(3, BUFFER, 'unsigned-short', { turned }), 'unsigned-short', 3 / 2))
      .toEqual([[600, 500, 400], [300, 200, 100]]);
  });

  test('the picture shows its middle half only: as many texels as are in it', () => {
    const four = [1, 2, 3, 4, 5, 6, 7, 8];
    const cropped = matrix(0.5, 0, 0, 1, 0.25, 0);
    expect(rowsOf(rawOf(4, four, 'unsigned-short', { turned: cropped }), 'unsigned-short', 1))
      .toEqual([[2, 3], [6, 7]]);
  });

  test('turned and cropped at once', () => {
    const turned = matrix(0, -0.5, 1, 0, 0, 0.75);
    const four = [1, 2, 3, 4, 5, 6, 7, 8]; // two beside each other, four below each other
    expect(rowsOf(rawOf(2, four, 'unsigned-short', { turned }), 'unsigned-short', 1))
      .toEqual([[5, 3], [6, 4]]);
  });

  test('where the picture is wider than the buffer nothing is known', () => {
    const wider = matrix(2, 0, 0, 1, -0.5, 0);
    expect(rowsOf(rawOf(2, [7, 8], 'unsigned-short', { turned: wider }), 'unsigned-short', 4))
      .toEqual([[0, 7, 8, 0]]);
  });
});

describe('formats', () => {
  test('luminance-alpha is 16 bits, the low byte first', () => {
    const raw = { ...rawOf(1, [0], 'luminance-alpha'), data: Uint8Array.of(0xe8, 0x03).buffer };
    expect(rowsOf(raw, 'luminance-alpha', 1)).toEqual([[1000]]);
  });

  test('float32 in metres', () => {
    const raw = rawOf(2, [1.25, 0.4996], 'float32', { rawValueToMeters: 1 });
    expect(rowsOf(raw, 'float32', 2)).toEqual([[1250, 500]]);
  });

  test('a unit of the device', () => {
    const raw = rawOf(2, [1000, 3], 'unsigned-short', { rawValueToMeters: 0.0005 });
    expect(rowsOf(raw, 'unsigned-short', 2)).toEqual([[500, 2]]);
  });

  test('what is no distance is unknown', () => {
    const values = [NaN, Infinity, -1, 0, 65.536, 65.535, 65.534];
    const raw = rawOf(7, values, 'float32', { rawValueToMeters: 1 });
    expect(rowsOf(raw, 'float32', 7)).toEqual([[0, 0, 0, 0, 0, 0, 65534]]);
  });

  test('the largest number of 16 bits is no distance, whatever the unit', () => {
    const raw = rawOf(2, [65535, 65534], 'unsigned-short', { rawValueToMeters: 0.0005 });
    expect(rowsOf(raw, 'unsigned-short', 2)).toEqual([[0, 32767]]);
  });

  test('where nothing is known there is no depth', () => {
    const unknown = depthMapOf(rawOf(2, [0, 65535], 'unsigned-short'), 'unsigned-short', 2);
    const one = depthMapOf(rawOf(2, [0, 700], 'unsigned-short'), 'unsigned-short', 2);
    expect([known(unknown), known(one)]).toEqual([null, one]);
  });
});
