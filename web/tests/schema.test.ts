import { describe, expect, test } from 'vitest';
import {
  dictionary, flag, integer, list, nullable, number, oneOf, optional, parseJson, parseKept, record,
  tagged, text, union, type Schema,
} from '../src/schema';
import {
  captureSchema, optionsSchema, sessionEventSchema, type Capture, type Options,
} from '../src/wire';

interface Small { readonly size: number; readonly name?: string; readonly tags: readonly string[] }

const small = record<Small>({ size: integer(1, 9), name: optional(text), tags: list(text, 0, 2) });

function problemOf(schema: Schema<unknown>, value: unknown): string {
  try {
    schema(value, '');
  } catch (error) {
    return (error as Error).message;
  }
  return '';
}

describe('by hand', () => {
  test('what fits is handed on as it is, with fields that nobody knows', () => {
    const value = { size: 3, tags: ['a'], more: 1 };
    expect(small(value, '')).toBe(value);
  });

  test.each<[unknown, string]>([
    [{ size: 3, tags: ['a', 4] }, 'tags[1]: need a text, got 4'],
    [{ size: 3 }, 'tags: need a list, got undefined'],
    [{ size: 10, tags: [] }, 'size: need a whole number from 1 to 9, got 10'],
    [{ size: 1.5, tags: [] }, 'size: need a whole number from 1 to 9, got 1.5'],
    [{ size: 1, tags: ['a', 'b', 'c'] }, 'tags: need a list, got a list'],
    [{ size: 1, tags: [], name: null }, 'name: need a text, got null'],
    [[], 'need an object, got a list'],
    [null, 'need an object, got null'],
  ])('%j is refused with the place', (value, says) => {
    expect(problemOf(small, value)).toBe(says);
  });

  test('numbers, words, and one of several', () => {
    expect(problemOf(number(0, 1), 1.1)).toBe('need a number from 0 to 1, got 1.1');
    expect(problemOf(number(0), -1)).toContain('of at least 0');
    for (const value of [NaN, Infinity, '1', null]) expect(problemOf(number(), value)).not.toBe('');
    expect(problemOf(oneOf('a', 'b'), 'c')).toBe('need one of a, b, got "c"');
    expect(problemOf(flag, 1)).not.toBe('');
    const either = nullable(union(number(), list(text)));
    for (const value of [null, 3, ['x']]) expect(problemOf(either, value)).toBe('');
    expect(problemOf(either, [3])).not.toBe('');
    expect(problemOf(dictionary(number()), { a: 1, b: 'x' })).toContain('b: need a number');
  });

  test('kept by another version, or not JSON at all', () => {
    expect(() => parseJson(text, '<p>')).toThrow('not JSON');
    expect(parseKept(text, '<p>')).toBeNull();
    expect(parseKept(text, '3')).toBeNull();
    expect(parseKept(text, null)).toBeNull();
    expect(parseKept(text, '"x"')).toBe('x');
  });

  test('records are told apart by their type', () => {
    type Either = { type: 'A'; a: number } | { type: 'B'; b: string };
    const either = tagged<Either>({
      A: record({ type: oneOf('A'), a: number() }), B: record({ type: oneOf('B'), b: text }),
    });
    expect(problemOf(either, { type: 'A', a: 1 })).toBe('');
    expect(problemOf(either, { type: 'A', b: 'x' })).toContain('a: need a number');
    expect(problemOf(either, { type: 'C' })).toBe('type: need one of A, B, got "C"');
  });
});

describe('of the wire', () => {
  const capture: Capture = {
    id: 'c', number: 1, time_s: 0, state: 'queued',
    camera: {
      pinhole: { width_px: 1, height_px: 1, fx_px: 1, fy_px: 1, cx_px: 0, cy_px: 0 },
      world_from_cam: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0],
    },
  };

  test('a pose of eleven numbers does not come in', () => {
    expect(problemOf(captureSchema, capture)).toBe('');
    const camera = { ...capture.camera, world_from_cam: Array.from({ length: 11 }, () => 0) };
    expect(problemOf(captureSchema, { ...capture, camera }))
      .toBe('camera.world_from_cam: need a list of 12, got a list');
  });

  test('more neighbours than can be blended do not come in', () => {
    const options: Options = {
      pixels: 1, num_planes: 1, neighbours: 9, align: 'off', blend_weights: 'paper',
      opacity: 'seen', filling_views: 3, error_threshold: 1, shift_px: 0, compensate_exposure: false, marks: 'paper', generator: 'layered',
    };
    expect(problemOf(optionsSchema, options)).toContain('neighbours: need a whole number from 1 to 8');
  });

  test('of an event the place of the fault is named', () => {
    const event = { type: 'CaptureChanged', capture: { ...capture, state: 'lost' } };
    expect(problemOf(sessionEventSchema, event))
      .toBe('capture.state: need one of failed, queued, ready, got "lost"');
  });
});
