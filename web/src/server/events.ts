/**
 * News from the server, with reconnection. Every stream begins with the whole state, so nothing is
 * lost by reconnecting.
 *
 * Read by `fetch`, not by `EventSource`: that hides the status (a 401 must say "pair again"), and
 * hides the server's pings, by whose absence a connection that died in silence is known.
 */

import type { Schema } from '../schema';
import {
  serverEventSchema, sessionEventSchema, SILENCE_S, type ServerEvent, type SessionEvent,
} from '../wire';
import { ApiError, NotUnderstood, parsed, type Api, type Role } from './api';
import { EventStreamReader } from './event_stream';
import { backoff_ms, browserPacing, type Pacing } from './pacing';

export type Connection = 'connecting' | 'online' | 'offline';

export interface EventsListener<Event> {
  onEvent(event: Event): void;
  /** `refusal` is given when it is offline because of what the server said. */
  onConnection(connection: Connection, refusal: ApiError | null): void;
}

export interface EventsOptions {
  readonly role?: Role;
  readonly pacing?: Pacing;
  /** Fires `online` and `offline`; a window. */
  readonly network?: EventTarget | null;
}

/** After so long without a byte, not even a ping, the connection is dead. */
const SILENCE_MS = 1000 * SILENCE_S;

/** Follow one session until the signal aborts; then resolves. */
export function sessionEvents(
  api: Api, sessionId: string, listener: EventsListener<SessionEvent>, signal: AbortSignal,
  options: EventsOptions = {},
): Promise<void> {
  return followEvents((open) => api.sessionEventBytes(sessionId, open, options.role),
    sessionEventSchema, listener, signal, options);
}

/** Follow the list of sessions until the signal aborts; then resolves. */
export function serverEvents(
  api: Api, listener: EventsListener<ServerEvent>, signal: AbortSignal,
  options: EventsOptions = {},
): Promise<void> {
  return followEvents(
    (open) => api.serverEventBytes(open), serverEventSchema, listener, signal, options);
}

/** Follow any stream of events until the signal aborts; `open` begins it. */
export async function followEvents<Event>(
  open: (signal: AbortSignal) => Promise<ReadableStream<Uint8Array>>, schema: Schema<Event>,
  listener: EventsListener<Event>, signal: AbortSignal, options: EventsOptions = {},
): Promise<void> {
  const pacing = options.pacing ?? browserPacing;
  const network = options.network === undefined ? globalThis : options.network;
  let failures = 0;
  listener.onConnection('connecting', null);
  while (!signal.aborted) {
    let refusal: ApiError | null = null;
    const connection = new AbortController();
    const drop = (): void => connection.abort();
    signal.addEventListener('abort', drop);
    network?.addEventListener('offline', drop);
    try {
      const bytes = await open(connection.signal);
      listener.onConnection('online', null);
      await readEvents(bytes, schema, listener, connection, pacing);
      failures = 0;
    } catch (error) {
      if (error instanceof ApiError && (error.status > 0 || error instanceof NotUnderstood)) refusal = error;
      else if (!(error instanceof ApiError) && !isAbort(error)) throw error;
    } finally {
      signal.removeEventListener('abort', drop);
      network?.removeEventListener('offline', drop);
      connection.abort();
    }
    if (signal.aborted) return;
    failures += 1;
    listener.onConnection('offline', refusal);
    await untilOnline(backoff_ms(failures, pacing), signal, network, pacing);
  }
}

async function readEvents<Event>(
  bytes: ReadableStream<Uint8Array>, schema: Schema<Event>, listener: EventsListener<Event>,
  connection: AbortController, pacing: Pacing,
): Promise<void> {
  const reader = bytes.getReader();
  const stop = (): void => void reader.cancel().catch(() => undefined);
  connection.signal.addEventListener('abort', stop);
  const decoder = new TextDecoder();
  const events = new EventStreamReader();
  for (;;) {
    const heard = new AbortController();
    void pacing.sleep(SILENCE_MS, heard.signal).then(() => {
      if (!heard.signal.aborted) connection.abort();
    });
    const piece = await reader.read().catch(() => null);
    heard.abort();
    if (piece === null || piece.done || connection.signal.aborted) return;
    for (const data of events.push(decoder.decode(piece.value, { stream: true }))) {
      listener.onEvent(parsed(schema, data));
    }
  }
}

function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === 'AbortError';
}

async function untilOnline(
  duration_ms: number, signal: AbortSignal, network: EventTarget | null, pacing: Pacing,
): Promise<void> {
  const wake = new AbortController();
  const stop = (): void => wake.abort();
  network?.addEventListener('online', stop);
  signal.addEventListener('abort', stop);
  await pacing.sleep(duration_ms, wake.signal);
  network?.removeEventListener('online', stop);
  signal.removeEventListener('abort', stop);
}
