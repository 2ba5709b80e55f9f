/**
 * The loop of the photographer: a live picture comes, the reconstruction is rendered for its pose,
 * compared and drawn; the shutter adds a view, and its MPI joins when the server has made it.
 */

import type { CaptureSession, CapturedView } from './capture/capture_session';
import { PhotoReader } from './capture/photo';
import type { PictureFault } from './capture/picture_gate';
import { PictureSampler } from './capture/picture_sampler';
import { cameraOfWire, type Camera, type Vector3 } from './geometry';
import { Memory } from './memory/memory';
import { Motion } from './motion';
import { MpiDecoder } from './mpi/decoder';
import { MpiStore } from './mpi/mpi_store';
import { LEVELS, type Allowance, type Governor } from './render/governor';
import type { Part } from './render/shares';
import type { WhyUnfixable } from './render/touched';
import { ViewRenderer, type Look, type Seen } from './render/view_renderer';
import type { LiveFrame, WorldResets } from './sources/frame_source';
import { Timeline } from './timeline';
import { JumpNotice } from './tracking/jump_notice';
import type { TrackingState } from './tracking/pose_correction';
import { PoseTracker } from './tracking/pose_tracker';
import type { Options } from './wire';

/** Why the shutter does nothing now; null when it works. */
export type Hindrance = 'server-not-ready' | 'no-picture' | 'tracking-lost' | 'no-depth' | 'too-fast' | 'busy' | null;

/** What is asked of the shutter, and who hears of it. */
export interface Shot {
  /** Nobody pressed: a picture that is blurred or badly exposed is not kept. */
  readonly automatic: boolean;
  /** This device holds it for good. */
  kept(captureId: string): void;
  /** Something is wrong with the picture; `captureId` is null where it was therefore not kept. */
  faulty(fault: PictureFault, captureId: string | null): void;
}

/** The object is used again at every frame. */
export interface LiveState {
  readonly seen: Seen | null;
  readonly hindrance: Hindrance;
  /** What is wrong with the live picture. */
  readonly fault: PictureFault | null;
  readonly camera: Camera | null;
  /** How far the device's pose is off, as far as is known. */
  readonly tracking: TrackingState;
  /** That the device's world has moved, or null. */
  readonly jumped: string | null;
  /** Towards the largest wrong area outside the picture, in axes of the camera; null: none is known. */
  readonly towards: Vector3 | null;
}

/** How much a frame draws. */
export interface Pace {
  /** Of the governor, and the time that it goes by; null where there is none. */
  readonly level: number | null;
  readonly frame_ms: number | null;
  readonly allowance: Allowance;
  /** Of the rendering. */
  readonly pixels: number;
  /** Views that fill what the blended ones leave empty. */
  readonly filling: number;
}

/** Depth may be late by so many frames after tracking began before its absence is said. */
const DEPTH_PATIENCE_FRAMES = 15;

/** Looking for depth costs a copy on phones, so not at every frame. */
const DEPTH_EVERY_FRAMES = 15;

const MAX_RESIDENT = 12;
/** A picture is kept if nothing is known to be wrong with it by then. */
const JUDGED_WITHIN_MS = 2000;
const NO_RESETS: WorldResets = { followed: 0, lost: 0 };

export class LiveView implements Disposable {
  readonly timeline = new Timeline();
  readonly store: MpiStore;
  /** What gives way on a slow device; null: nothing does. */
  governor: Governor | null = null;
  /** Whether what is taken now would be seen at once. */
  serverIsReady = true;
  look: Look = { overlay: 'peaks', threshold: 0.4, peakOpacity: 1, pattern: false };

  #renderer: ViewRenderer;
  readonly #tracker: PoseTracker;
  /** Null where what is wrong is not told apart, or the card cannot. */
  readonly #memory: Memory | null;
  readonly #decoder = new MpiDecoder();
  readonly #photos: PhotoReader;
  readonly #sampler: PictureSampler;
  readonly #motion = new Motion();
  readonly #jumps = new JumpNotice();
  /** The version of each view's MPI that the store was told of. */
  readonly #known = new Map<string, number>();
  #wanted: Shot | null = null;
  /** A photo is on its way to the session. */
  #busy = false;
  /** The card is giving its pixels. */
  #reading = false;
  #allowance = LEVELS[0];
  #frames = 0;
  #framesWithoutDepth = 0;
  #hasDepth = false;
  readonly #state: { -readonly [K in keyof LiveState]: LiveState[K] };

  constructor(
    gl: WebGL2RenderingContext,
    readonly options: Options,
    readonly session: CaptureSession,
    readonly onProblem: (problem: string) => void,
  ) {
    this.#renderer = new ViewRenderer(gl, options);
    const tracker = new PoseTracker(gl);
    this.#tracker = tracker;
    this.#state = { seen: null, hindrance: 'no-picture', fault: null, camera: null, tracking: tracker.state, jumped: null, towards: null };
    if (options.align_poses === true) {
      this.#renderer.onRendered = (number, near, camera, targets) => tracker.rendered(number, near, camera, targets);
    }
    this.store = new MpiStore(gl, {
      decoder: this.#decoder,
      maxResident: MAX_RESIDENT,
      onProblem: (_, error) => onProblem(`A view cannot be shown: ${String(error)}`),
    });
    this.#memory = options.marks === 'apart' && Memory.supportedBy(gl) ? new Memory(gl, this.store) : null;
    this.#renderer.remembered = this.#memory?.tell ?? null;
    this.store.onResident((id) => this.timeline.mark(id, 'decoded', performance.now()));
    this.#photos = new PhotoReader(gl);
    this.#sampler = new PictureSampler(gl);
    session.subscribe(() => this.#follow(session.views));
    this.#follow(session.views);
  }

  get state(): LiveState {
    return this.#state;
  }

  /** The alignments so far, for tests and for whoever watches the device's load. */
  get tracker(): PoseTracker {
    return this.#tracker;
  }

  /** What is drawn, for tests, benchmarks, and whoever looks why a picture is coarse. */
  get pace(): Pace {
    const targets = this.#renderer.targets();
    return {
      level: this.governor?.level ?? null,
      frame_ms: this.governor?.frame_ms ?? null,
      allowance: this.#allowance,
      pixels: targets === null ? 0 : targets.view.width * targets.view.height,
      filling: targets === null ? 0 : targets.filledFrom.filter((mpi) => mpi !== null).length,
    };
  }

  /** Whether the phone is held so still that a picture is sharp. */
  get steady(): boolean {
    return this.#motion.steady;
  }

  get frames(): number {
    return this.#frames;
  }

  /** Something else draws marks into the picture, so it is drawn anew at every frame. */
  drawAlways(): void {
    this.#renderer.keepsPicture = false;
  }

  /** What of the picture is visible on the screen; shares are of that. */
  set visible(part: Part) {
    this.#renderer.visible = part;
  }

  /** Why no view will help at a place, in shares of the picture from its top left corner; null where that is not marked. */
  whyUnfixable(x: number, y: number): WhyUnfixable | null {
    return this.look.overlay === 'mpi' ? null : this.#renderer.whyUnfixable(x, y);
  }

  /** Ask for a photo: taken from the next frame. */
  shoot(shot: Shot): void {
    if (this.#state.hindrance === null) this.#wanted = shot;
  }

  /** Do no more than this from now on, or until the governor says otherwise. */
  allow(allowance: Allowance): void {
    this.#allowance = allowance;
    this.#renderer.allow(allowance);
    this.#tracker.every_ms = allowance.alignEvery_ms;
    if (this.#memory !== null) this.#memory.everyFrames = allowance.rememberEvery;
  }

  /** To be called for every frame of the source. */
  draw(frame: LiveFrame): void {
    this.#frames += 1;
    if (this.governor?.frame(frame.time_ms) === true) this.allow(this.governor.allowance);
    this.#motion.update(frame.time_ms, frame.camera);
    this.#lookForDepth(frame);
    const shot = this.#wanted;
    if (shot !== null && frame.camera !== null && frame.image !== null) {
      this.#wanted = null;
      this.#busy = true;
      this.#reading = true;
      void this.#take(frame, shot);
    }
    this.#sampler.look(frame);
    const shown = this.#tracker.shown(frame);
    if (!this.#reading) this.#memory?.observe(shown);
    const seen = this.#reading
      ? this.#renderer.redraw(shown, this.store, this.look, this.#state.seen)
      : this.#renderer.draw(shown, this.store, this.look);
    for (const id of seen.viewIds) this.timeline.mark(id, 'drawn', performance.now());
    this.#state.seen = seen;
    this.#state.hindrance = this.#hindrance(frame);
    this.#state.fault = this.#sampler.fault;
    this.#state.camera = frame.camera;
    this.#state.towards = frame.camera === null ? null : this.#memory?.elsewhere(frame.camera) ?? null;
    this.#state.jumped = this.#jumps.of(
      frame.time_ms, this.#tracker.state.jumps, frame.resets ?? NO_RESETS);
  }

  [Symbol.dispose](): void {
    this.#renderer[Symbol.dispose]();
    this.#tracker[Symbol.dispose]();
    this.#memory?.[Symbol.dispose]();
    this.#sampler[Symbol.dispose]();
    this.store[Symbol.dispose]();
  }

  async #take(frame: LiveFrame, shot: Shot): Promise<void> {
    const pressed_ms = performance.now();
    const judged = this.#sampler.next();
    try {
      const correctedWorldFromCam = this.#tracker.suggested(frame);
      const photo = {
        ...await this.#photos.read(this.#tracker.carried(frame)), correctedWorldFromCam,
        automatic: shot.automatic,
      };
      this.#reading = false;
      const read_ms = performance.now();
      if (shot.automatic) {
        const fault = await Promise.race([judged, nothingAfter(JUDGED_WITHIN_MS)]);
        if (fault !== null) return shot.faulty(fault, null);
      }
      const id = await this.session.shutter(photo);
      this.timeline.mark(id, 'shutter', pressed_ms);
      this.timeline.mark(id, 'photo', read_ms);
      this.timeline.mark(id, 'kept', performance.now());
      shot.kept(id);
      if (!shot.automatic) void judged.then((fault) => { if (fault !== null) shot.faulty(fault, id); });
    } catch (error) {
      this.onProblem(error instanceof Error ? error.message : String(error));
    } finally {
      this.#reading = false;
      this.#busy = false;
    }
  }

  /** Bring the store to what the session has: ready views in, undone ones out. */
  #follow(views: readonly CapturedView[]): void {
    const now_ms = performance.now();
    const present = new Set<string>();
    for (const view of views) {
      present.add(view.id);
      if (view.state === 'queued' || view.state === 'ready') {
        this.timeline.mark(view.id, 'acknowledged', now_ms);
      }
      if (view.state !== 'ready') continue;
      this.timeline.mark(view.id, 'ready', now_ms);
      const known = this.#known.get(view.id);
      const version = view.mpiVersion;
      if (known !== undefined && known >= version) continue;
      this.#known.set(view.id, version);
      const load = async (): Promise<ArrayBuffer> => {
        const bytes = await this.session.mpiBytes(view.id, version);
        this.timeline.mark(view.id, 'fetched', performance.now());
        return bytes;
      };
      if (known === undefined) this.store.add(view.id, cameraOfWire(view.camera), load);
      else this.store.replace(view.id, load);
    }
    for (const id of Array.from(this.#known.keys())) {
      if (present.has(id)) continue;
      this.#known.delete(id);
      this.store.remove(id);
    }
  }

  #lookForDepth(frame: LiveFrame): void {
    if (frame.camera === null) return;
    if (this.#hasDepth && this.#frames % DEPTH_EVERY_FRAMES !== 0) return;
    this.#hasDepth = frame.hasDepth();
    this.#framesWithoutDepth = this.#hasDepth ? 0 : this.#framesWithoutDepth + 1;
  }

  #hindrance(frame: LiveFrame): Hindrance {
    if (!this.serverIsReady) return 'server-not-ready';
    if (frame.camera === null) return this.#frames > 1 ? 'tracking-lost' : 'no-picture';
    if (frame.image === null) return 'no-picture';
    if (this.#busy) return 'busy';
    if (!this.#hasDepth && this.options.depth_model == null) return 'no-depth';
    if (this.#motion.tooFast) return 'too-fast';
    return null;
  }

  /** Depth has been missing for so long that it should be said. */
  get depthIsMissing(): boolean {
    return this.#framesWithoutDepth > DEPTH_PATIENCE_FRAMES;
  }
}

function nothingAfter(time_ms: number): Promise<null> {
  return new Promise((resolve) => setTimeout(() => resolve(null), time_ms));
}
