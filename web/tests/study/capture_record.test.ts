import { expect, test, vi } from 'vitest';

import type { CapturedView } from '../../src/capture/capture_session';
import type { Camera } from '../../src/geometry';
import { Api, ApiError } from '../../src/server/api';
import { CaptureRecord, type Moment } from '../../src/study/capture_record';
import { Outbox, sendLeftovers } from '../../src/study/outbox';
import { ParticipantApi } from '../../src/study/study_api';
import type { Told } from '../../src/study/wire';
import { MapStorage } from './support';

const CAMERA = { worldFromCam: { rows: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0] } } as unknown as Camera;

function recordOf(before: readonly string[] = [], gone_s: number | null = null) {
  const told: Told[] = [];
  let n = 0;
  const record = new CaptureRecord({
    step: 't1.capture', session: 's', put: (event) => told.push(event), before, gone_s,
    newId: () => `id-${n++}`,
  });
  return { record, told, kinds: () => told.map((event) => event.kind) };
}

function moment(now_s: number, more: Partial<Moment> = {}): Moment {
  return {
    now_s, canShoot: true, camera: CAMERA, peakedShare: 0.5, wrongShare: 0.4, unseenShare: 0.1,
    unfixableShare: 0.05, views: 0, ...more,
  };
}

function view(id: string, time_s: number): CapturedView {
  return { id, time_s, camera: { world_from_cam: [1] } } as unknown as CapturedView;
}

test('the time begins with the first picture in which the shutter works', () => {
  const { record, told, kinds } = recordOf();
  record.see(moment(1, { canShoot: false }));
  expect(told).toEqual([]);
  record.see(moment(2));
  record.end(9);
  record.end(10);
  record.see(moment(11));
  expect(kinds()).toEqual(['CaptureBegun', 'PeakedTold', 'CaptureEnded']);
  expect(told.map((event) => event.time_s)).toEqual([2, 2, 9]);
});

test('the peaked share is told about once a second', () => {
  const { record, told } = recordOf();
  for (let i = 0; i <= 30; i += 1) record.see(moment(i / 10));
  const samples = told.filter((event) => event.kind === 'PeakedTold');
  expect(samples.map((event) => event.time_s)).toEqual([0, 1, 2, 3]);
  expect(samples[0]).toMatchObject({
    peaked_share: 0.5, wrong_share: 0.4, unseen_share: 0.1, unfixable_share: 0.05,
  });
});

test('tracking that is lost for long enough is told with when it began', () => {
  const { record, told } = recordOf();
  record.see(moment(0));
  record.see(moment(1, { camera: null }));
  record.see(moment(1.1));
  record.see(moment(2, { camera: null }));
  record.see(moment(2.4, { camera: null }));
  record.see(moment(5));
  const lost = told.filter((event) => event.kind.startsWith('Tracking'));
  expect(lost.map((event) => [event.kind, event.time_s]))
    .toEqual([['TrackingLost', 2], ['TrackingFound', 5]]);
});

test('views are told once, with ids that follow from them', () => {
  const { record, told } = recordOf(['old']);
  record.follow([view('old', 0), view('a', 3)], 3);
  record.follow([view('old', 0), view('a', 3)], 4);
  record.joined([{ id: 'a', times: { drawn: 5000, acknowledged: 4000, ready: 4500 } }], 100);
  record.joined([{ id: 'a', times: { drawn: 5000 } }], 100);
  record.follow([view('old', 0)], 7);
  expect(told.map((event) => [event.kind, event.id, event.time_s])).toEqual([
    ['ViewTaken', 'a-taken', 3], ['ViewJoined', 'a-joined', 105], ['ViewUndone', 'a-undone', 7],
  ]);
  expect(told[1]).toMatchObject({ acknowledged_s: 104, generated_s: 104.5 });
});

test('after a reload the time does not begin again: the page was gone meanwhile', () => {
  const { record, told } = recordOf(['a'], 50);
  record.see(moment(57));
  expect(told[0]).toMatchObject({ kind: 'PageGone', time_s: 50, until_s: 57 });
  expect(told.map((event) => event.kind)).not.toContain('CaptureBegun');
});

const EVENT: Told = { kind: 'CaptureBegun', id: 'a', step: 't1.capture', time_s: 1 };

test('what is told survives a reload without a server', async () => {
  const storage = new MapStorage();
  const offline = new Outbox('box', () => Promise.reject(new ApiError(0, 'no answer')), storage);
  offline.put(EVENT);
  await expect(offline.flush()).rejects.toThrow('no answer');
  const sent: Told[] = [];
  const online = new Outbox('box', async (events) => void sent.push(...events), storage);
  await online.flush();
  expect(sent).toEqual([EVENT]);
  expect(storage.values.size).toBe(0);
});

test('what the server will never take does not keep the rest from it', async () => {
  const sent: Told[] = [];
  const box = new Outbox('box', async (events) => {
    if (events.some((event) => event.id === 'bad')) throw new ApiError(400, 'wrong');
    sent.push(...events);
  }, new MapStorage());
  box.put({ ...EVENT, id: 'bad' });
  await box.flush();
  box.put(EVENT);
  await box.flush();
  expect(sent).toEqual([EVENT]);
});

test.each([404, 409, 410])('what nobody takes any more (%i) does not stay on the phone', async (status) => {
  const storage = new MapStorage();
  const box = new Outbox('box', () => Promise.reject(new ApiError(status, 'gone')), storage);
  box.put(EVENT);
  await box.flush();
  expect(storage.values.size).toBe(0);
});

test.each([0, 403, 500])('what may be taken later (%i) is sent less and less often', async (status) => {
  const storage = new MapStorage();
  const waits_ms: number[] = [];
  const end = new AbortController();
  const box = new Outbox('box', () => Promise.reject(new ApiError(status, 'not now')), storage);
  box.put(EVENT);
  await box.run({
    random: () => 1,
    sleep: async (duration_ms) => { if (waits_ms.push(duration_ms) === 8) end.abort(); },
  }, end.signal);
  expect(waits_ms).toEqual([1000, 1000, 2000, 4000, 8000, 16_000, 30_000, 30_000]);
  expect(storage.values.size).toBe(1);
});

test('what is of a participant whose phone this no longer is does not stay on it', async () => {
  const kept: Record<string, string> = {};
  const box = (participant: string): void => {
    kept[`peaking.study.outbox.${participant}.s`] = JSON.stringify([EVENT]);
  };
  for (const participant of ['P01', 'P02', 'P03']) box(participant);
  const methods = {
    getItem: (key: string) => kept[key] ?? null,
    setItem: (key: string, value: string) => { kept[key] = value; },
    removeItem: (key: string) => { delete kept[key]; },
  };
  vi.stubGlobal('localStorage', new Proxy(kept, {
    get: (_, name) => methods[name as keyof typeof methods],
  }));
  const asked: string[] = [];
  const fetch = (input: RequestInfo | URL): Promise<Response> => {
    const [, participant = ''] = /participants\/(P\d+)/.exec(String(input)) ?? [];
    asked.push(participant);
    return Promise.resolve(new Response(null, { status: participant === 'P03' ? 204 : 403 }));
  };
  sendLeftovers(new ParticipantApi(new Api('http://server', { fetch }), 'P02'));
  await vi.waitFor(() => expect(Object.keys(kept)).toEqual(['peaking.study.outbox.P02.s']));
  expect(new Set(asked)).toEqual(new Set(['P01', 'P02', 'P03']));
  vi.unstubAllGlobals();
});
