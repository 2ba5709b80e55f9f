/**
 * A guided capture, from the scan to the last target. Pure but for what it is told: poses, depth maps
 * and the views that were taken.
 */

import {
  angleBetween, copyOfCamera, distanceBetween, pinholeScratch, resized, rigid, type Cam,
  type Camera, type Rigid, type World,
} from '../geometry';
import { integer, list, number, parseKept, record, text } from '../schema';
import type { DepthMap } from '../sources/frame_source';
import { MAX_GUIDED_TARGETS, type Options } from '../wire';
import { nextTarget, numTaken, progress, withinReach, type Guide, type TakenBy } from './guide';
import type { GuideOptions } from './guide_options';
import { hemisphere } from './hemisphere';
import { planeStack, plenopticBound, plenopticGrid, type PlenopticBound } from './plenoptic';
import { DepthScan, middleDepth } from './scan';

/** What a session is begun again with after a reload. */
export interface GuideMemory {
  load(): string | null;
  save(text: string | null): void;
}

export type GuidePhase = 'scan' | 'capture' | 'done';

/** The object is used again at every frame; `guide`, `bound` and `takenBy` are new when they change. */
export interface GuideState {
  readonly phase: GuidePhase;
  /** Least depth of the scan, so far or for good; null until three maps have confirmed one. */
  readonly zMin_m: number | null;
  /** Depth maps that took part in the scan. */
  readonly scanned: number;
  /** What the scan asks for, so far or for good. */
  readonly bound: PlenopticBound | null;
  /** Null until the targets are placed. */
  readonly guide: Guide | null;
  readonly takenBy: TakenBy;
  readonly taken: number;
  readonly next: number | null;
  /** The target that a view would take now. */
  readonly reach: number | null;
  /** From the camera to the next target, in the camera's axes: right, down, ahead. */
  readonly toNext_m: readonly [number, number, number] | null;
}

/** Where the targets were placed, and what of the scan they follow from. */
interface Placement {
  readonly worldFromAnchor: Rigid<World, Cam>;
  readonly zMin_m: number;
  readonly radius_m: number;
  readonly bound: PlenopticBound;
}

/** What gives depth: a frame of the source. */
export interface DepthGiver {
  depth(): DepthMap | null;
}

/** A depth map counts in the scan when the camera has moved by one of these since the last one. */
const SCAN_STEP_M = 0.005;
const SCAN_STEP_RAD = 0.01;
/** Looking for depth costs a copy on phones, so not at every frame. */
const SCAN_EVERY_FRAMES = 4;
/** The automatic shutter waits until the camera has been held at a target for so long. */
const HOLD_MS = 350;

export class GuideSession {
  autoShutter: boolean;
  #scan = new DepthScan();
  #lastScanned: Camera | null = null;
  #lastMiddle_m: number | null = null;
  #frames = 0;
  #placement: Placement | null = null;
  #guide: Guide | null = null;
  #views: readonly unknown[] | null = null;
  #takenBy: TakenBy = [];
  #reachedAt_ms: number | null = null;
  readonly #toNext_m: [number, number, number] = [0, 0, 0];
  readonly #small = pinholeScratch();
  /** What `#bound` is of: z_min, width and focal length of the MPI. */
  readonly #boundFor = new Float64Array(3);
  #bound: PlenopticBound | null = null;
  readonly #state: { -readonly [K in keyof GuideState]: GuideState[K] } = {
    phase: 'scan', zMin_m: null, scanned: 0, bound: null, guide: null, takenBy: [], taken: 0,
    next: null, reach: null, toNext_m: null,
  };

  constructor(
    readonly options: GuideOptions, readonly mpi: Pick<Options, 'pixels' | 'num_planes'>,
    readonly memory: GuideMemory,
  ) {
    this.autoShutter = options.autoShutter;
    this.#remember();
  }

  get state(): GuideState {
    return this.#state;
  }

  /** Tell a frame; its depth is asked for only where it is needed. */
  update(
    time_ms: number, camera: Camera | null, frame: DepthGiver,
    views: readonly { readonly camera: Camera }[],
  ): GuideState {
    this.#frames += 1;
    if (this.#guide === null) this.#look(camera, frame);
    else if (this.#views !== views) {
      this.#views = views;
      this.#takenBy = progress(this.#guide, views.map((view) => view.camera));
    }
    this.#follow(camera);
    if (this.#state.reach === null) this.#reachedAt_ms = null;
    else this.#reachedAt_ms ??= time_ms;
    return this.#state;
  }

  /** The camera has been held at an open target for long enough. */
  held(time_ms: number): boolean {
    return this.autoShutter && this.#reachedAt_ms !== null
      && time_ms - this.#reachedAt_ms >= HOLD_MS;
  }

  /** End the scan: the targets are put around where the camera is now. @returns A problem, or null. */
  place(camera: Camera | null): string | null {
    const { zMin_m, bound } = this.#state;
    if (camera === null) return 'Tracking is lost. Place the targets when it is back.';
    if (zMin_m === null || bound === null) return 'Look around first, until a depth is shown.';
    const placement = {
      worldFromAnchor: rigid<World, Cam>(camera.worldFromCam.rows), zMin_m, bound, radius_m: this.#lastMiddle_m ?? zMin_m,
    };
    const guide = this.#guideOf(placement);
    if (guide.targets.length > MAX_GUIDED_TARGETS) {
      return `The nearest object is ${zMin_m.toFixed(2)} m away, so ${guide.targets.length} views `
        + 'would be needed. Scan again from farther away, or choose a smaller area.';
    }
    this.#placement = placement;
    this.#guide = guide;
    this.#views = null;
    this.memory.save(JSON.stringify({
      kind: this.options.kind,
      anchor: Array.from(placement.worldFromAnchor.rows),
      zMin_m, radius_m: placement.radius_m, bound,
    }));
    return null;
  }

  /** Forget z_min and the targets; views that were taken stay. */
  scanAgain(): void {
    this.#scan = new DepthScan();
    this.#lastScanned = null;
    this.#placement = null;
    this.#guide = null;
    this.#takenBy = [];
    this.memory.save(null);
  }

  #look(camera: Camera | null, frame: DepthGiver): void {
    if (camera === null || this.#frames % SCAN_EVERY_FRAMES !== 0) return;
    const last = this.#lastScanned?.worldFromCam;
    // The same noise twice would confirm itself.
    if (last !== undefined && distanceBetween(last, camera.worldFromCam) < SCAN_STEP_M
      && angleBetween(last, camera.worldFromCam) < SCAN_STEP_RAD) return;
    const map = frame.depth();
    if (map === null) return;
    this.#scan.add(map);
    this.#lastScanned = copyOfCamera(camera);
    this.#lastMiddle_m = middleDepth(map) ?? this.#lastMiddle_m;
  }

  /** Bring the state to this frame. */
  #follow(camera: Camera | null): void {
    const state = this.#state;
    const guide = this.#guide;
    state.zMin_m = this.#placement?.zMin_m ?? this.#scan.zMin_m;
    state.scanned = this.#scan.frames;
    if (state.zMin_m === null) state.bound = null;
    else state.bound = this.#placement?.bound ?? this.#boundOf(camera, state.zMin_m) ?? state.bound;
    state.guide = guide;
    state.takenBy = this.#takenBy;
    state.taken = numTaken(this.#takenBy);
    if (guide === null) {
      state.phase = 'scan';
      state.next = null;
      state.reach = null;
      state.toNext_m = null;
      return;
    }
    state.phase = state.taken === guide.targets.length ? 'done' : 'capture';
    if (camera !== null) state.next = nextTarget(guide, camera, this.#takenBy);
    state.reach = camera === null ? null : withinReach(guide, camera, this.#takenBy);
    const next = state.next === null ? undefined : guide.targets[state.next];
    state.toNext_m = camera === null || next === undefined ? null
      : offset(camera, next, this.#toNext_m);
  }

  /** Of the MPIs that are made of such pictures; the same object until one of its numbers changes. */
  #boundOf(camera: Camera | null, zMin_m: number): PlenopticBound | null {
    if (camera === null) return null;
    const { width_px, height_px } = camera.pinhole;
    const scale = Math.sqrt(this.mpi.pixels / (width_px * height_px));
    const small = resized(camera.pinhole, Math.round(width_px * scale),
      Math.round(height_px * scale), this.#small);
    const given = this.#boundFor;
    if (this.#bound !== null && given[0] === zMin_m && given[1] === small.width_px
      && given[2] === small.fx_px) return this.#bound;
    given[0] = zMin_m;
    given[1] = small.width_px;
    given[2] = small.fx_px;
    this.#bound = plenopticBound(small, zMin_m, this.options.areaSide_m, this.mpi.num_planes);
    return this.#bound;
  }

  #guideOf({ worldFromAnchor, bound, radius_m }: Placement): Guide {
    const { kind, nearEnough, step_rad, extent_rad } = this.options;
    switch (kind) {
      case 'plenoptic': return plenopticGrid(worldFromAnchor, bound, nearEnough);
      case 'planes': return planeStack(worldFromAnchor, bound, nearEnough);
      case 'hemisphere':
        return hemisphere(worldFromAnchor, { radius_m, step_rad, extent_rad }, nearEnough);
      default: return kind satisfies never;
    }
  }

  /** Go on where a reload interrupted. */
  #remember(): void {
    const kept = this.memory.load();
    if (kept === null) return;
    const placed = parseKept(placedSchema, kept);
    // Written by another version: the scan begins anew.
    if (placed === null) return this.memory.save(null);
    const { kind, anchor, zMin_m, radius_m, bound } = placed;
    if (kind !== this.options.kind || bound.areaSide_m !== this.options.areaSide_m) return;
    this.#placement = { worldFromAnchor: rigid(anchor), zMin_m, radius_m, bound };
    this.#guide = this.#guideOf(this.#placement);
  }
}

/** What is remembered of a placement. */
const placedSchema = record<{
  readonly kind: string; readonly anchor: readonly number[]; readonly zMin_m: number;
  readonly radius_m: number; readonly bound: PlenopticBound;
}>({
  kind: text,
  anchor: list(number(), 12, 12),
  zMin_m: number(0),
  radius_m: number(0),
  bound: record<PlenopticBound>({
    areaSide_m: number(0), spacing_m: number(0), numViewsExact: number(0), numViews: integer(0),
    viewsPerSide: integer(0), pitch_m: number(0), tanHalfFov: number(0),
  }),
});

/** The target's position in the camera's axes: the inverse of the camera's pose, applied to it. */
function offset(
  camera: Camera, target: Rigid<World, Cam>, out: [number, number, number],
): readonly [number, number, number] {
  const m = camera.worldFromCam.rows;
  const x = (target.rows[3] ?? NaN) - (m[3] ?? NaN);
  const y = (target.rows[7] ?? NaN) - (m[7] ?? NaN);
  const z = (target.rows[11] ?? NaN) - (m[11] ?? NaN);
  out[0] = (m[0] ?? NaN) * x + (m[4] ?? NaN) * y + (m[8] ?? NaN) * z;
  out[1] = (m[1] ?? NaN) * x + (m[5] ?? NaN) * y + (m[9] ?? NaN) * z;
  out[2] = (m[2] ?? NaN) * x + (m[6] ?? NaN) * y + (m[10] ?? NaN) * z;
  return out;
}
