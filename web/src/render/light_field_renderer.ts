/** Draws a light field for a free camera: no live picture, nothing compared. */

import type { Camera } from '../geometry';
import type { MpiStore } from '../mpi/mpi_store';
import { MAX_NEIGHBOURS } from '../wire';
import { BlendedView, type BlendOptions } from './blended_view';
import type { Allowance } from './governor';
import { LEVELS } from './governor';
import { Program } from './program';
import screenVertex from './screen.vert.glsl?raw';
import { ViewTargets } from './view_targets';
import walkFragment from './walk.frag.glsl?raw';

/** Rendering twice, to the view and to the screen, blurs a little: so many more pixels than the views have. */
const FINER = 1.25;

/** What is empty is asked for every sixth frame, comes a few later, and views that fill must be fetched. */
const SETTLING_FRAMES = 24;

export class LightFieldRenderer implements Disposable {
  readonly #gl: WebGL2RenderingContext;
  readonly #options: BlendOptions;
  readonly #view: BlendedView;
  readonly #walk: Program;
  #targets: ViewTargets | null = null;
  #allowance = LEVELS[0];
  #sameFrames = 0;
  /** The longest focal lengths of all views so far, in their pixels: as fine as any of them is. */
  #finest_px = 0;

  /** @throws RangeError More neighbours are asked for than the shader blends. */
  constructor(gl: WebGL2RenderingContext, options: BlendOptions) {
    this.#gl = gl;
    this.#options = options;
    this.#view = new BlendedView(gl, options);
    this.#walk = new Program(gl, screenVertex, walkFragment);
  }

  /** Render no more than this from now on. */
  allow(allowance: Allowance): void {
    this.#allowance = allowance;
    this.#view.allow(allowance);
    this.#sameFrames = 0;
  }

  /** The views that the last frame was rendered from. */
  get viewIds(): readonly string[] {
    return this.#view.near.ids;
  }

  /** Whether the view that was taken nearest is in the picture. */
  get showsNearest(): boolean {
    const { closest, ids } = this.#view.near;
    return closest !== null && ids.includes(closest);
  }

  /** What was rendered last, for tests: RGBA8, premultiplied, bottom row first. */
  get targets(): ViewTargets | null {
    return this.#targets;
  }

  /** Whether nothing would change if it were drawn again, unless views come or the camera moves. */
  get settled(): boolean {
    return this.#sameFrames > SETTLING_FRAMES;
  }

  /** Views came or went, or the canvas was emptied. */
  invalidate(): void {
    this.#sameFrames = 0;
  }

  /**
   * Draw into the canvas.
   *
   * @param camera Of the size of the canvas.
   * @param pixelRatio Pixels of the canvas per pixel of the page.
   * @returns Whether the picture is another one than before.
   */
  draw(camera: Camera, store: MpiStore, pixelRatio: number): boolean {
    const gl = this.#gl;
    this.#view.screen.reset();
    const before = this.#targets;
    const targets = this.#targetsFor(camera);
    this.#view.choose(store, camera, targets);
    const { count } = this.#view.near;
    const changed = this.#view.render(store, camera, targets) || targets !== before;
    this.#sameFrames = changed || count === 0 ? 0 : this.#sameFrames + 1;
    if (!changed && this.#sameFrames > 1) return false;
    const { width_px, height_px } = camera.pinhole;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width_px, height_px);
    this.#walk.use();
    this.#view.screen.bind(0, targets.view.texture);
    gl.uniform1i(this.#walk.uniform('view'), 0);
    gl.uniform1f(this.#walk.uniform('pixel_ratio'), pixelRatio);
    this.#view.screen.cover();
    this.#view.screen.release(MAX_NEIGHBOURS);
    return changed;
  }

  [Symbol.dispose](): void {
    this.#view[Symbol.dispose]();
    this.#walk[Symbol.dispose]();
    this.#targets?.[Symbol.dispose]();
    this.#targets = null;
  }

  /** No more pixels than the views have for what the camera sees, and never more than the canvas. */
  #targetsFor({ pinhole }: Camera): ViewTargets {
    const { near } = this.#view;
    for (let k = 0; k < near.count; k += 1) {
      this.#finest_px = Math.max(this.#finest_px, near.mpis[k]?.camera.pinhole.fx_px ?? 0);
    }
    const finest = this.#finest_px === 0 ? 1 : (FINER * this.#finest_px) / pinhole.fx_px;
    const scale = Math.min(finest, 1) * Math.sqrt(this.#allowance.pixels);
    const width = Math.max(1, Math.round(pinhole.width_px * scale));
    const height = Math.max(1, Math.round(pinhole.height_px * scale));
    const before = this.#targets;
    if (before?.width === width && before.height === height) return before;
    before?.[Symbol.dispose]();
    const { neighbours, filling_views } = this.#options;
    this.#targets = new ViewTargets(this.#gl, width, height, neighbours, filling_views);
    return this.#targets;
  }
}
