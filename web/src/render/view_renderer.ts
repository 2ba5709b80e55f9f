/**
 * What the photographer sees, for every frame: the nearest MPIs are rendered for the live camera,
 * blended, compared with the live picture of the same pose, and drawn.
 *
 *     live ── shrink ────────┐
 *     MPIs ── blended view ──┴─ compare ─┬─ count ──► shares (read back, frames later)
 *                            └─ grid ──► exposure   └─ settle ── display
 */

import type { Camera } from '../geometry';
import type { MpiStore } from '../mpi/mpi_store';
import type { LiveFrame } from '../sources/frame_source';
import { MAX_NEIGHBOURS, type Options } from '../wire';
import { BlendedView } from './blended_view';
import compareFragment from './compare.frag.glsl?raw';
import displayFragment from './display.frag.glsl?raw';
import { GAIN_STRIDE, measureExposure } from './exposure';
import { LEVELS, type Allowance } from './governor';
import gridFragment from './grid.frag.glsl?raw';
import type { NearViews } from './near_views';
import { Program } from './program';
import type { Screen } from './screen';
import screenVertex from './screen.vert.glsl?raw';
import { SETTLED_MS, Settling } from './settling';
import shrinkFragment from './shrink.frag.glsl?raw';
import { NO_SHARES, ShareCounter, type Part, type Shares } from './shares';
import { Targets } from './targets';
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
  readonly #screen: Screen;
  readonly #view: BlendedView;
  readonly #seen: { -readonly [K in keyof Seen]: Seen[K] };
  /** Live / view per channel, and the log of that in the corners on top of it. */
  readonly #exposure = new Float32Array([1, 1, 1, 0]);
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
  readonly #shares: ShareCounter;
  readonly #settling: Settling;
  #frame = 0;

  /** @throws RangeError More neighbours are asked for than the shader blends. */
  constructor(gl: WebGL2RenderingContext, options: Options) {
    this.#gl = gl;
    this.#options = options;
    this.#view = new BlendedView(gl, options);
    this.#screen = this.#view.screen;
    const { drawing } = this.#view;
    this.#shares = new ShareCounter(gl, drawing);
    this.#settling = new Settling(gl, options.marks === 'apart', drawing);
    this.#seen = { ...NOTHING, viewIds: this.#view.near.ids };
    const onScreen = (fragment: string): Program => new Program(gl, screenVertex, fragment);
    this.#programs = {
      shrink: onScreen(shrinkFragment),
      compare: onScreen(compareFragment),
      grid: onScreen(gridFragment),
      display: onScreen(displayFragment),
    };
  }

  /** Render no more than this from now on. */
  allow(allowance: Allowance): void {
    this.#allowance = allowance;
    this.#view.allow(allowance);
  }

  /** Render, compare and draw one frame. Leaves the frame's framebuffer bound. */
  draw(frame: LiveFrame, store: MpiStore, look: Look): Seen {
    const { camera, image } = frame;
    if (camera === null || image === null) return NOTHING;
    this.#frame += 1;
    this.#screen.reset();
    const targets = this.#targetsFor(camera);
    this.#takeReadBacks(targets);
    const { near } = this.#view;
    this.#view.choose(store, camera, targets);
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
    const newView = this.#view.render(store, camera, targets);
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
    this.#screen.reset();
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
    this.#view[Symbol.dispose]();
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
    this.#screen.bind(0, image);
    // Each tap looks at two texels per axis.
    const taps = Math.ceil(camera.pinhole.width_px / targets.live.width / 2 + 0.499);
    this.#gl.uniform1i(shrink.uniform('live'), 0);
    this.#gl.uniform1i(shrink.uniform('taps'), Math.min(Math.max(taps, 1), 4));
    this.#screen.cover();
  }

  #compare(look: Look, targets: Targets, remembered: Remembered | null): void {
    const gl = this.#gl;
    const { compare } = this.#programs;
    targets.threshold = look.threshold;
    targets.uncounted = true;
    targets.result.begin();
    compare.use();
    this.#screen.bind(0, targets.view.texture);
    this.#screen.bind(1, targets.live.texture);
    this.#screen.bind(2, remembered?.texture ?? targets.view.texture);
    gl.uniform1i(compare.uniform('view'), 0);
    gl.uniform1i(compare.uniform('live'), 1);
    gl.uniform1i(compare.uniform('memory'), 2);
    gl.uniform1i(compare.uniform('remembers'), remembered === null ? 0 : 1);
    gl.uniform4fv(compare.uniform('exposure'), this.#exposure);
    gl.uniform1f(compare.uniform('threshold'), look.threshold);
    gl.uniform1f(compare.uniform('shift_px'), this.#options.shift_px);
    gl.uniform1i(compare.uniform('apart'), this.#options.marks === 'apart' ? 1 : 0);
    this.#screen.cover();
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
    this.#screen.bind(0, targets.view.texture);
    this.#screen.bind(1, targets.live.texture);
    gl.uniform1i(grid.uniform('view'), 0);
    gl.uniform1i(grid.uniform('live'), 1);
    gl.uniform1i(grid.uniform('stride'), GAIN_STRIDE);
    gl.uniform1i(grid.uniform('rows'), targets.grid.height / 2);
    this.#screen.cover();
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
    this.#screen.bind(0, targets.view.texture);
    this.#screen.bind(1, image);
    this.#screen.bind(2, targets.shown.states.texture);
    gl.uniform1i(display.uniform('view'), 0);
    gl.uniform1i(display.uniform('live'), 1);
    gl.uniform1i(display.uniform('shown'), 2);
    gl.uniform1i(display.uniform('base'), compared && look.overlay !== 'video' ? 0 : 1);
    gl.uniform1i(display.uniform('peaks'), compared && look.overlay !== 'mpi' ? 1 : 0);
    gl.uniform1f(display.uniform('peak_opacity'), look.peakOpacity);
    gl.uniform1i(display.uniform('apart'), this.#options.marks === 'apart' ? 1 : 0);
    gl.uniform1i(display.uniform('pattern'), look.pattern ? 1 : 0);
    this.#screen.cover();
    this.#screen.release(MAX_NEIGHBOURS);
  }
}
