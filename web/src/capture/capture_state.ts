/**
 * What is known of a session's captures: the phone's own records and the server's news, merged into
 * one ordered list. Pure: no clock, no network, no database.
 */

import type { Connection } from '../server/events';
import type { Camera, Capture, SessionEvent, SessionSummary } from '../wire';
import type { StoredCapture } from './capture_db';

/**
 * `waiting`: on this phone. `uploading`: on its way. `queued`: on the server's disk, its MPI is
 * being made. `ready`: its MPI can be drawn. `failed`: see `problem`.
 */
export type ViewState = 'waiting' | 'uploading' | 'queued' | 'ready' | 'failed';

export interface CapturedView {
  readonly id: string;
  /** The server's number; null until it has it. */
  readonly number: number | null;
  readonly state: ViewState;
  readonly thumbnailUrl: string;
  /** When `failed`: a sentence. When `ready`: why no better MPI was made. */
  readonly problem: string | null;
  /** Of the newest MPI; 0 while there is none. */
  readonly mpiVersion: number;
  /** Who made the newest MPI. */
  readonly generator: string | null;
  /** Its scale is a guess until a view nearby tells it. */
  readonly guessed: boolean;
  readonly camera: Camera;
  /** Seconds since 1970. */
  readonly time_s: number;
  /** The photo is on the server's disk. */
  readonly onServer: boolean;
  /** The program took it out of the data set, since others show the same. */
  readonly setAside: boolean;
}

export interface CaptureState {
  /** This phone's records, by id. */
  readonly locals: ReadonlyMap<string, StoredCapture>;
  /** The server's, by id; removed ones too. */
  readonly remotes: ReadonlyMap<string, Capture>;
  readonly uploadingId: string | null;
  readonly connection: Connection;
  /** Why nothing is sent. */
  readonly trouble: string | null;
  readonly summary: SessionSummary | null;
  /** Counts the news of guidance, and the times it may have been missed. */
  readonly guidanceNews: number;
}

export type CaptureAction = SessionEvent
  | { readonly type: 'LocalsRead'; readonly locals: readonly StoredCapture[] }
  | { readonly type: 'Answered'; readonly capture: Capture }
  | { readonly type: 'Uploading'; readonly id: string | null }
  | { readonly type: 'Erased' }
  | { readonly type: 'Troubled'; readonly problem: string | null }
  | { readonly type: 'ConnectionChanged'; readonly connection: Connection };

export const NOTHING_KNOWN: CaptureState = {
  locals: new Map(),
  remotes: new Map(),
  uploadingId: null,
  connection: 'connecting',
  trouble: null,
  summary: null,
  guidanceNews: 0,
};

export function reduce(state: CaptureState, action: CaptureAction): CaptureState {
  switch (action.type) {
    case 'SessionState': return {
      ...state,
      remotes: byId(action.session.captures),
      summary: action.session.summary,
      guidanceNews: state.guidanceNews + 1,
    };
    case 'CaptureChanged': return {
      ...state,
      remotes: new Map(state.remotes).set(action.capture.id, action.capture),
    };
    case 'SessionChanged': return { ...state, summary: action.summary };
    case 'TrainingChanged': return state; // for who looks, later
    case 'GuidanceChanged': return { ...state, guidanceNews: state.guidanceNews + 1 };
    case 'LocalsRead': return { ...state, locals: byId(action.locals) };
    case 'Answered': return answered(state, action.capture);
    case 'Erased': return { ...state, locals: new Map(), remotes: new Map() };
    case 'Uploading': return { ...state, uploadingId: action.id };
    case 'Troubled': return { ...state, trouble: action.problem };
    case 'ConnectionChanged': return { ...state, connection: action.connection };
    default: return action satisfies never;
  }
}

/** Whether the lists of two states are the same, but for where thumbnails are. */
export function listsTheSame(one: CaptureState, other: CaptureState): boolean {
  return one.locals === other.locals && one.remotes === other.remotes
    && one.uploadingId === other.uploadingId;
}

/** The list for the photographer: in the order the photos were taken, without undone ones. */
export function viewsOf(
  state: CaptureState, thumbnailUrlOf: (id: string) => string,
): readonly CapturedView[] {
  return listOf(state, thumbnailUrlOf, (local, remote) =>
    remote?.removed !== true && !isUndone(local));
}

/** Those that were undone or set aside and can be brought back. */
export function restorableOf(
  state: CaptureState, thumbnailUrlOf: (id: string) => string,
): readonly CapturedView[] {
  return listOf(state, thumbnailUrlOf, (local, remote) => remote?.removed === true
    ? remote.restorable === true : isUndone(local));
}

function listOf(
  state: CaptureState, thumbnailUrlOf: (id: string) => string,
  isListed: (local: StoredCapture | undefined, remote: Capture | undefined) => boolean,
): readonly CapturedView[] {
  const ids = new Set([...state.locals.keys(), ...state.remotes.keys()]);
  const views: CapturedView[] = [];
  for (const id of ids) {
    const local = state.locals.get(id);
    const remote = state.remotes.get(id);
    if (!isListed(local, remote)) continue;
    const known = remote ?? local;
    if (known === undefined) continue;
    const { camera, time_s } = known;
    views.push({
      id,
      number: remote?.number ?? null,
      state: remote?.state ?? localState(local, state.uploadingId),
      thumbnailUrl: thumbnailUrlOf(id),
      problem: (remote ?? local)?.problem ?? null,
      mpiVersion: remote?.mpi_version ?? 0,
      generator: remote?.generator ?? null,
      guessed: remote?.guessed ?? false,
      camera,
      time_s,
      onServer: remote !== undefined || local?.state === 'stored',
      setAside: remote?.ending === 'set_aside',
    });
  }
  return views.sort((a, b) => a.time_s - b.time_s || (a.id < b.id ? -1 : 1));
}

/**
 * Captures that were undone here and are alive there: an upload whose reply was lost arrived after
 * its undo. They must be undone again.
 */
export function risenOf(state: CaptureState): readonly string[] {
  return [...state.remotes.values()]
    .filter(({ id, removed }) => removed !== true && state.locals.get(id)?.state === 'removed')
    .map(({ id }) => id);
}

function isUndone(local: StoredCapture | undefined): boolean {
  return local?.state === 'removing' || local?.state === 'removed';
}

/** A reply may be overtaken by the events it caused, so it never takes "ready" back to "queued". */
function answered(state: CaptureState, capture: Capture): CaptureState {
  if (state.remotes.has(capture.id) && capture.removed !== true) return state;
  return { ...state, remotes: new Map(state.remotes).set(capture.id, capture) };
}

function localState(local: StoredCapture | undefined, uploadingId: string | null): ViewState {
  if (local?.state === 'failed') return 'failed';
  if (local?.state === 'stored') return 'queued';
  return local !== undefined && local.id === uploadingId ? 'uploading' : 'waiting';
}

function byId<T extends { readonly id: string }>(items: readonly T[]): ReadonlyMap<string, T> {
  return new Map(items.map((item) => [item.id, item]));
}
