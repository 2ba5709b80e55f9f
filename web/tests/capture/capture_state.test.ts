import { expect, test } from 'vitest';

import type { StoredCapture } from '../../src/capture/capture_db';
import { NOTHING_KNOWN, reduce, restorableOf, risenOf, viewsOf } from '../../src/capture/capture_state';
import { PeakedReporter } from '../../src/capture/peaked_reporter';
import { thumbnailSize } from '../../src/capture/thumbnail';
import { wireOfCamera } from '../../src/geometry';
import type { Capture, PeakedSample } from '../../src/wire';
import { photo } from './support';

const camera = wireOfCamera(photo(0).camera);
const remote = (id: string, change: Partial<Capture> = {}): Capture =>
  ({ id, number: 1, camera, time_s: 1, state: 'queued', ...change });
const local = (id: string, change: Partial<StoredCapture> = {}): StoredCapture => ({
  id, sessionId: 's', order: 1, camera, time_s: 1, state: 'waiting', attempts: 0, problem: null,
  ...change,
});
const known = (locals: readonly StoredCapture[], remotes: readonly Capture[]) =>
  remotes.reduce((state, capture) => reduce(state, { type: 'CaptureChanged', capture }),
    reduce(NOTHING_KNOWN, { type: 'LocalsRead', locals }));
const listed = (state: typeof NOTHING_KNOWN): string[] =>
  viewsOf(state, String).map((view) => `${view.id} ${view.state}`);

test('both lists become one, in the order of time', () => {
  const state = known(
    [local('b', { time_s: 2 }), local('c', { time_s: 3, state: 'failed', problem: 'no' })],
    [remote('a', { time_s: 1, state: 'ready' })]);
  expect(listed(state)).toEqual(['a ready', 'b waiting', 'c failed']);
  const sending = reduce(state, { type: 'Uploading', id: 'b' });
  expect(listed(sending)).toEqual(['a ready', 'b uploading', 'c failed']);
});

test('what is undone on either side is not listed', () => {
  const state = known([local('a', { state: 'removing' }), local('b', { state: 'stored' })],
    [remote('a'), remote('b', { removed: true })]);
  expect(listed(state)).toEqual([]);
});

test('what was set aside is told from what was undone', () => {
  const away = { removed: true, restorable: true } as const;
  const state = known([local('a', { state: 'stored' })], [
    remote('a', { ...away, ending: 'set_aside' }), remote('b', { ...away, ending: 'undone', time_s: 2 }),
  ]);
  expect(listed(state)).toEqual([]);
  expect(restorableOf(state, String).map(({ id, setAside }) => [id, setAside])).toEqual([['a', true], ['b', false]]);
});

test('a reply that is overtaken by its event does not take "ready" back', () => {
  const state = known([], [remote('a', { state: 'ready' })]);
  const after = reduce(state, { type: 'Answered', capture: remote('a') });
  expect(listed(after)).toEqual(['a ready']);
});

test('an undone capture that is alive on the server has risen', () => {
  const state = known([local('a', { state: 'removed' }), local('b', { state: 'removing' })],
    [remote('a'), remote('b'), remote('c')]);
  expect(risenOf(state)).toEqual(['a']);
});

test('at most one sample a second goes out, three to a request, none offline', async () => {
  const sent: number[][] = [];
  let online = true;
  const reporter = new PeakedReporter((samples) => {
    sent.push(samples.map(({ time_s }) => time_s));
    return Promise.reject(new Error('lost'));
  }, () => online);
  const sample = (time_s: number): PeakedSample =>
    ({ time_s, peaked_share: 0, views: 0, world_from_cam: [] });
  for (let i = 0; i < 40; i++) reporter.report(sample(100 + i / 10));
  expect(sent).toEqual([[100, 101, 102]]);
  online = false;
  for (let i = 0; i < 9; i++) reporter.report(sample(200 + i));
  online = true;
  for (let i = 0; i < 3; i++) reporter.report(sample(300 + i));
  expect(sent).toEqual([[100, 101, 102], [300, 301, 302]]);
});

test('a thumbnail has the aspect of its photo', () => {
  expect(thumbnailSize(886, 1920)).toEqual({ width_px: 120, height_px: 260 });
  expect(thumbnailSize(100, 50)).toEqual({ width_px: 100, height_px: 50 });
});
