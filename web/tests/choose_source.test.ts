import { expect, test } from 'vitest';
import { chooseSource, NoSuchSource } from '../src/choose_source';

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

test('what is not there is said', () => {
  expect(() => chooseSource(asks('source=replay&recording=x'), ['desk'], false))
    .toThrow(NoSuchSource);
  expect(() => chooseSource(asks('source=replay'), [], false)).toThrow('peaking demo SCENE');
  expect(() => chooseSource(asks('source=lidar'), [], false)).toThrow('virtual, webxr or replay');
});
