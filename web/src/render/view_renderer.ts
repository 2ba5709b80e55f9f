/**
 * What the photographer sees, for every frame: the nearest MPIs are rendered for the live camera,
 * blended, compared with the live picture of the same pose, and drawn.
 *
 *     live ── shrink ──────────────┐
 *     MPIs ── render each ── blend ── fill ┴─ compare ─┬─ count ──► shares (read back, frames later)
 *                              └── opacity ──► filling views    └─ settle ── display
 *                                    grid ──► exposure
 */

import { pinholeScratch, type Camera } from '../geometry';
import type { GpuMpi, MpiStore } from '../mpi/mpi_store';
import type { LiveFrame } from '../sources/frame_source';
import { MAX_NEIGHBOURS, type Options } from '../wire';
import blendFragment from './blend.frag.glsl?raw';
import compareFragment from './compare.frag.glsl?raw';
import displayFragment from './display.frag.glsl?raw';
import { GAIN_STRIDE, measureExposure } from './exposure';
import { Filling, type Drawing } from './filling';
import { LEVELS, type Allowance } from './governor';
import gridFragment from './grid.frag.glsl?raw';
import mpiFragment from './mpi.frag.glsl?raw';
import mpiVertex from './mpi.vert.glsl?raw';
import { drawMpi } from './mpi_quads';
import { NearViews } from './near_views';
import { Program } from './program';
import screenVertex from './screen.vert.glsl?raw';
import { SETTLED_MS, Settling } from './settling';
import shrinkFragment from './shrink.frag.glsl?raw';
import { newProjection } from './projection';
import { NO_SHARES, ShareCounter, type Part, type Shares } from './shares';
import type { Target } from './target';
import { Targets, type RenderedView } from './targets';
import { whyUnfixable, type WhyUnfixable } from './touched';

/** The paper's three pictures: MPI over black, peaks on the video, peaks on the MPI (default). */
export type Overlay = 'mpi' | 'video' | 'peaks';

export interface Look {
  readonly overlay: Overlay;
  /** L1 over RGB, 0…3, above which a pixel is peaked. */
  readonly threshold: number;
  /** Of the red, 0…1. */
  readonly peakOpacity: number;
  /** Stripes of light and dark in place of red. */
  readonly pattern: boolean;
}

/** What a frame showed. Valid until the next one: the object is used again. */
export interface Seen extends Shares {
  /** The views that this frame was rendered from. */
  readonly viewIds: readonly string[];
}

/**
 * What a memory of the scene says of the picture that is compared, at any smaller size: red where no
 * view saw what is there, green where no view will help; 0 or 1.
 */
export interface Remembered {
  readonly texture: WebGLTexture;
  /** Goes up when the texture is new. */
  readonly number: number;
}

/** Exposure is measured again after so many frames: it changes slowly. */
const GAIN_EVERY_FRAMES = 6;

const NOTHING: Seen = { ...NO_SHARES, viewIds: [] };

export class ViewRenderer implements Disposable {
  readonly #gl: WebGL2RenderingContext;
  readonly #options: Options;
  readonly #programs;
  readonly #screen: WebGLVertexArrayObject;
  readonly #sampler: WebGLSampler;
  readonly #units = Int32Array.from({ length: MAX_NEIGHBOURS }, (_, i) => i);
  readonly #quads = { small: pinholeScratch(), projection: newProjection() };
  readonly #near: NearViews;
  readonly #seen: { -readonly [K in keyof Seen]: Seen[K] };
  /** For each of `#near`, where it is rendered to. */
  readonly #places: (RenderedView | null)[] = Array.from({ length: MAX_NEIGHBOURS }, () => null);
  /** Live / view per channel, and the log of that in the corners on top of it. */
  readonly #exposure = new Float32Array([1, 1, 1, 0]);
  readonly #filling: Filling;
  /** Hears of every frame what was rendered, with a number that goes up when that or the picture is new. */
  onRendered: ((number: number, near: NearViews, camera: Camera, targets: Targets) => void) | null = null;
  /**
   * Asked before every comparison: what the memory says of this camera, the picture and the view being in the
   * targets. Without it, or when it returns null, never seen is what the rendering leaves empty.
   */
  remembered: ((camera: Camera, targets: Targets) => Remembered | null) | null = null;
  /** What the result was compared with; -1: no memory. */
  #rememberedNumber = -1;
  /** Nobody else draws into the picture, so one that stands still need not be drawn again. */
  keepsPicture = true;
  /** What is on the canvas, and since when nothing of it was new. */
  readonly #drawn: {
    pictureId: number | null; look: Look | null; compared: boolean; width: number; height: number; new_ms: number;
  } = { pictureId: null, look: null, compared: false, width: 0, height: 0, new_ms: 0 };
  #rendered = 0;
  #allowance = LEVELS[0];
  #targets: Targets | null = null;
  /** What the views of the targets were rendered for: 12 numbers of the pose, then fx, fy, cx, cy. */
  readonly #renderedFor = new Float64Array(16);
  readonly #shares: ShareCounter;
  readonly #settling: Settling;
  #frame = 0;

  /** @throws RangeError More neighbours are asked for than the shader blends. */
  constructor(gl: WebGL2RenderingContext, options: Options) {
    if (options.neighbours > MAX_NEIGHBOURS) {
      throw new RangeError(`need neighbours <= ${MAX_NEIGHBOURS}, got ${options.neighbours}`);
    }
    this.#gl = gl;
    this.#options = options;
    this.#near = new NearViews(options);
    const drawing: Drawing = {
      bind: (unit, texture) => this.#bind(unit, texture),
      cover: () => this.#cover(),
      renderMpi: (mpi, camera, target) => this.#renderMpi(mpi, camera, target),
    };
    this.#filling = new Filling(gl, options.filling_views, drawing);
    this.#shares = new ShareCounter(gl, drawing);
    this.#settling = new Settling(gl, options.marks === 'apart', drawing);
    this.#seen = { ...NOTHING, viewIds: this.#near.ids };
    const onScreen = (fragment: string): Program => new Program(gl, screenVertex, fragment);
    this.#programs = {
      mpi: new Program(gl, mpiVertex, mpiFragment),
      shrink: onScreen(shrinkFragment),
      blend: onScreen(blendFragment),
      compare: onScreen(compareFragment),
      grid: onScreen(gridFragment),
      display: onScreen(displayFragment),
    };
    this.#screen = gl.createVertexArray();
    // Camera textures of WebXR are not ours to set filters on.
    this.#sampler = gl.createSampler();
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  /** Render no more than this from now on. */
  allow(allowance: Allowance): void {
    this.#allowance = allowance;
    this.#near.most = allowance.blended;
    this.#filling.most = allowance.filling;
  }

  /** Render, compare and draw one frame. Leaves the frame's framebuffer bound. */
  draw(frame: LiveFrame, store: MpiStore, look: Look): Seen {
    const { camera, image } = frame;
    if (camera === null || image === null) return NOTHING;
    const gl = this.#gl;
    this.#frame += 1;
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.CULL_FACE);
    gl.disable(gl.BLEND);
    const targets = this.#targetsFor(camera);
    this.#takeReadBacks(targets);
    const near = this.#near;
    near.choose(store, camera);
    this.#filling.choose(store, near, camera, targets);
    if (near.count === 0) {
      this.#shares.forget();
      targets.threshold = NaN; // what is compared again is counted again
      if (!this.#stands(frame, look, false, false)) this.#display(frame, image, targets, look, false);
      return NOTHING;
    }
    // What did not change since the frame before is not computed again.
    const newPicture = frame.pictureId === null || frame.pictureId !== targets.pictureId;
    if (newPicture) this.#shrink(image, camera, targets);
    targets.pictureId = frame.pictureId;
    const newView = this.#renderAndBlend(near, store, camera, targets);
    const changed = newPicture || newView;
    const remembered = this.remembered?.(camera, targets) ?? null;
    const number = remembered?.number ?? -1;
    const compares = changed || look.threshold !== targets.threshold || number !== this.#rememberedNumber;
    if (compares) {
      this.#rememberedNumber = number;
      this.#compare(look, targets, remembered);
    }
    if (changed) targets.unmeasured = true;
    this.#shares.count(targets);
    this.#measureExposure(targets);
    if (changed) this.#rendered += 1;
    this.onRendered?.(this.#rendered, near, camera, targets);
    if (this.#stands(frame, look, compares, true)) this.#settling.rest(frame.time_ms);
    else {
      this.#settling.follow(frame.time_ms, targets);
      this.#display(frame, image, targets, look, true);
    }
    const { now } = this.#shares;
    this.#seen.peakedShare = now.peakedShare;
    this.#seen.wrongShare = now.wrongShare;
    this.#seen.unseenShare = now.unseenShare;
    this.#seen.unfixableShare = now.unfixableShare;
    return this.#seen;
  }

  /**
   * Draw what was rendered last once more, over the frame's own picture, and leave the card to those
   * who read the photo. Draws in full where nothing was rendered yet.
   */
  redraw(frame: LiveFrame, store: MpiStore, look: Look, seen: Seen | null): Seen {
    const targets = this.#targets;
    if (frame.image === null || targets === null || seen === null || seen.viewIds.length === 0) {
      return this.draw(frame, store, look);
    }
    const gl = this.#gl;
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.CULL_FACE);
    gl.disable(gl.BLEND);
    this.#display(frame, frame.image, targets, look, true);
    return seen;
  }

  /** What was last rendered and compared, for tests: RGBA8, bottom row first. */
  targets(): Readonly<Pick<Targets, 'view' | 'result' | 'live' | 'filledFrom'>> | null {
    return this.#targets;
  }

  /** What of the picture is visible on the screen; shares are of that. */
  set visible(part: Part) {
    this.#shares.visible = part;
  }

  /**
   * Why no view will help at a place of the picture, in shares of its size from its top left corner;
   * null where that is not what is marked there. Waits for the card: for a touch, not for every frame.
   */
  whyUnfixable(x: number, y: number): WhyUnfixable | null {
    return this.#targets === null ? null : whyUnfixable(this.#gl, this.#targets, x, y);
  }

  [Symbol.dispose](): void {
    this.#shares[Symbol.dispose]();
    this.#settling[Symbol.dispose]();
    for (const program of Object.values(this.#programs)) program[Symbol.dispose]();
    this.#filling[Symbol.dispose]();
    this.#gl.deleteVertexArray(this.#screen);
    this.#gl.deleteSampler(this.#sampler);
    this.#targets?.[Symbol.dispose]();
    this.#targets = null;
  }

  #targetsFor(camera: Camera): Targets {
    const { width_px, height_px } = camera.pinhole;
    const scale = Math.sqrt(this.#options.pixels * this.#allowance.pixels / (width_px * height_px));
    const width = Math.max(1, Math.round(width_px * scale));
    const height = Math.max(1, Math.round(height_px * scale));
    const before = this.#targets;
    if (before?.live.width === width && before.live.height === height) return before;
    const targets = new Targets(
      this.#gl, width, height, this.#options.neighbours, this.#options.filling_views);
    if (before !== null) targets.goOnFrom(before);
    before?.[Symbol.dispose]();
    this.#targets = targets;
    return targets;
  }

  #shrink(image: WebGLTexture, camera: Camera, targets: Targets): void {
    const { shrink } = this.#programs;
    targets.live.begin();
    shrink.use();
    this.#bind(0, image);
    // Each tap looks at two texels per axis.
    const taps = Math.ceil(camera.pinhole.width_px / targets.live.width / 2 + 0.499);
    this.#gl.uniform1i(shrink.uniform('live'), 0);
    this.#gl.uniform1i(shrink.uniform('taps'), Math.min(Math.max(taps, 1), 4));
    this.#cover();
  }

  /**
   * Where each MPI is rendered to. One that is there already, for this very camera, keeps its place
   * and need not be rendered again: a phone that is held by a tripod, a recording that is stopped.
   */
  #findPlaces({ count, mpis }: NearViews, camera: Camera, targets: Targets): void {
    if (this.#hasMoved(camera)) {
      for (const view of targets.views) view.mpi = null;
    }
    const places = this.#places.fill(null);
    for (const view of targets.views) {
      const k = view.mpi === null ? -1 : mpis.indexOf(view.mpi);
      if (k >= 0 && k < count) places[k] = view;
    }
    for (let k = 0; k < count; k += 1) places[k] ??= this.#freePlace(targets);
  }

  #freePlace(targets: Targets): RenderedView | null {
    for (let i = targets.views.length - 1; i >= 0; i -= 1) {
      const view = targets.views[i];
      if (view !== undefined && !this.#places.includes(view)) return view;
    }
    return null;
  }

  /** Whether this is another camera than that of the frame before. */
  #hasMoved({ pinhole, worldFromCam }: Camera): boolean {
    const before = this.#renderedFor;
    const { rows } = worldFromCam;
    let moved = before[12] !== pinhole.fx_px || before[13] !== pinhole.fy_px
      || before[14] !== pinhole.cx_px || before[15] !== pinhole.cy_px;
    for (let i = 0; i < 12 && !moved; i += 1) moved = rows[i] !== before[i];
    if (!moved) return false;
    before.set(rows);
    before[12] = pinhole.fx_px;
    before[13] = pinhole.fy_px;
    before[14] = pinhole.cx_px;
    before[15] = pinhole.cy_px;
    return true;
  }

  /** Returns whether the view is another one than before. */
  #renderAndBlend(near: NearViews, store: MpiStore, camera: Camera, targets: Targets): boolean {
    this.#findPlaces(near, camera, targets);
    let changed = false;
    for (let k = 0; k < MAX_NEIGHBOURS; k += 1) {
      const mpi = k < near.count ? near.mpis[k] : undefined;
      const view = this.#places[k] ?? null;
      if (mpi !== undefined && view !== null && view.mpi !== mpi) {
        this.#renderMpi(mpi, camera, view.target);
        view.mpi = mpi;
        changed = true;
      }
      const weight = Math.fround(mpi === undefined ? 0 : near.weights[k] ?? 0);
      const target = view?.target ?? null;
      if (targets.weights[k] !== weight || targets.blendedFrom[k] !== target) changed = true;
      targets.weights[k] = weight;
      targets.blendedFrom[k] = target;
    }
    if (this.#filling.find(store, near, targets)) changed = true;
    if (!changed) return false;
    this.#blend(near.count, targets);
    this.#filling.draw(camera, targets);
    return true;
  }

  #renderMpi(mpi: GpuMpi, camera: Camera, target: Target): void {
    const gl = this.#gl;
    const { mpi: program } = this.#programs;
    target.begin();
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    program.use();
    this.#bind(0, mpi.texture);
    drawMpi(gl, program, mpi, camera, target, this.#quads);
  }

  #blend(count: number, targets: Targets): void {
    const gl = this.#gl;
    const { blend } = this.#programs;
    targets.view.begin();
    blend.use();
    for (let k = 0; k < MAX_NEIGHBOURS; k += 1) {
      this.#bind(k, (targets.blendedFrom[k] ?? targets.blendedFrom[0])?.texture ?? null);
    }
    gl.uniform1iv(blend.uniform('views'), this.#units);
    gl.uniform1fv(blend.uniform('weights'), targets.weights);
    gl.uniform1i(blend.uniform('count'), count);
    gl.uniform1i(blend.uniform('opacity_of_seen'), this.#options.opacity === 'seen' ? 1 : 0);
    this.#cover();
  }

  #compare(look: Look, targets: Targets, remembered: Remembered | null): void {
    const gl = this.#gl;
    const { compare } = this.#programs;
    targets.threshold = look.threshold;
    targets.uncounted = true;
    targets.result.begin();
    compare.use();
    this.#bind(0, targets.view.texture);
    this.#bind(1, targets.live.texture);
    this.#bind(2, remembered?.texture ?? targets.view.texture);
    gl.uniform1i(compare.uniform('view'), 0);
    gl.uniform1i(compare.uniform('live'), 1);
    gl.uniform1i(compare.uniform('memory'), 2);
    gl.uniform1i(compare.uniform('remembers'), remembered === null ? 0 : 1);
    gl.uniform4fv(compare.uniform('exposure'), this.#exposure);
    gl.uniform1f(compare.uniform('threshold'), look.threshold);
    gl.uniform1f(compare.uniform('shift_px'), this.#options.shift_px);
    gl.uniform1i(compare.uniform('apart'), this.#options.marks === 'apart' ? 1 : 0);
    this.#cover();
  }

  /** To be called before anything else is asked of the card: copying waits for what it has to do. */
  #takeReadBacks(targets: Targets): void {
    this.#shares.take(targets);
    const samples = targets.gridBack.take();
    if (samples === null) return;
    const { width, height } = targets.view;
    if (measureExposure(samples, width, height, this.#exposure)) targets.threshold = NaN; // compared again
  }

  /** The exposure that is used lags by the frames that reading back takes. */
  #measureExposure(targets: Targets): void {
    if (!this.#options.compensate_exposure) return;
    if (!targets.unmeasured || targets.gridBack.pending) return;
    if (this.#frame % GAIN_EVERY_FRAMES !== 0) return;
    targets.unmeasured = false;
    const gl = this.#gl;
    const { grid } = this.#programs;
    targets.grid.begin();
    grid.use();
    this.#bind(0, targets.view.texture);
    this.#bind(1, targets.live.texture);
    gl.uniform1i(grid.uniform('view'), 0);
    gl.uniform1i(grid.uniform('live'), 1);
    gl.uniform1i(grid.uniform('stride'), GAIN_STRIDE);
    gl.uniform1i(grid.uniform('rows'), targets.grid.height / 2);
    this.#cover();
    targets.gridBack.request();
  }

  /**
   * Whether the canvas shows already what this frame would draw. A phone's own frames begin empty.
   *
   * @param isNew Something of it is.
   * @param compared It is compared with views, so marks settle after it was new.
   */
  #stands(frame: LiveFrame, look: Look, isNew: boolean, compared: boolean): boolean {
    const { time_ms, pictureId, framebuffer, viewport: { width, height } } = frame;
    const last = this.#drawn;
    if (isNew || pictureId === null || pictureId !== last.pictureId || framebuffer !== null
      || !this.keepsPicture || look !== last.look || compared !== last.compared
      || width !== last.width || height !== last.height) {
      last.pictureId = pictureId;
      last.look = look;
      last.compared = compared;
      last.width = width;
      last.height = height;
      last.new_ms = time_ms;
      return false;
    }
    return time_ms - last.new_ms > (compared ? SETTLED_MS : 0);
  }

  #display(
    frame: LiveFrame, image: WebGLTexture, targets: Targets, look: Look, compared: boolean,
  ): void {
    const gl = this.#gl;
    const { display } = this.#programs;
    const { x, y, width, height } = frame.viewport;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame.framebuffer);
    gl.viewport(x, y, width, height);
    display.use();
    this.#bind(0, targets.view.texture);
    this.#bind(1, image);
    this.#bind(2, targets.shown.states.texture);
    gl.uniform1i(display.uniform('view'), 0);
    gl.uniform1i(display.uniform('live'), 1);
    gl.uniform1i(display.uniform('shown'), 2);
    gl.uniform1i(display.uniform('base'), compared && look.overlay !== 'video' ? 0 : 1);
    gl.uniform1i(display.uniform('peaks'), compared && look.overlay !== 'mpi' ? 1 : 0);
    gl.uniform1f(display.uniform('peak_opacity'), look.peakOpacity);
    gl.uniform1i(display.uniform('apart'), this.#options.marks === 'apart' ? 1 : 0);
    gl.uniform1i(display.uniform('pattern'), look.pattern ? 1 : 0);
    this.#cover();
    for (let unit = 0; unit < MAX_NEIGHBOURS; unit += 1) gl.bindSampler(unit, null);
  }

  #bind(unit: number, texture: WebGLTexture | null): void {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.bindSampler(unit, this.#sampler);
  }

  #cover(): void {
    this.#gl.bindVertexArray(this.#screen);
    this.#gl.drawArrays(this.#gl.TRIANGLES, 0, 3);
    this.#gl.bindVertexArray(null);
  }
}
