import { expect, test } from 'vitest';
import { chooseSource, isStandIn, NoSuchSource } from '../src/choose_source';

const asks = (query: string): URLSearchParams => new URLSearchParams(query);

test('what the address asks for comes first', () => {
  expect(chooseSource(asks('source=virtual'), ['desk'], true).kind).toBe('virtual');
  expect(chooseSource(asks('source=replay&recording=desk'), ['room', 'desk'], true))
    .toEqual({ kind: 'replay', recording: 'desk', asked: true });
});

test('otherwise what the device can do', () => {
  expect(chooseSource(asks(''), ['desk'], true).kind).toBe('webxr');
  expect(chooseSource(asks(''), ['desk'], false)).toEqual(
    { kind: 'replay', recording: 'desk', asked: false });
  expect(chooseSource(asks(''), [], false).kind).toBe('virtual');
});

test('a phone without augmented reality is told what it gets in place of its camera', () => {
  for (const recordings of [['desk'], []]) {
    expect(isStandIn(chooseSource(asks(''), recordings, false), true)).toBe(true);
    expect(isStandIn(chooseSource(asks(''), recordings, false), false)).toBe(false); // a computer
    expect(isStandIn(chooseSource(asks(''), recordings, true), true)).toBe(false);
  }
  expect(isStandIn(chooseSource(asks('source=virtual'), [], false), true)).toBe(false); // asked for
});

test('what is not there is said', () => {
  expect(() => chooseSource(asks('source=replay&recording=x'), ['desk'], false))
    .toThrow(NoSuchSource);
  expect(() => chooseSource(asks('source=replay'), [], false)).toThrow('peaking demo SCENE');
  expect(() => chooseSource(asks('source=lidar'), [], false)).toThrow('virtual, webxr or replay');
});
