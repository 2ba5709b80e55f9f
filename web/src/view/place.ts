/**
 * A place: what is looked at, whether it comes from a session that goes on or from files. The twin of
 * `src/peaking/share/place.py`; docs/viewing.md says what its files are.
 */

import { cameraOfWire, forwardOf, positionOf, type Camera, type Vector3 } from '../geometry';
import { flag, integer, list, nullable, number, oneOf, optional, parseJson, record, text } from '../schema';
import { cameraSchema, optionsSchema, type Camera as WireCamera, type Options } from '../wire';

/** How MPIs are chosen and blended, and how many pixels they have. */
export type LightFieldOptions = Pick<Options, 'neighbours' | 'blend_weights' | 'opacity' | 'filling_views' | 'pixels'>;

export type Shown = 'light-field' | 'splat' | 'place';

/** A photo and where it was taken. Files are named as the source of the place knows them. */
export interface PlaceView {
  readonly name: string;
  readonly camera: Camera;
  readonly photo: string | null;
  readonly thumbnail: string | null;
  readonly mpi: string | null;
}

/** A camera from which a view would help, and why. */
export interface Suggested {
  readonly camera: Camera;
  readonly reason: string;
}

export interface Place {
  readonly title: string;
  /** One line under the picture; '' none. */
  readonly licence: string;
  /** Unit vector of the world; null: nobody knows. */
  readonly up: Vector3 | null;
  /** Lengths are metres. */
  readonly metric: boolean;
  /** What is shown first. */
  readonly shown: Shown;
  readonly views: readonly PlaceView[];
  /** Files of points, each n × 3 float32 (little-endian), then n × 3 bytes of colour. */
  readonly points: readonly string[];
  readonly splat: string | null;
  readonly options: LightFieldOptions | null;
  /** The view from which one looks first. */
  readonly start: number;
  readonly loss_db: number | null;
  /** Of the Gaussians, where both are shown. */
  readonly splat_loss_db: number | null;
  readonly poster: string | null;
  readonly suggested: readonly Suggested[];
  /** More may come. */
  readonly live: boolean;
}

const FORMAT = 'peaking place';
const VERSION = 1;

const fileName = nullable(text);

interface StoredView {
  readonly name: string;
  readonly camera: WireCamera;
  readonly photo: string | null;
  readonly thumbnail: string | null;
  readonly mpi: string | null;
}

interface Stored {
  readonly format: typeof FORMAT;
  readonly version: number;
  readonly title: string;
  readonly licence: string;
  readonly up: readonly number[] | null;
  readonly metric: boolean;
  readonly shown: Shown;
  readonly views: readonly StoredView[];
  readonly points: string | null;
  readonly splat: string | null;
  readonly options: Options | null;
  readonly start: number;
  readonly loss_db: number | null;
  readonly splat_loss_db?: number | null;
  readonly poster: string | null;
  readonly address?: string | null;
  readonly qr?: string | null;
}

const schema = record<Stored>({
  format: oneOf(FORMAT),
  version: integer(1),
  title: text,
  licence: text,
  up: nullable(list(number(), 3, 3)),
  metric: flag,
  shown: oneOf('light-field', 'splat', 'place'),
  views: list(record<StoredView>({
    name: text, camera: cameraSchema, photo: fileName, thumbnail: fileName, mpi: fileName,
  })),
  points: fileName,
  splat: fileName,
  options: nullable(optionsSchema),
  start: integer(0),
  loss_db: nullable(number()),
  splat_loss_db: optional(nullable(number())),
  poster: fileName,
  address: optional(nullable(text)),
  qr: optional(nullable(text)),
});

/** Of a place from files: where it is to be found, as a picture to scan. */
export interface Address {
  readonly address: string;
  readonly qr: string | null;
}

export interface ReadPlace {
  readonly place: Place;
  readonly address: Address | null;
}

/**
 * Read `place.json`.
 *
 * @throws SchemaError What is wrong with it, and where.
 */
export function parsePlace(json: string): ReadPlace {
  const stored = parseJson(schema, json);
  if (stored.version !== VERSION) {
    throw new RangeError(`the place is of version ${stored.version}, and this viewer reads version ${VERSION}`);
  }
  const { address = null, qr = null } = stored;
  // It becomes a link: nothing but a page may be behind it.
  if (address !== null && !/^https?:\/\//i.test(address)) throw new RangeError('address: need http:// or https://');
  return {
    place: {
      title: stored.title,
      licence: stored.licence,
      up: stored.up === null ? null : vectorOf(stored.up),
      metric: stored.metric,
      shown: stored.shown,
      views: stored.views.map((view) => ({ ...view, camera: cameraOfWire(view.camera) })),
      points: stored.points === null ? [] : [stored.points],
      splat: stored.splat,
      options: stored.options,
      start: Math.min(stored.start, Math.max(stored.views.length - 1, 0)),
      loss_db: stored.loss_db,
      splat_loss_db: stored.splat_loss_db ?? (stored.shown === 'splat' ? stored.loss_db : null),
      poster: stored.poster,
      suggested: [],
      live: false,
    },
    address: address === null ? null : { address, qr },
  };
}

function vectorOf(numbers: readonly number[]): Vector3 {
  const [x = 0, y = 0, z = 0] = numbers;
  return [x, y, z];
}

/** Up as it is told, or else as most pictures were held. */
export function upOf(place: Pick<Place, 'up' | 'views'>): Vector3 {
  if (place.up !== null) return place.up;
  const sum: [number, number, number] = [0, 0, 0];
  for (const { camera } of place.views) {
    const m = camera.worldFromCam.rows;
    sum[0] -= m[1] ?? 0;
    sum[1] -= m[5] ?? 0;
    sum[2] -= m[9] ?? 0;
  }
  const length = Math.hypot(...sum);
  return length > 1e-6 ? [sum[0] / length, sum[1] / length, sum[2] / length] : [0, 1, 0];
}

/** How far one walked from view to view. */
export function pathLength(views: readonly PlaceView[]): number {
  let sum = 0;
  for (let i = 1; i < views.length; i += 1) {
    const a = views[i - 1];
    const b = views[i];
    if (a === undefined || b === undefined) continue;
    const [ax, ay, az] = positionOf(a.camera);
    const [bx, by, bz] = positionOf(b.camera);
    sum += Math.hypot(ax - bx, ay - by, az - bz);
  }
  return sum;
}

/** A point to turn around: where the cameras look, `ahead` in front of their middle. */
export function gazeOf(views: readonly PlaceView[], ahead: number): Vector3 {
  const sum = [0, 0, 0];
  const count = Math.max(views.length, 1);
  for (const { camera } of views) {
    const at = positionOf(camera);
    const forward = forwardOf(camera);
    for (let axis = 0; axis < 3; axis += 1) {
      sum[axis] = (sum[axis] ?? 0) + ((at[axis] ?? 0) + ahead * (forward[axis] ?? 0)) / count;
    }
  }
  return [sum[0] ?? 0, sum[1] ?? 0, sum[2] ?? 0];
}
