import { expect, test } from 'vitest';

import { Api, ApiError } from '../../src/server/api';
import { EventStreamReader } from '../../src/server/event_stream';
import { sessionEvents, type Connection } from '../../src/server/events';
import { deviceName } from '../../src/server/this_device';
import { PROTOCOL, type SessionEvent, type SessionSummary } from '../../src/wire';
import { problem } from '../capture/model_server';
import { ModelClock, settle } from '../capture/support';

interface Asked { url: string; init: RequestInit }

function apiThat(answer: (asked: Asked) => Response | Promise<Response>): [Api, Asked[]] {
  const asked: Asked[] = [];
  const fake = async (url: RequestInfo | URL, init: RequestInit = {}): Promise<Response> => {
    const one = { url: String(url), init };
    asked.push(one);
    return answer(one);
  };
  return [new Api('http://server', { fetch: fake, timeout_ms: 50 }), asked];
}

const page = (hash: string) => {
  const shown: string[] = [];
  return {
    shown,
    location: { hash, pathname: '/', search: '?source=virtual' },
    history: {
      replaceState: (_data: unknown, _title: string, url?: string | URL | null) =>
        void shown.push(String(url)),
    },
  };
};

const device = { id: '0f0f0f0f-0000-4000-8000-000000000001', name: 'Chrome on Pixel 9' };

test('the code of the link pairs once and leaves the address bar', async () => {
  const [api, asked] = apiThat(() => json({ device: 'd', role: 'device', credential: null }));
  const shown = page('#code=se%2Bcret&view=2');
  expect(await api.pairFromHash(shown, device)).toBe(true);
  expect(asked[0]?.url).toBe('http://server/api/v1/pair');
  expect(asked[0]?.init.method).toBe('POST');
  expect(JSON.parse(String(asked[0]?.init.body))).toEqual({
    protocol: PROTOCOL, code: 'se+cret', device: device.id, name: device.name, cookie: true,
  });
  expect(shown.shown).toEqual(['/?source=virtual#view=2']);
  expect(await api.pairFromHash(page(''), device)).toBe(false);
  expect(asked).toHaveLength(1);
});

test('a browser that is paired already goes on with a link that is used up', async () => {
  const [api] = apiThat(({ url }) => url.endsWith('/pair') ? problem(401, 'used') : json({}));
  const shown = page('#code=x');
  expect(await api.pairFromHash(shown, device)).toBe(false);
  expect(shown.shown).toEqual(['/?source=virtual']);
});

test('a data set is asked for by views and format', () => {
  const [api] = apiThat(() => json({}));
  const address = 'http://server/api/v1/sessions/c0ffee00/dataset.zip';
  expect(api.datasetUrl('c0ffee00')).toBe(address);
  expect(api.datasetUrl('c0ffee00', { format: 'nerfstudio', views: null })).toBe(address);
  expect(api.datasetUrl('c0ffee00', { views: 'auto' })).toBe(`${address}?views=auto`);
  expect(api.datasetUrl('c0ffee00', { views: 7, format: 'tum' })).toBe(`${address}?views=7&format=tum`);
});

test('a device is called what its owner calls it', () => {
  const pixel = 'Mozilla/5.0 (Linux; Android 15; Pixel 9) AppleWebKit/537.36 Chrome/147.0 Mobile';
  expect(deviceName(pixel)).toBe('Chrome on Pixel 9');
  expect(deviceName(pixel.replace('Pixel 9', 'K'))).toBe('Chrome on an Android phone');
  expect(deviceName('Mozilla/5.0 (X11; Linux x86_64; rv:140.0) Firefox/140.0'))
    .toBe('Firefox on a Linux computer');
  expect(deviceName('')).toBe('A browser on another device');
});

test('a wrong code leaves the address bar too; without an answer it stays', async () => {
  const [refusing] = apiThat(() => new Response('', { status: 401 }));
  const shown = page('#code=x');
  await expect(refusing.pairFromHash(shown, device)).rejects.toMatchObject({ status: 401 });
  expect(shown.shown).toEqual(['/?source=virtual']);
  const [silent] = apiThat(() => { throw new TypeError('Failed to fetch'); });
  const kept = page('#code=x');
  await expect(silent.pairFromHash(kept, device)).rejects.toMatchObject({ status: 0 });
  expect(kept.shown).toEqual([]);
});

test('a server with another protocol is refused with a sentence', async () => {
  const [api] = apiThat(() => json({ protocol: PROTOCOL + 1, all_else: 'is different' }));
  const versions = new RegExp(`version ${PROTOCOL + 1} of the protocol.*version ${PROTOCOL}`);
  await expect(api.server()).rejects.toThrow(versions);
});

test('refusals carry the sentence and the time to wait', async () => {
  const [api] = apiThat(() => problem(503, 'busy', { 'Retry-After': '3' }));
  await expect(api.session('s')).rejects.toEqual(new ApiError(503, 'busy', 3));
  await expect(api.session('s')).rejects.toMatchObject({ status: 503, retryAfter_s: 3 });
});

test('no answer in time is an error without a status', async () => {
  const [api] = apiThat(({ init }) => new Promise((_resolve, reject) =>
    init.signal?.addEventListener('abort', () => reject(init.signal?.reason))));
  await expect(api.session('s')).rejects.toMatchObject({ status: 0 });
});

test('ids never become a path', () => {
  const [api] = apiThat(() => new Response());
  expect(api.thumbnailUrl('../x', 'a?b')).toBe(
    'http://server/api/v1/sessions/..%2Fx/captures/a%3Fb/thumbnail');
});

test('an upload is acknowledged only by an answer to it', async () => {
  const pinhole = { width_px: 1, height_px: 1, fx_px: 1, fy_px: 1, cx_px: 0, cy_px: 0 };
  const camera = { pinhole, world_from_cam: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0] };
  const stored = { id: 'c', number: 1, camera, time_s: 0, state: 'queued' };
  const [api, asked] = apiThat(() => json(stored));
  expect(await api.uploadCapture('s', 'c', new Blob(['x']))).toMatchObject({ number: 1 });
  expect(asked[0]?.init.method).toBe('PUT');
  const [wrong] = apiThat(() => json({ ...stored, id: 'another' }));
  await expect(wrong.uploadCapture('s', 'c', new Blob(['x']))).rejects.toThrow('other than the peaking server');
});

test('what a login page says is not taken for the server', async () => {
  const html = { headers: { 'Content-Type': 'text/html' } };
  const [portal] = apiThat(() => new Response('<p>Welcome</p>', html));
  await expect(portal.session('s')).rejects.toThrow('other than the peaking server');
});

test('a field that is not what it should be is named', async () => {
  const [api] = apiThat(() => json({ ...SUMMARY, captures: 'many' }));
  await expect(api.changeSession('s', {})).rejects.toThrow(
    'captures: need a whole number, got "many"');
  const info = { protocol: PROTOCOL, options: { neighbours: 9 } };
  const [other] = apiThat(() => json(info));
  await expect(other.server()).rejects.toMatchObject({ status: 0 });
});

test.each([1, 2, 3, 7, 100])('events are read from pieces of %i characters', (size) => {
  const text = ': ping\n\ndata: one\n\nid: 4\r\ndata:two\r\ndata: lines\r\n\r\ndata: cut off';
  const reader = new EventStreamReader();
  const events: string[] = [];
  for (let i = 0; i < text.length; i += size) events.push(...reader.push(text.slice(i, i + size)));
  expect(events).toEqual(['one', 'two\nlines']);
});

const SUMMARY: SessionSummary = {
  id: 's', name: 'desk', folder: 'f', source: 'virtual', device: '', created_s: 0, finished: false,
  captures: 0, ready: 0, peaked_share: null, live: true,
};

function renamed(name: string): SessionEvent {
  return { type: 'SessionChanged', summary: { ...SUMMARY, name } };
}

function dataOf(event: object): string {
  return `data: ${JSON.stringify(event)}\n\n`;
}

function json(value: unknown): Response {
  return new Response(JSON.stringify(value), { headers: { 'Content-Type': 'application/json' } });
}

function stream(): { response: Response; send(text: string): void; fail(): void } {
  let control: ReadableStreamDefaultController<Uint8Array> | null = null;
  const body = new ReadableStream<Uint8Array>({ start: (given) => { control = given; } });
  const response = new Response(body, { headers: { 'Content-Type': 'text/event-stream' } });
  return {
    response,
    send: (text) => control?.enqueue(new TextEncoder().encode(text)),
    fail: () => control?.error(new TypeError('network error')),
  };
}

function listen(api: Api): {
  clock: ModelClock; events: SessionEvent[]; states: string[]; network: EventTarget;
  stop(): Promise<void>;
} {
  const clock = new ModelClock();
  const events: SessionEvent[] = [];
  const states: string[] = [];
  const network = new EventTarget();
  const end = new AbortController();
  const done = sessionEvents(api, 's', {
    onEvent: (event) => void events.push(event),
    onConnection: (state: Connection, refusal) =>
      void states.push(state + (refusal === null ? '' : ` ${refusal.status}`)),
  }, end.signal, { pacing: clock, network });
  return {
    clock, events, states, network,
    stop: () => { end.abort(); return done; },
  };
}

test('a broken stream is opened again, after a pause', async () => {
  const streams = [stream(), stream()];
  let opened = 0;
  const [api] = apiThat(() => streams[opened++]?.response ?? new Response('', { status: 401 }));
  const { clock, events, states, stop } = listen(api);
  streams[0]?.send(dataOf(renamed('A')));
  await settle();
  streams[0]?.fail();
  await clock.until(() => opened === 2, 1000);
  streams[1]?.send(dataOf(renamed('B')));
  await settle();
  expect(events).toEqual([renamed('A'), renamed('B')]);
  expect(states).toEqual(['connecting', 'online', 'offline', 'online']);
  streams[1]?.fail();
  await clock.until(() => states.at(-1) === 'offline 401');
  await stop();
});

test('news that this page does not understand are said, and asked for ever more rarely', async () => {
  let opened = 0;
  const [api] = apiThat(() => {
    opened += 1;
    const one = stream();
    one.send('data: {"type":"Surprise"}\n\n');
    return one.response;
  });
  const { clock, events, states, stop } = listen(api);
  await clock.until(() => opened === 6);
  expect(events).toEqual([]);
  expect(states).toContain('offline 0');
  expect(clock.now_ms).toBeGreaterThan(5000);
  await stop();
});

test('a stream that falls silent is given up; pings keep it', async () => {
  const first = stream();
  let opened = 0;
  const [api] = apiThat(() => opened++ === 0 ? first.response : stream().response);
  const { clock, states, stop } = listen(api);
  await settle();
  first.send(': ping\n\n');
  await clock.until(() => states.includes('offline'), 40_000);
  expect(clock.now_ms).toBeGreaterThanOrEqual(35_000);
  await clock.until(() => opened === 2, 1000);
  await stop();
});

test('the browser says that the network is gone: at once offline, at once back', async () => {
  let opened = 0;
  const [api] = apiThat(() => { opened++; return stream().response; });
  const { clock, states, network, stop } = listen(api);
  await settle();
  network.dispatchEvent(new Event('offline'));
  await settle();
  expect(states.at(-1)).toBe('offline');
  network.dispatchEvent(new Event('online'));
  await settle();
  expect(states.at(-1)).toBe('online');
  expect([opened, clock.now_ms]).toEqual([2, 0]);
  await stop();
});
