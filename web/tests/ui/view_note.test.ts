import { expect, test } from 'vitest';
import { viewNote } from '../../src/ui/sheets';

const QUEUED = { state: 'queued', problem: null, generator: null, guessed: false } as const;
const READY = { ...QUEUED, state: 'ready', generator: 'layered' } as const;

test('before there is an MPI the state stands alone', () => {
  expect(viewNote({ ...QUEUED, state: 'waiting' })).toBe('on this device, waiting for the server');
  expect(viewNote(QUEUED)).toBe('on the server, its planes are being made');
});

test('it says who made what is shown', () => {
  expect(viewNote(READY)).toBe('on the server, part of the picture · made by layered');
  expect(viewNote({ ...READY, generator: 'adampi' }))
    .toBe('on the server, part of the picture · made by adampi');
});

test('of a guessed distance it says what helps', () => {
  expect(viewNote({ ...READY, guessed: true })).toBe(
    'on the server, part of the picture · made by layered · distance guessed: take a view beside it');
});

test('a problem stands alone while there is no MPI, and last when no better one was made', () => {
  expect(viewNote({ ...QUEUED, state: 'failed', problem: 'The disk is full.' })).toBe('The disk is full.');
  expect(viewNote({ ...READY, problem: 'The graphics card has no room.' })).toBe(
    'on the server, part of the picture · made by layered · The graphics card has no room.');
});
