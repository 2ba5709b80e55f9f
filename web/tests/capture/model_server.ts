/** A server in memory behind a fake `fetch`, that can be made to fail in every way it may. */

import {
  PROTOCOL, type Capture, type CaptureHeader, type NewSession, type Problem, type Session,
  type SessionChange,
} from '../../src/wire';

/** What goes wrong with one request. `late`: it takes effect after the client has given up. */
export type Fault = 'refused' | 'reply lost' | 'late' | number | Response;

export interface ParsedUpload {
  readonly header: CaptureHeader;
  readonly jpeg: Uint8Array;
  readonly depth: Uint8Array;
}

export async function parseUpload(body: Blob): Promise<ParsedUpload> {
  const bytes = new Uint8Array(await body.arrayBuffer());
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length))) as
    CaptureHeader;
  const end = 4 + length + header.photo_bytes;
  return { header, jpeg: bytes.subarray(4 + length, end), depth: bytes.subarray(end) };
}

interface Held { request: NewSession; captures: Capture[]; finished: boolean; name: string }

export class ModelServer {
  readonly sessions = new Map<string, Held>();
  /** Sessions that take nothing any more, and how that came about. */
  readonly gone = new Map<string, 'deleted' | 'erased'>();
  /** How often each capture's bytes were written. */
  readonly writes = new Map<string, number>();
  readonly log: string[] = [];
  /** Asked before every request but event streams. */
  fault: (what: string) => Fault | null = () => null;
  online = true;
  uploadsNow = 0;
  mostUploadsAtOnce = 0;
  readonly #streams = new Set<{ id: string; send: (text: string) => void; end: () => void }>();
  readonly #late: (() => Promise<unknown>)[] = [];

  readonly fetch = async (input: RequestInfo | URL, init: RequestInit = {}): Promise<Response> => {
    const path = new URL(String(input), 'http://server').pathname.replace('/api/v1', '');
    const method = init.method ?? 'GET';
    const [, , id = '', part, captureId = ''] = path.split('/');
    if (!this.online) throw new TypeError('Failed to fetch');
    if (path.endsWith('/events')) return this.#events(id, init.signal ?? null);
    const what = `${method} ${part === 'captures' ? captureId : path.replace(id, 'S')}`;
    this.log.push(what);
    const fault = this.fault(what);
    if (fault instanceof Response) return fault;
    if (typeof fault === 'number') return problem(fault, `fault ${fault}`);
    if (fault === 'refused') throw new TypeError('Failed to fetch');
    if (fault === 'late') {
      this.#late.push(() => this.#answer(method, path, init));
      throw new TypeError('Failed to fetch');
    }
    const answer = await this.#answer(method, path, init);
    if (fault === 'reply lost') throw new TypeError('Failed to fetch');
    return answer;
  };

  /** Requests that were on their way when their connection broke do arrive. */
  async deliverLate(): Promise<void> {
    for (const deliver of this.#late.splice(0)) await deliver();
  }

  alive(): string[] {
    return [...this.sessions.values()].flatMap(({ captures }) =>
      captures.filter(({ removed }) => removed !== true).map(({ id }) => id));
  }

  stop(): void {
    this.online = false;
    for (const stream of this.#streams) stream.end();
    this.#streams.clear();
  }

  start(): void {
    this.online = true;
  }

  erase(id: string): void {
    this.sessions.delete(id);
    this.gone.set(id, 'erased');
  }

  /** Somebody else has renamed all sessions. */
  rename(name: string): void {
    for (const [id, held] of this.sessions) {
      held.name = name;
      this.#tell(id, { type: 'SessionChanged', summary: this.#session(id)?.summary });
    }
  }

  /** Somebody else has finished all sessions, or goes on with them. */
  finish(finished: boolean): void {
    for (const [id, held] of this.sessions) {
      held.finished = finished;
      this.#tell(id, { type: 'SessionChanged', summary: this.#session(id)?.summary });
    }
  }

  ready(captureId: string): void {
    for (const [id, held] of this.sessions) {
      const at = held.captures.findIndex((capture) => capture.id === captureId);
      const capture = held.captures[at];
      if (capture === undefined) continue;
      held.captures[at] = { ...capture, state: 'ready', mpi_bytes: 3 };
      this.#tell(id, { type: 'CaptureChanged', capture: held.captures[at] });
    }
  }

  async #answer(method: string, path: string, init: RequestInit): Promise<Response> {
    const [, , id = '', part, captureId = '', leaf] = path.split('/');
    const gone = this.gone.get(id);
    if (gone !== undefined) return problem(410, `it was ${gone}`, {}, `urn:peaking:problem:${gone}`);
    if (part === undefined && method === 'PUT') {
      const request = JSON.parse(String(init.body)) as NewSession;
      if (request.protocol !== PROTOCOL) return problem(400, 'another protocol');
      const known = this.sessions.has(id);
      if (!known) this.sessions.set(id, { request, captures: [], finished: false, name: request.name });
      return json(this.#session(id), known ? 200 : 201);
    }
    const held = this.sessions.get(id);
    if (held === undefined) return problem(404, 'no such session');
    if (part === undefined && method === 'PATCH') {
      const change = JSON.parse(String(init.body)) as SessionChange;
      held.name = change.name ?? held.name;
      held.finished = change.finished ?? held.finished;
      this.#tell(id, { type: 'SessionChanged', summary: this.#session(id)?.summary });
      return json(this.#session(id)?.summary, 200);
    }
    if (part === undefined && method === 'GET') return json(this.#session(id), 200);
    if (part === 'peaked') return new Response(null, { status: 204 });
    if (leaf === 'mpi') return new Response(new Uint8Array([1, 2, 3]));
    const at = held.captures.findIndex((capture) => capture.id === captureId);
    if (method === 'PUT') return this.#store(id, held, at, captureId, init.body as Blob);
    const capture = held.captures[at];
    if (capture === undefined) return problem(404, 'no such capture');
    held.captures[at] = method === 'DELETE'
      ? { ...capture, removed: true, ending: 'undone', restorable: true }
      : { ...capture, removed: false, ending: null, restorable: false };
    this.#tell(id, { type: 'CaptureChanged', capture: held.captures[at] });
    return json(held.captures[at], 200);
  }

  async #store(
    id: string, held: Held, at: number, captureId: string, body: Blob,
  ): Promise<Response> {
    this.uploadsNow += 1;
    this.mostUploadsAtOnce = Math.max(this.mostUploadsAtOnce, this.uploadsNow);
    const { header } = await parseUpload(body);
    await new Promise((resolve) => setImmediate(resolve));
    this.uploadsNow -= 1;
    if (at >= 0) return json(held.captures[at], 200);
    if (held.finished) return problem(409, 'it is finished', {}, 'urn:peaking:problem:finished');
    const capture: Capture = {
      id: captureId, number: held.captures.length + 1, camera: header.camera,
      time_s: header.time_s, state: 'queued', mpi_bytes: null, problem: null, removed: false,
    };
    held.captures.push(capture);
    this.writes.set(captureId, 1 + (this.writes.get(captureId) ?? 0));
    this.#tell(id, { type: 'CaptureChanged', capture });
    return json(capture, 201);
  }

  #session(id: string): Session | null {
    const held = this.sessions.get(id);
    if (held === undefined) return null;
    const { request, captures, finished, name } = held;
    return {
      captures,
      summary: {
        id, name, folder: 'f', source: request.source, device: '', created_s: 0, finished,
        captures: captures.length, ready: 0, peaked_share: null, live: true,
      },
    };
  }

  #events(id: string, signal: AbortSignal | null): Response {
    const session = this.#session(id);
    if (session === null) return problem(404, 'no such session');
    const encoder = new TextEncoder();
    const body = new ReadableStream<Uint8Array>({
      start: (controller) => {
        const stream = {
          id,
          send: (text: string) => controller.enqueue(encoder.encode(text)),
          end: () => controller.error(new TypeError('network error')),
        };
        this.#streams.add(stream);
        signal?.addEventListener('abort', () => this.#streams.delete(stream));
        stream.send(`: ping\n\ndata: ${JSON.stringify({ type: 'SessionState', session })}\n\n`);
      },
    });
    return new Response(body, { headers: { 'Content-Type': 'text/event-stream' } });
  }

  #tell(id: string, event: object): void {
    for (const stream of this.#streams) {
      if (stream.id === id) stream.send(`data: ${JSON.stringify(event)}\n\n`);
    }
  }
}

function json(value: unknown, status: number): Response {
  return new Response(JSON.stringify(value),
    { status, headers: { 'Content-Type': 'application/json' } });
}

export function problem(
  status: number, detail: string, headers: HeadersInit = {}, type = 'about:blank',
): Response {
  const described: Problem = { type, title: 'Refused', status, detail };
  return new Response(JSON.stringify(described),
    { status, headers: { 'Content-Type': 'application/problem+json', ...headers } });
}
