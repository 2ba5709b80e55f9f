/**
 * The server's addresses, typed: docs/protocol.md. A browser that was paired carries a cookie that
 * no script can read, so nothing here knows a secret after `pair`.
 */

import { integer, parseJson, parseKept, record, SchemaError, type Schema } from '../schema';
import {
  captureSchema, guidanceSchema, pairedDevicesSchema, pairedSchema, pairingLinkSchema, peakedSamplesSchema,
  problemSchema, PROTOCOL, recordingIndexSchema, selectionSchema, serverInfoSchema, sessionSchema,
  sessionSummarySchema, trainingSchema, type Capture, type CaptureChange, type DatasetQuery, type Guidance,
  type NewSession, type Paired, type PairedDevices, type Pairing, type PairingLink, type PeakedSample, type PeakedSamples,
  type RecordingIndex, type Selection, type ServerInfo, type Session,
  type SessionChange, type SessionSummary, type Training, type TrainingChange,
} from '../wire';
import { thisDevice, type ThisDevice } from './this_device';

/** The server refused, or did not answer (`status` 0). `problem` is a sentence for people. */
export class ApiError extends Error {
  override readonly name = 'ApiError';

  constructor(
    /** HTTP status; 0 when there was no answer of this server at all. */
    readonly status: number,
    readonly problem: string,
    /** The server's `Retry-After`, seconds. */
    readonly retryAfter_s: number | null = null,
    /** The answer's text when it was 422: for those who know more of its fields. */
    readonly body = '',
    /** The problem's type, without `urn:peaking:problem:`; '' where the status says it all. */
    readonly kind = '',
  ) {
    super(problem);
  }
}

/** Whether sending the same again would get the same answer. */
export function isRefusal({ status, kind }: ApiError): boolean {
  return kind !== 'cut-off' && status >= 400 && status < 500 && ![401, 408, 425, 429].includes(status);
}

/** The server's words are not those of this page's version. */
export class NotUnderstood extends ApiError {
  constructor(problem: string) {
    super(0, problem);
  }
}

/** Whether a listener takes part in a session or only looks, which does not make the session live. */
export type Role = 'capture' | 'watch';

export interface ApiOptions {
  readonly fetch?: typeof fetch;
  /** For small requests. */
  readonly timeout_ms?: number;
  /** For photos, MPIs and recorded frames: a phone at the edge of its Wi-Fi is slow. */
  readonly bulkTimeout_ms?: number;
}

/** What `pairFromHash` needs of a window. */
export interface PairingPage {
  readonly location: Pick<Location, 'hash' | 'pathname' | 'search'>;
  readonly history: Pick<History, 'replaceState'>;
}

interface Request {
  readonly json?: object;
  readonly body?: Blob;
  readonly headers?: Readonly<Record<string, string>>;
  readonly bulk?: boolean;
  readonly signal?: AbortSignal | undefined;
}

const NO_ANSWER = 'The server does not answer. Check that it is running and that this device is in the '
  + 'same network.';
const NOT_OURS = 'Something other than the peaking server answered (perhaps a Wi-Fi login page).';

export class Api {
  readonly #fetch: typeof fetch;
  readonly #timeout_ms: number;
  readonly #bulkTimeout_ms: number;

  /** @param base Origin of the server; '' for the one this page came from. */
  constructor(readonly base = '', options: ApiOptions = {}) {
    this.#fetch = options.fetch ?? ((input, init) => fetch(input, init));
    this.#timeout_ms = options.timeout_ms ?? 15_000;
    this.#bulkTimeout_ms = options.bulkTimeout_ms ?? 120_000;
  }

  /** @throws ApiError also when the server speaks another version of the protocol. */
  async server(): Promise<ServerInfo> {
    const text = await this.#text('GET', '/server');
    // Looked at first: all else may be different in another version.
    const { protocol } = parsed(spokenSchema, text);
    if (protocol !== PROTOCOL) {
      throw new ApiError(0, `The server speaks version ${protocol} of the protocol, this page `
        + `version ${PROTOCOL}. Reload the page, or update the older of the two.`);
    }
    return parsed(serverInfoSchema, text);
  }

  /** Show a code; the same code of the same device may be shown again when no answer came. */
  async pair(code: string, device: ThisDevice): Promise<Paired> {
    const { id, name } = device;
    const json: Pairing = { protocol: PROTOCOL, code, device: id, name, cookie: true };
    return this.#json('POST', '/pair', pairedSchema, { json });
  }

  /**
   * Pair with the code of the link (`#code=…`) if there is one, and take it out of the address
   * bar as soon as the server has answered; without an answer it stays, so a reload tries again.
   * A browser that is paired already goes on when the code is used up: the link was opened twice.
   *
   * @returns Whether it was paired now.
   */
  async pairFromHash(page: PairingPage = window, device = thisDevice()): Promise<boolean> {
    const fragment = new URLSearchParams(page.location.hash.replace(/^#/, ''));
    const code = fragment.get('code');
    if (code === null || code === '') return false;
    fragment.delete('code');
    try {
      await this.pair(code, device);
    } catch (error) {
      if (error instanceof ApiError && error.status === 0) throw error;
      this.#showHash(page, fragment);
      if (error instanceof ApiError && error.status === 401 && await this.#isPaired()) return false;
      throw error;
    }
    this.#showHash(page, fragment);
    return true;
  }

  devices(): Promise<PairedDevices> {
    return this.#json('GET', '/devices', pairedDevicesSchema);
  }

  /** A new link and QR code, for one more device. */
  pairingLink(path = '/devices/codes'): Promise<PairingLink> {
    return this.#json('POST', path, pairingLinkSchema);
  }

  /** May be repeated. */
  async revoke(deviceId: string): Promise<void> {
    await this.#ask('DELETE', `/devices/${encodeURIComponent(deviceId)}`, {});
  }

  /** Ask for JSON at an address of an extension. */
  ask<T>(method: string, path: string, schema: Schema<T>, json?: object): Promise<T> {
    return this.#json(method, path, schema, json === undefined ? {} : { json });
  }

  /** Tell something that is answered by its status alone. */
  async tell(method: string, path: string, json: object): Promise<void> {
    await this.#ask(method, path, { json });
  }

  /** Server-sent events of an address, as bytes. */
  eventBytes(path: string, signal: AbortSignal): Promise<ReadableStream<Uint8Array>> {
    return this.#eventBytes(path, signal);
  }

  /** Begin a session, or find it again: the same id is the same session. */
  beginSession(sessionId: string, session: NewSession): Promise<Session> {
    return this.#json('PUT', sessionPath(sessionId), sessionSchema, { json: session });
  }

  session(sessionId: string): Promise<Session> {
    return this.#json('GET', sessionPath(sessionId), sessionSchema);
  }

  changeSession(sessionId: string, change: SessionChange): Promise<SessionSummary> {
    return this.#json('PATCH', sessionPath(sessionId), sessionSummarySchema, { json: change });
  }

  /**
   * Send a photo (`uploadBody`). May be repeated: the same id is stored once. When it resolves, the
   * server has it on its disk.
   */
  async uploadCapture(
    sessionId: string, captureId: string, body: Blob, signal?: AbortSignal,
  ): Promise<Capture> {
    return this.#capture('PUT', sessionId, captureId, { body, bulk: true, signal });
  }

  /** Undo. May be repeated. @throws ApiError 404 when the server never had it. */
  async removeCapture(sessionId: string, captureId: string): Promise<Capture> {
    return this.#capture('DELETE', sessionId, captureId, {});
  }

  /** Bring back what was undone or set aside. May be repeated. @throws ApiError 409 if it is gone. */
  async restoreCapture(sessionId: string, captureId: string): Promise<Capture> {
    const json: CaptureChange = { ending: null };
    return this.#capture('PATCH', sessionId, captureId, { json });
  }

  /** Erase a session for ever. May be repeated. */
  async eraseSession(sessionId: string): Promise<void> {
    await this.#ask('DELETE', sessionPath(sessionId), {});
  }

  /** Versions count from 1, and none ever changes. @throws ApiError 404 when it is not made yet. */
  mpi(
    sessionId: string, captureId: string, version: number, signal?: AbortSignal,
  ): Promise<ArrayBuffer> {
    return this.#bytes(`${capturePath(sessionId, captureId)}/mpi/${version}`, signal);
  }

  /** May be repeated: a sample is known by its time. */
  putPeaked(
    sessionId: string, batchId: string, samples: readonly PeakedSample[],
  ): Promise<void> {
    const json: PeakedSamples = { samples };
    return this.tell('PUT', `${sessionPath(sessionId)}/peaked/${encodeURIComponent(batchId)}`, json);
  }

  peaked(sessionId: string): Promise<PeakedSamples> {
    return this.#json('GET', `${sessionPath(sessionId)}/peaked`, peakedSamplesSchema);
  }

  guidance(sessionId: string): Promise<Guidance> {
    return this.#json('GET', `${sessionPath(sessionId)}/guidance`, guidanceSchema);
  }

  /** How far the training of 3D Gaussians is. */
  training(sessionId: string): Promise<Training> {
    return this.#json('GET', `${sessionPath(sessionId)}/training`, trainingSchema);
  }

  /** Begin to train, go on, or stop. @throws ApiError 409: there are too few views. */
  train(sessionId: string, state: TrainingChange['state']): Promise<Training> {
    const json: TrainingChange = { state };
    return this.#json('PUT', `${sessionPath(sessionId)}/training`, trainingSchema, { json });
  }

  /** Gaussians of a version; none ever changes. @throws ApiError 404: there are newer ones. */
  splat(sessionId: string, version: number): Promise<ArrayBuffer> {
    return this.#bytes(`${sessionPath(sessionId)}/training/splat/${version}`, undefined);
  }

  /** What a capture sees: n × 3 float32, then n × 3 bytes of colour. @throws ApiError 404: no depth. */
  points(sessionId: string, captureId: string): Promise<ArrayBuffer> {
    return this.#bytes(`${capturePath(sessionId, captureId)}/points`, undefined);
  }

  recording(name: string): Promise<RecordingIndex> {
    return this.#json('GET', recordingPath(name), recordingIndexSchema);
  }

  async recordedPhoto(name: string, index: number, signal?: AbortSignal): Promise<Blob> {
    const response = await this.#ask('GET', `${recordingPath(name)}/frames/${index}/photo`,
      { bulk: true, signal });
    return read(response.blob());
  }

  /** 16-bit millimetres, rows from the top; the size is in the recording's index, which also says
   * what it is of a trace. */
  recordedDepth(name: string, index: number, signal?: AbortSignal): Promise<ArrayBuffer> {
    return this.#bytes(`${recordingPath(name)}/frames/${index}/depth`, signal);
  }

  /** Server-sent events of one session, as bytes; `events.ts` reads them. */
  sessionEventBytes(
    sessionId: string, signal: AbortSignal, role: Role = 'capture',
  ): Promise<ReadableStream<Uint8Array>> {
    const query = role === 'watch' ? '?watch' : '';
    return this.#eventBytes(`${sessionPath(sessionId)}/events${query}`, signal);
  }

  /** Server-sent events of the list of sessions. */
  serverEventBytes(signal: AbortSignal): Promise<ReadableStream<Uint8Array>> {
    return this.#eventBytes('/events', signal);
  }

  photoUrl(sessionId: string, captureId: string): string {
    return this.#url(`${capturePath(sessionId, captureId)}/photo`);
  }

  thumbnailUrl(sessionId: string, captureId: string): string {
    return this.#url(`${capturePath(sessionId, captureId)}/thumbnail`);
  }

  /** @param query Which views, in which format: all, in nerfstudio's, by default. */
  datasetUrl(sessionId: string, query: DatasetQuery = {}): string {
    return this.#url(datasetPath(sessionId, query));
  }

  /** Have a data set made ready, so that it comes soon. */
  async prepareDataset(sessionId: string, query: DatasetQuery): Promise<void> {
    await this.#ask('HEAD', datasetPath(sessionId, query), { bulk: true });
  }

  /** How good the captures are, and how many of them are enough: seconds, the first time. */
  selection(sessionId: string, signal?: AbortSignal): Promise<Selection> {
    return this.#json('GET', `${sessionPath(sessionId)}/selection`, selectionSchema, { bulk: true, signal });
  }

  #url(path: string): string {
    return `${this.base}/api/v1${path}`;
  }

  #isPaired(): Promise<boolean> {
    return this.#ask('GET', '/server', {}).then(() => true, () => false);
  }

  #showHash(page: PairingPage, fragment: URLSearchParams): void {
    const rest = fragment.toString();
    const { pathname, search } = page.location;
    page.history.replaceState(null, '', pathname + search + (rest === '' ? '' : `#${rest}`));
  }

  async #capture(
    method: string, sessionId: string, captureId: string, request: Request,
  ): Promise<Capture> {
    const path = capturePath(sessionId, captureId);
    const capture = await this.#json(method, path, captureSchema, request);
    // A photo is thrown away on the strength of this answer, so it must be the answer to it.
    if (capture.id !== captureId) throw new ApiError(0, NOT_OURS);
    return capture;
  }

  async #eventBytes(path: string, signal: AbortSignal): Promise<ReadableStream<Uint8Array>> {
    const response = await this.#send(path, {
      signal, cache: 'no-store', headers: { Accept: 'text/event-stream' },
    });
    const type = response.headers.get('Content-Type') ?? '';
    if (response.body === null || !type.startsWith('text/event-stream')) {
      throw new ApiError(0, NOT_OURS);
    }
    return response.body;
  }

  async #bytes(path: string, signal: AbortSignal | undefined): Promise<ArrayBuffer> {
    const response = await this.#ask('GET', path, { bulk: true, signal });
    return read(response.arrayBuffer());
  }

  async #json<T>(
    method: string, path: string, schema: Schema<T>, request: Request = {},
  ): Promise<T> {
    return parsed(schema, await this.#text(method, path, request));
  }

  async #text(method: string, path: string, request: Request = {}): Promise<string> {
    const response = await this.#ask(method, path, request);
    if (!isJson(response)) throw new ApiError(0, NOT_OURS);
    return read(response.text());
  }

  #ask(method: string, path: string, request: Request): Promise<Response> {
    const timeout = AbortSignal.timeout(request.bulk ? this.#bulkTimeout_ms : this.#timeout_ms);
    const signal = request.signal ? AbortSignal.any([request.signal, timeout]) : timeout;
    const init: RequestInit = { method, signal, headers: { ...request.headers } };
    if (request.json !== undefined) {
      init.body = JSON.stringify(request.json);
      init.headers = { ...init.headers, 'Content-Type': 'application/json' };
    } else if (request.body !== undefined) {
      init.body = request.body;
      init.headers = { ...init.headers, 'Content-Type': 'application/octet-stream' };
    }
    return this.#send(path, init);
  }

  /** Follows no redirect: the API has none, and a Wi-Fi login page has. */
  async #send(path: string, init: RequestInit): Promise<Response> {
    const response = await read(this.#fetch(this.#url(path), { ...init, redirect: 'error' }));
    if (!response.ok) throw await refusal(response);
    return response;
  }
}

const spokenSchema = record<{ readonly protocol: number }>({ protocol: integer() });

/** What the server said, when it is what this page expects. @throws NotUnderstood */
export function parsed<T>(schema: Schema<T>, text: string): T {
  try {
    return parseJson(schema, text);
  } catch (error) {
    if (!(error instanceof SchemaError)) throw error;
    throw new NotUnderstood(`This page does not understand the server (${error.message}). Reload `
      + 'the page.');
  }
}

function isJson(response: Response): boolean {
  return /^application\/(problem\+)?json\b/.test(response.headers.get('Content-Type') ?? '');
}

function sessionPath(sessionId: string): string {
  return `/sessions/${encodeURIComponent(sessionId)}`;
}

function capturePath(sessionId: string, captureId: string): string {
  return `${sessionPath(sessionId)}/captures/${encodeURIComponent(captureId)}`;
}

function datasetPath(sessionId: string, { views, format }: DatasetQuery): string {
  const query = [
    ...(views === undefined || views === null ? [] : [`views=${views}`]),
    ...(format === undefined || format === 'nerfstudio' ? [] : [`format=${format}`]),
  ].join('&');
  return `${sessionPath(sessionId)}/dataset.zip${query === '' ? '' : `?${query}`}`;
}

function recordingPath(name: string): string {
  return `/recordings/${encodeURIComponent(name)}`;
}

/** Turns a connection that failed or timed out into an ApiError; what the caller aborted stays. */
async function read<T>(promise: Promise<T>): Promise<T> {
  try {
    return await promise;
  } catch (error) {
    if (error instanceof DOMException && error.name === 'AbortError') throw error;
    throw new ApiError(0, NO_ANSWER);
  }
}

async function refusal(response: Response): Promise<ApiError> {
  const text = await response.text().catch(() => '');
  const retryAfter_s = Number.parseFloat(response.headers.get('Retry-After') ?? '');
  // Null where something else than this server refused.
  const problem = parseKept(problemSchema, text);
  return new ApiError(response.status, problem?.detail || sentenceOf(response.status),
    Number.isFinite(retryAfter_s) ? Math.max(0, retryAfter_s) : null,
    response.status === 422 ? text : '', problem?.type.replace(/^(urn:peaking:problem:|about:blank$)/, ''));
}

function sentenceOf(status: number): string {
  switch (status) {
    case 401: return 'This browser is not paired with the server. Open the link or scan the QR '
      + 'code that the server shows.';
    case 429: return 'The server asks to wait a moment.';
    case 404: return 'The server does not have this page or file.';
    case 413: return 'The photo is too large for the server.';
    case 503: return 'The server is busy. Try again in a moment.';
    case 507: return "The server's disk is full.";
    default: return `The server answered with status ${status}, without an explanation.`;
  }
}
