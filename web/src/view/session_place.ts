/** A session of the server as a place: it grows as views come. */

import { cameraOfWire } from '../geometry';
import { ApiError, type Api } from '../server/api';
import type { Capture, Options, Session, SessionEvent, SessionSummary, Training } from '../wire';
import type { Place, PlaceView, Suggested } from './place';
import { PlaceError, type PlaceSource } from './place_source';

/** Sources whose world has its y axis upwards: WebXR says so. */
const Y_UP: ReadonlySet<SessionSummary['source']> = new Set(['webxr', 'virtual']);

export class SessionPlace implements PlaceSource {
  readonly #api: Api;
  readonly #id: string;
  readonly #options: Options;
  readonly #listeners = new Set<() => void>();
  #session: Session;
  #training: Training | null = null;
  /** Goes up with what is heard of it: an answer that was asked for before is older. */
  #trainingNews = 0;
  readonly #views = new WeakMap<Capture, PlaceView>();
  #suggestions: readonly Suggested[] = [];
  #place: Place;

  constructor(api: Api, session: Session, options: Options) {
    this.#api = api;
    this.#id = session.summary.id;
    this.#options = options;
    this.#session = session;
    this.#place = this.#made();
    void this.#refreshGuidance();
    void this.#refreshTraining();
  }

  get place(): Place {
    return this.#place;
  }

  get session(): Session {
    return this.#session;
  }

  /** The newest that is known of its training; null: nothing yet. */
  get training(): Training | null {
    return this.#training;
  }

  subscribe(listener: () => void): void {
    this.#listeners.add(listener);
  }

  /** Follow what the server says of the session. */
  follow(event: SessionEvent): void {
    switch (event.type) {
      case 'SessionState':
        this.#session = event.session;
        void this.#refreshTraining();
        void this.#refreshGuidance();
        break;
      case 'CaptureChanged': {
        const others = this.#session.captures.filter(({ id }) => id !== event.capture.id);
        const captures = [...others, event.capture].sort((a, b) => a.number - b.number);
        this.#session = { ...this.#session, captures };
        break;
      }
      case 'SessionChanged':
        this.#session = { ...this.#session, summary: event.summary };
        break;
      case 'GuidanceChanged':
        return void this.#refreshGuidance();
      case 'TrainingChanged':
        this.#training = event.training;
        this.#trainingNews += 1;
        break;
      default: event satisfies never;
    }
    this.#changed();
  }

  bytes(file: string): Promise<ArrayBuffer> {
    const [kind = '', id = '', version = ''] = file.split(':');
    switch (kind) {
      case 'mpi': return this.#api.mpi(this.#id, id, Number(version));
      case 'points': return this.#points(id);
      case 'splat': return this.#api.splat(this.#id, Number(id));
      default: throw new PlaceError(`a session has no ${file}`);
    }
  }

  url(file: string): string {
    const [kind = '', id = ''] = file.split(':');
    return kind === 'photo' ? this.#api.photoUrl(this.#id, id) : this.#api.thumbnailUrl(this.#id, id);
  }

  [Symbol.dispose](): void {
    this.#listeners.clear();
  }

  /** Without depth there are none. */
  async #points(id: string): Promise<ArrayBuffer> {
    try {
      return await this.#api.points(this.#id, id);
    } catch (error) {
      if (error instanceof ApiError && error.status === 404) return new ArrayBuffer(0);
      throw error;
    }
  }

  #changed(): void {
    this.#place = this.#made();
    for (const listener of this.#listeners) listener();
  }

  #made(): Place {
    const { summary, captures } = this.#session;
    const shown = captures.filter(({ removed }) => removed !== true);
    const views = shown.map((capture) => this.#viewOf(capture));
    return {
      title: summary.name,
      licence: '',
      up: Y_UP.has(summary.source) ? [0, 1, 0] : null,
      metric: shown.every(({ guessed }) => guessed !== true),
      shown: summary.finished ? 'light-field' : 'place',
      views,
      points: shown.map(({ id }) => `points:${id}`),
      splat: this.#splat(),
      options: this.#options,
      start: middleOf(views),
      loss_db: null,
      splat_loss_db: null,
      poster: null,
      suggested: this.#suggested(),
      live: !summary.finished,
    };
  }

  /** The same object while the capture is the same: whoever draws sees what is new. */
  #viewOf(capture: Capture): PlaceView {
    const known = this.#views.get(capture);
    if (known !== undefined) return known;
    const view = viewOf(capture);
    this.#views.set(capture, view);
    return view;
  }

  /** The name ends as the file's format does: whoever reads it goes by that. */
  #splat(): string | null {
    const training = this.#training;
    if (training === null || training.splat_version === 0) return null;
    return `splat:${training.splat_version}:.${training.splat_format}`;
  }

  #suggested(): readonly Suggested[] {
    return this.#session.summary.finished ? [] : this.#suggestions;
  }

  async #refreshGuidance(): Promise<void> {
    const guidance = await this.#api.guidance(this.#id).catch(() => null);
    if (guidance === null) return;
    const { next, left } = guidance;
    this.#suggestions = (next === null ? left : [next, ...left])
      .map(({ camera, reason }) => ({ camera: cameraOfWire(camera), reason }));
    this.#changed();
  }

  async #refreshTraining(): Promise<void> {
    const news = this.#trainingNews;
    const training = await this.#api.training(this.#id).catch(() => null);
    if (training === null || news !== this.#trainingNews) return;
    this.#training = training;
    this.#changed();
  }
}

function viewOf(capture: Capture): PlaceView {
  const { id, state, camera, mpi_version } = capture;
  return {
    name: id,
    camera: cameraOfWire(camera),
    photo: `photo:${id}`,
    thumbnail: `thumbnail:${id}`,
    mpi: state === 'ready' ? `mpi:${id}:${mpi_version ?? 1}` : null,
  };
}

/** The view in the middle of those that can be shown. */
function middleOf(views: readonly PlaceView[]): number {
  const ready = views.flatMap(({ mpi }, i) => (mpi === null ? [] : [i]));
  return ready[Math.floor(ready.length / 2)] ?? 0;
}
