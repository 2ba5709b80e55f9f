import { expect, test } from 'vitest';
import type { Api } from '../../src/server/api';
import { SessionPlace } from '../../src/view/session_place';
import type { Camera, Capture, Guidance, Options, Session, SessionSummary, Training } from '../../src/wire';

const CAMERA: Camera = {
  pinhole: { width_px: 30, height_px: 40, fx_px: 35, fy_px: 35, cx_px: 15, cy_px: 20 },
  world_from_cam: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0],
};
const SUMMARY: SessionSummary = {
  id: 'session', name: 'Kitchen', folder: '', source: 'webxr', device: '', created_s: 0, finished: false,
  captures: 0, ready: 0, peaked_share: null, live: true,
};
const TRAINING: Training = {
  state: 'running', step: 1, steps: 2, gaussians: 3, views: 4, held_out: 0, psnr_db: null, elapsed_s: 0,
  remaining_s: null, splat_version: 7, splat_format: 'spz', splat_bytes: 9, worst: [], outdated: false, problem: null,
};
const GUIDANCE: Guidance = {
  revision: 1, views: 1, score: 0, verdict: 'go on', curve: [], surface_m: [],
  next: { camera: CAMERA, reason: 'shows what is behind', share: 0.1 }, left: [],
};

function capture(number: number, changes: Partial<Capture> = {}): Capture {
  return { id: `c${number}`, number, camera: CAMERA, time_s: 0, state: 'ready', mpi_version: 2, ...changes };
}

function opened(captures: readonly Capture[] = [], summary = SUMMARY): { place: SessionPlace; asked: string[] } {
  const asked: string[] = [];
  const answer = async (name: string): Promise<ArrayBuffer> => {
    asked.push(name);
    return new ArrayBuffer(0);
  };
  const api = {
    guidance: async () => GUIDANCE,
    training: async () => { throw new Error('not yet'); },
    mpi: (session: string, id: string, version: number) => answer(`${session} mpi ${id} ${version}`),
    points: (session: string, id: string) => answer(`${session} points ${id}`),
    splat: (session: string, version: number) => answer(`${session} splat ${version}`),
    photoUrl: (_: string, id: string) => `photo of ${id}`,
    thumbnailUrl: (_: string, id: string) => `thumbnail of ${id}`,
  } as unknown as Api;
  const session: Session = { summary, captures };
  return { place: new SessionPlace(api, session, {} as Options), asked };
}

test('views are the captures that are there, in order, with what is ready of them', () => {
  const { place } = opened([capture(2), capture(1, { state: 'queued' })]);
  let told = 0;
  place.subscribe(() => { told += 1; });
  place.follow({ type: 'CaptureChanged', capture: capture(1, { state: 'ready' }) });
  place.follow({ type: 'CaptureChanged', capture: capture(3, { removed: true }) });
  expect(told).toBe(2);
  expect(place.place.views.map(({ name, mpi }) => [name, mpi])).toEqual([['c1', 'mpi:c1:2'], ['c2', 'mpi:c2:2']]);
  expect(place.place.points).toEqual(['points:c1', 'points:c2']);
});

test('a better MPI has another name, so it is fetched', () => {
  const { place } = opened([capture(1)]);
  place.follow({ type: 'CaptureChanged', capture: capture(1, { mpi_version: 3 }) });
  expect(place.place.views[0]?.mpi).toBe('mpi:c1:3');
});

test('files are asked for at their addresses', async () => {
  const { place, asked } = opened([capture(1)]);
  place.follow({ type: 'TrainingChanged', training: TRAINING });
  expect(place.place.splat).toBe('splat:7:.spz');
  for (const file of ['mpi:c1:2', 'points:c1', 'splat:7:.spz']) await place.bytes(file);
  expect(asked).toEqual(['session mpi c1 2', 'session points c1', 'session splat 7']);
  expect(place.url('photo:c1')).toBe('photo of c1');
  expect(place.url('thumbnail:c1')).toBe('thumbnail of c1');
  expect(() => place.bytes('something')).toThrow('something');
});

test('what would help is shown while one captures, and not when it is finished', async () => {
  const { place } = opened([capture(1)]);
  await new Promise((resolve) => setTimeout(resolve, 0));
  expect(place.place.suggested.map(({ reason }) => reason)).toEqual(['shows what is behind']);
  place.follow({ type: 'SessionChanged', summary: { ...SUMMARY, finished: true } });
  expect(place.place.suggested).toEqual([]);
  expect(place.place.shown).toBe('light-field');
});

test('up and scale are known where they are', () => {
  expect(opened([capture(1)]).place.place.up).toEqual([0, 1, 0]);
  expect(opened([], { ...SUMMARY, source: 'replay' }).place.place.up).toBeNull();
  expect(opened([capture(1, { guessed: true })]).place.place.metric).toBe(false);
});
