/** Keeps the rendering where the live picture was really taken from: `LiveView` asks it every frame. */

import {
  composeInto, identity, inverse, pinholeScratch, resized, type Cam, type Camera, type Rigid, type World,
} from '../geometry';
import { AlignPictures } from '../render/align_pictures';
import type { NearViews } from '../render/near_views';
import type { Target } from '../render/target';
import type { DepthMap, LiveFrame, Viewport, WorldResets } from '../sources/frame_source';
import type { AlignLens } from './align';
import type { AlignReply, AlignRequest } from './align_worker';
import { PoseCorrection, type TrackingState } from './pose_correction';

/** Alignments begin no more often than this. */
const EVERY_MS = 60;
/** A picture that stands still is aligned so often: each time its rendering is another one by a hair. */
const MOST_OF_ONE = 8;
/** A pose whose parts are all known better than this is known as a whole: half the prior. */
const SURE_SD_M = 0.005;

/** A frame as it came, but for its camera. */
class MovedFrame implements LiveFrame {
  time_ms = 0;
  readonly #pinhole = pinholeScratch();
  readonly #camera: Camera = { pinhole: this.#pinhole, worldFromCam: identity<World, Cam>() };
  #frame: LiveFrame | null = null;

  /** @returns The pose of the frame, to be written. */
  begin(frame: LiveFrame, camera: Camera): Rigid<World, Cam> {
    this.#frame = frame;
    this.time_ms = frame.time_ms;
    Object.assign(this.#pinhole, camera.pinhole);
    return this.#camera.worldFromCam;
  }

  get camera(): Camera { return this.#camera; }

  get image(): WebGLTexture | null { return this.#frame?.image ?? null; }

  get pictureId(): number | null { return this.#frame?.pictureId ?? null; }

  get framebuffer(): WebGLFramebuffer | null { return this.#frame?.framebuffer ?? null; }

  get viewport(): Viewport { return this.#frame?.viewport ?? NOWHERE; }

  get resets(): WorldResets { return this.#frame?.resets ?? NEVER; }

  hasDepth(): boolean { return this.#frame?.hasDepth() ?? false; }

  depth(): DepthMap | null { return this.#frame?.depth() ?? null; }
}

interface Rendered {
  readonly view: Target;
  readonly live: Target;
}

const NEVER: WorldResets = { followed: 0, lost: 0 };
const NOWHERE: Viewport = { x: 0, y: 0, width: 1, height: 1 };

export class PoseTracker implements Disposable {
  /** How long the last alignment took in its worker. */
  took_ms: number | null = null;
  /** Alignments that succeeded, and that did not. */
  succeeded = 0;
  failed = 0;
  /** Alignments begin no more often than this: to be raised where the device is slow. */
  every_ms = EVERY_MS;

  readonly #gl: WebGL2RenderingContext;
  readonly #correction = new PoseCorrection();
  readonly #supported: boolean;
  #pictures: AlignPictures | null = null;
  #worker: Worker | null = null;
  /** What is on its way: from the card, then in the worker. */
  #busy: 'reading' | 'aligning' | null = null;
  #begun_ms = -Infinity;
  /** The rendering that was aligned last. */
  #aligned = -1;
  #lastSucceeded = false;
  /** The picture that is shown, and how often it was aligned from where the device is. */
  #pictureId: number | null = null;
  #ofOne = 0;
  #spare = new ArrayBuffer(0);
  readonly #shownFrame = new MovedFrame();
  readonly #carriedFrame = new MovedFrame();
  /** Of the frame that is drawn, and of the one that is aligned. */
  #time_ms = 0;
  readonly #device = identity<World, Cam>();
  readonly #alignedDevice = identity<World, Cam>();
  readonly #alignedRendered = identity<World, Cam>();
  readonly #liveFromCam = identity<Cam, Cam>();
  readonly #camFromLive = identity<Cam, Cam>();
  readonly #corrected = identity<World, Cam>();
  readonly #small = pinholeScratch();
  readonly #lens: { -readonly [K in keyof AlignLens]: AlignLens[K] } = { fx_px: 1, fy_px: 1, cx_px: 0, cy_px: 0 };

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#supported = AlignPictures.supportedBy(gl);
  }

  get state(): TrackingState {
    return this.#correction.state;
  }

  /** The frame as it is to be rendered and compared. Valid until the next one. */
  shown(frame: LiveFrame): LiveFrame {
    this.#takeBack();
    const { camera } = frame;
    if (camera === null) return frame;
    this.#time_ms = frame.time_ms;
    const { rows } = camera.worldFromCam;
    if (frame.pictureId === null || frame.pictureId !== this.#pictureId
      || !isSame(this.#device.rows, rows)) this.#ofOne = 0;
    this.#pictureId = frame.pictureId;
    this.#device.rows.set(rows);
    this.#correction.shown(frame.time_ms, camera.worldFromCam, this.#shownFrame.begin(frame, camera));
    return this.#shownFrame;
  }

  /** The frame as it is to be captured: where the device says, but for jumps. */
  carried(frame: LiveFrame): LiveFrame {
    const { camera } = frame;
    if (camera === null || this.state.jumps === 0) return frame;
    this.#correction.carried(camera.worldFromCam, this.#carriedFrame.begin(frame, camera));
    return this.#carriedFrame;
  }

  /** Where the frame was taken, as far as is known; made anew. */
  suggested(frame: LiveFrame): Rigid<World, Cam> | null {
    return frame.camera === null ? null
      : this.#correction.suggested(frame.time_ms, frame.camera.worldFromCam, identity());
  }

  /** To be called for what was rendered for the frame that `shown` gave last. */
  rendered(number: number, near: NearViews, camera: Camera, { view, live }: Rendered): void {
    if (!this.#supported) return;
    if (number === this.#aligned || this.#ofOne >= MOST_OF_ONE) {
      if (this.#busy === null && this.#lastSucceeded) this.#correction.stands(this.#time_ms);
      return;
    }
    if (this.#busy !== null || this.#time_ms - this.#begun_ms < this.every_ms) return;
    this.#aligned = number;
    this.#ofOne += 1;
    if (this.#pictures?.fits(view) !== true) {
      this.#pictures?.[Symbol.dispose]();
      this.#pictures = new AlignPictures(this.#gl, view);
    }
    const { width, height } = this.#pictures;
    this.#pictures.request(near, camera, view, live);
    this.#busy = 'reading';
    this.#begun_ms = this.#time_ms;
    this.#alignedDevice.rows.set(this.#device.rows);
    this.#alignedRendered.rows.set(camera.worldFromCam.rows);
    const small = resized(camera.pinhole, width, height, this.#small);
    // GL's rows begin at the bottom.
    this.#lens.fx_px = small.fx_px;
    this.#lens.fy_px = -small.fy_px;
    this.#lens.cx_px = small.cx_px;
    this.#lens.cy_px = height - small.cy_px;
  }

  [Symbol.dispose](): void {
    this.#pictures?.[Symbol.dispose]();
    this.#worker?.terminate();
  }

  #takeBack(): void {
    if (this.#busy !== 'reading' || this.#pictures === null) return;
    const pixels = this.#pictures.take();
    if (pixels === null) return;
    if (this.#spare.byteLength !== pixels.byteLength) this.#spare = new ArrayBuffer(pixels.byteLength);
    new Uint8Array(this.#spare).set(pixels);
    const { width, height } = this.#pictures;
    const request: AlignRequest = { width, height, lens: this.#lens, pictures: this.#spare };
    this.#busy = 'aligning';
    this.#workerOfOwn().postMessage(request, [this.#spare]);
  }

  #workerOfOwn(): Worker {
    if (this.#worker !== null) return this.#worker;
    const worker = new Worker(new URL('./align_worker.ts', import.meta.url), { type: 'module' });
    worker.onmessage = (event: MessageEvent<AlignReply>) => this.#hear(event.data);
    worker.onerror = () => { this.#busy = null; };
    this.#worker = worker;
    return worker;
  }

  #hear({ failure, liveFromCam, moveSd_m, took_ms, pictures }: AlignReply): void {
    this.#busy = null;
    this.#spare = pictures;
    this.took_ms = took_ms;
    this.#lastSucceeded = failure === null;
    if (!this.#lastSucceeded) {
      this.failed += 1;
      return;
    }
    this.succeeded += 1;
    this.#liveFromCam.rows.set(liveFromCam);
    inverse(this.#liveFromCam, this.#camFromLive);
    composeInto(this.#alignedRendered, this.#camFromLive, this.#corrected);
    const sure = Math.max(...moveSd_m) < SURE_SD_M;
    this.#correction.found(this.#time_ms, this.#alignedDevice, this.#corrected, sure);
    if (this.#correction.asksAgain) this.#aligned = -1;
  }
}

function isSame(a: Float64Array, b: Float64Array): boolean {
  for (let i = 0; i < a.length; i += 1) if (a[i] !== b[i]) return false;
  return true;
}
