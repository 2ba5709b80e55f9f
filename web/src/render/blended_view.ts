/**
 * The view of a light field from a camera: the nearest MPIs are rendered, blended, and filled where
 * they leave it empty. What did not change since the frame before is not computed again.
 *
 *     MPIs ── render each ── blend ── fill ──► view
 *                              └── opacity ──► filling views
 */

import { pinholeScratch, type Camera } from '../geometry';
import type { GpuMpi, MpiStore } from '../mpi/mpi_store';
import { MAX_NEIGHBOURS, type Options } from '../wire';
import blendFragment from './blend.frag.glsl?raw';
import { Filling, type Drawing } from './filling';
import type { Allowance } from './governor';
import mpiFragment from './mpi.frag.glsl?raw';
import mpiVertex from './mpi.vert.glsl?raw';
import { drawMpi } from './mpi_quads';
import { NearViews } from './near_views';
import { Program } from './program';
import { newProjection } from './projection';
import { Screen } from './screen';
import screenVertex from './screen.vert.glsl?raw';
import type { Target } from './target';
import type { RenderedView, ViewTargets } from './view_targets';

/** How MPIs are chosen and blended. */
export type BlendOptions = Pick<Options, 'neighbours' | 'blend_weights' | 'opacity' | 'filling_views'>;

export class BlendedView implements Disposable {
  /** Of all passes. */
  readonly screen: Screen;
  readonly near: NearViews;
  readonly drawing: Drawing;
  readonly #gl: WebGL2RenderingContext;
  readonly #options: BlendOptions;
  readonly #mpi: Program;
  readonly #blend: Program;
  readonly #filling: Filling;
  readonly #units = Int32Array.from({ length: MAX_NEIGHBOURS }, (_, i) => i);
  readonly #quads = { small: pinholeScratch(), projection: newProjection() };
  /** For each of `near`, where it is rendered to. */
  readonly #places: (RenderedView | null)[] = Array.from({ length: MAX_NEIGHBOURS }, () => null);
  /** What the views of the targets were rendered for: 12 numbers of the pose, then fx, fy, cx, cy. */
  readonly #renderedFor = new Float64Array(16);

  /** @throws RangeError More neighbours are asked for than the shader blends. */
  constructor(gl: WebGL2RenderingContext, options: BlendOptions) {
    if (options.neighbours > MAX_NEIGHBOURS) {
      throw new RangeError(`need neighbours <= ${MAX_NEIGHBOURS}, got ${options.neighbours}`);
    }
    this.#gl = gl;
    this.#options = options;
    const screen = new Screen(gl);
    this.screen = screen;
    this.near = new NearViews(options);
    this.drawing = {
      bind: (unit, texture) => screen.bind(unit, texture),
      cover: () => screen.cover(),
      renderMpi: (mpi, camera, target) => this.#renderMpi(mpi, camera, target),
    };
    this.#filling = new Filling(gl, options.filling_views, this.drawing);
    this.#mpi = new Program(gl, mpiVertex, mpiFragment);
    this.#blend = new Program(gl, screenVertex, blendFragment);
  }

  /** Render no more than this from now on. */
  allow({ blended, filling }: Pick<Allowance, 'blended' | 'filling'>): void {
    this.near.most = blended;
    this.#filling.most = filling;
  }

  /** Find the views for a camera; those that are not on the card are asked for. */
  choose(store: MpiStore, camera: Camera, targets: ViewTargets): void {
    this.near.choose(store, camera);
    this.#filling.choose(store, this.near, camera, targets);
  }

  /** Render into `targets.view` what was chosen. Returns whether the view is another one than before. */
  render(store: MpiStore, camera: Camera, targets: ViewTargets): boolean {
    const { near } = this;
    this.#findPlaces(camera, targets);
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
    this.#blendInto(targets);
    this.#filling.draw(camera, targets);
    return true;
  }

  [Symbol.dispose](): void {
    this.#filling[Symbol.dispose]();
    this.#mpi[Symbol.dispose]();
    this.#blend[Symbol.dispose]();
    this.screen[Symbol.dispose]();
  }

  /**
   * Where each MPI is rendered to. One that is there already, for this very camera, keeps its place
   * and need not be rendered again: a phone that is held by a tripod, a recording that is stopped.
   */
  #findPlaces(camera: Camera, targets: ViewTargets): void {
    const { count, mpis } = this.near;
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

  #freePlace(targets: ViewTargets): RenderedView | null {
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

  #renderMpi(mpi: GpuMpi, camera: Camera, target: Target): void {
    const gl = this.#gl;
    target.begin();
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.#mpi.use();
    this.screen.bind(0, mpi.texture);
    drawMpi(gl, this.#mpi, mpi, camera, target, this.#quads);
  }

  #blendInto(targets: ViewTargets): void {
    const gl = this.#gl;
    const blend = this.#blend;
    targets.view.begin();
    blend.use();
    for (let k = 0; k < MAX_NEIGHBOURS; k += 1) {
      this.screen.bind(k, (targets.blendedFrom[k] ?? targets.blendedFrom[0])?.texture ?? null);
    }
    gl.uniform1iv(blend.uniform('views'), this.#units);
    gl.uniform1fv(blend.uniform('weights'), targets.weights);
    gl.uniform1i(blend.uniform('count'), this.near.count);
    gl.uniform1i(blend.uniform('opacity_of_seen'), this.#options.opacity === 'seen' ? 1 : 0);
    this.screen.cover();
  }
}
