import { describe, expect, test } from 'vitest';
import { actionOfKey, type PressedKey } from '../../src/ui/keys';

function pressed(key: string, how: Partial<PressedKey> = {}): PressedKey {
  return { key, repeat: false, altKey: false, metaKey: false, ctrlKey: false, ...how };
}

test.each([
  [' ', { kind: 'shoot' }],
  ['AudioVolumeUp', { kind: 'shoot' }],
  ['VolumeUp', { kind: 'shoot' }],
  ['z', { kind: 'undo' }],
  ['Z', { kind: 'undo' }],
  ['1', { kind: 'look', overlay: 'mpi' }],
  ['2', { kind: 'look', overlay: 'video' }],
  ['3', { kind: 'look', overlay: 'peaks' }],
  ['f', { kind: 'finish' }],
  ['?', { kind: 'help' }],
  [',', { kind: 'step', frames: -1 }],
  ['.', { kind: 'step', frames: 1 }],
  ['Escape', { kind: 'close' }],
  ['w', null], // walks: the virtual phone's
  ['Enter', null],
  ['4', null],
])('%s', (key, action) => {
  expect(actionOfKey(pressed(key), false)).toEqual(action);
});

describe('left to others', () => {
  test('a button has the focus: space presses it, other keys are ours', () => {
    expect(actionOfKey(pressed(' '), false, true)).toBeNull();
    expect(actionOfKey(pressed('z'), false, true)).toEqual({ kind: 'undo' });
    expect(actionOfKey(pressed('Escape'), false, true)).toEqual({ kind: 'close' });
  });

  test('a name is typed: only Escape is ours', () => {
    for (const key of [' ', 'z', 'f', '1', '.']) {
      expect(actionOfKey(pressed(key), true)).toBeNull();
    }
    expect(actionOfKey(pressed('Escape'), true)).toEqual({ kind: 'close' });
  });

  test('a key that is held takes one view, not many', () => {
    expect(actionOfKey(pressed(' ', { repeat: true }), false)).toBeNull();
  });

  test('the browser\'s own shortcuts; Ctrl-Z is undo everywhere', () => {
    expect(actionOfKey(pressed('f', { ctrlKey: true }), false)).toBeNull();
    expect(actionOfKey(pressed('1', { altKey: true }), false)).toBeNull();
    expect(actionOfKey(pressed('z', { metaKey: true }), false)).toBeNull();
    expect(actionOfKey(pressed('z', { ctrlKey: true }), false)).toEqual({ kind: 'undo' });
  });
});
