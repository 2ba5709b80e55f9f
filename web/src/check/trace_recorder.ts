/** Writes down what a device says, frame by frame, into one file: docs/trace.md. */

import { PhotoReader } from '../capture/photo';
import type { LiveFrame } from '../sources/frame_source';
import { MAX_TRACE_BYTES, TRACE_VERSION, type Trace, type TracedDepth, type TracedFrame } from '../wire';
import { zipOf } from './zip';

/** Pictures are at most so large and so many: a phone has to go on tracking meanwhile. */
const LONG_SIDE_PX = 960;
const QUALITY = 0.8;
const PICTURE_EVERY_MS = 100;
/** What is not pictures and depth has room beside them. */
const PICTURES_BYTES = MAX_TRACE_BYTES - 4_000_000;
const MAX_FRAMES = 4000;
const UPRIGHT = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] as const;
const ABOUT = `A trace of a phone's camera, recorded by the page /check of peaking.
pictures/ shows what the camera saw: a room, and perhaps people in it. depth/ is how far away things were.
trace.json is where the phone was, when, and what the browser said of itself.
Play it with: peaking demo FILE
`;

type Writable<T> = { -readonly [K in keyof T]: T[K] };

export class TraceRecorder implements Disposable {
  /** Why there is no picture; null while all is well. */
  problem: string | null = null;
  pictures = 0;
  withDepth = 0;
  readonly #frames: TracedFrame[] = [];
  readonly #files = new Map<string, Blob>();
  readonly #reader: PhotoReader;
  #first: { readonly time_ms: number; readonly began_ms: number } | null = null;
  #bytes = 0;
  #pictureAt_ms = -Infinity;
  #reading: Promise<void> | null = null;

  constructor(gl: WebGL2RenderingContext, private readonly duration_ms: number) {
    this.#reader = new PhotoReader(gl, { longSide_px: LONG_SIDE_PX, quality: QUALITY });
  }

  get frames(): number { return this.#frames.length; }

  /** To be called inside the frame's callback. */
  add(frame: LiveFrame): void {
    if (this.#frames.length >= MAX_FRAMES) return;
    const began_ms = performance.now();
    this.#first ??= { time_ms: frame.time_ms, began_ms };
    const { told, camera } = frame;
    const traced: Writable<TracedFrame> = {
      time_ms: Math.max(0, frame.time_ms - this.#first.time_ms),
      began_ms: began_ms - this.#first.began_ms,
      took_ms: 0,
      world_from_view: told?.worldFromView == null ? null : Array.from(told.worldFromView),
      projection: told?.projection == null ? null : Array.from(told.projection),
      camera_px: camera === null ? null : [camera.pinhole.width_px, camera.pinhole.height_px],
      picture: null,
      depth: null,
      resets: (told?.resets ?? []).map((matrix) => (matrix === null ? null : Array.from(matrix))),
    };
    this.#frames.push(traced);
    if (this.#wantsPicture(frame, traced.began_ms)) {
      this.#pictureAt_ms = traced.began_ms;
      this.#reading = this.#keepPicture(frame, traced, this.#frames.length - 1)
        .catch((error: unknown) => { this.problem = error instanceof Error ? error.message : String(error); })
        .finally(() => { this.#reading = null; });
    }
    traced.took_ms = performance.now() - began_ms;
  }

  /** The file. @param told What the browser says of itself. */
  async finish(told: Readonly<Record<string, string>>): Promise<Blob> {
    await this.#reading;
    const trace: Trace = {
      version: TRACE_VERSION, made_s: Date.now() / 1000, told, frames: this.#frames,
    };
    return zipOf(new Map([
      ['README.txt', new Blob([ABOUT])], ['trace.json', new Blob([JSON.stringify(trace)])],
      ...this.#files,
    ]));
  }

  [Symbol.dispose](): void {
    this.#reader[Symbol.dispose]();
  }

  /** One at a time, and no more than the file has room for until the end. */
  #wantsPicture(frame: LiveFrame, now_ms: number): boolean {
    return frame.camera !== null && frame.image !== null && this.#reading === null
      && now_ms - this.#pictureAt_ms >= PICTURE_EVERY_MS
      && this.#bytes <= PICTURES_BYTES * Math.min(1, 0.05 + now_ms / this.duration_ms);
  }

  async #keepPicture(frame: LiveFrame, traced: Writable<TracedFrame>, index: number): Promise<void> {
    const given = frame.told?.depth() ?? null;
    let depth: TracedDepth | null = null;
    let measured: Blob | null = null;
    if (given !== null) {
      const { raw, format } = given;
      measured = new Blob([raw.data]);
      depth = {
        width_px: raw.width, height_px: raw.height, format, metres_per_unit: raw.rawValueToMeters,
        buffer_from_view: Array.from(raw.normDepthBufferFromNormView.matrix),
      };
    }
    const photo = await this.#reader.read(frame);
    if (depth === null && photo.depth !== null) { // it came as a texture
      const { width_px, height_px, depth_mm } = photo.depth;
      measured = new Blob([depth_mm]);
      depth = {
        width_px, height_px, format: 'unsigned-short', metres_per_unit: 0.001,
        buffer_from_view: UPRIGHT,
      };
    }
    const bytes = photo.jpeg.size + (measured?.size ?? 0);
    if (this.#bytes + bytes > PICTURES_BYTES) return;
    this.#bytes += bytes;
    const name = String(index).padStart(6, '0');
    this.#files.set(`pictures/${name}.jpg`, photo.jpeg);
    const { width_px, height_px } = photo.camera.pinhole;
    traced.picture = { width_px, height_px };
    this.pictures += 1;
    if (measured === null) return;
    this.#files.set(`depth/${name}.bin`, measured);
    traced.depth = depth;
    this.withDepth += 1;
  }
}
