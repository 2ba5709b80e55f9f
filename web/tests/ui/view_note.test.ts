import { expect, test } from 'vitest';
import { viewNote } from '../../src/ui/sheets';

const QUEUED = { state: 'queued', problem: null, generator: null, guessed: false } as const;
const READY = { ...QUEUED, state: 'ready', generator: 'layered' } as const;

test('before there is an MPI the state stands alone', () => {
  expect(viewNote({ ...QUEUED, state: 'waiting' })).toBe('waiting to upload');
  expect(viewNote(QUEUED)).toBe('processing');
});

test('it says who made what is shown', () => {
  expect(viewNote(READY)).toBe('ready · made by layered');
  expect(viewNote({ ...READY, generator: 'adampi' }))
    .toBe('ready · made by adampi');
});

test('of a guessed distance it says what helps', () => {
  expect(viewNote({ ...READY, guessed: true })).toBe(
    'ready · made by layered · distance is a guess: take another view nearby');
});

test('a problem stands alone while there is no MPI, and last when no better one was made', () => {
  expect(viewNote({ ...QUEUED, state: 'failed', problem: 'The disk is full.' })).toBe('The disk is full.');
  expect(viewNote({ ...READY, problem: 'The graphics card has no room.' })).toBe(
    'ready · made by layered · The graphics card has no room.');
});
