/** Draws under what is blended what further views saw where it is empty. */

import type { Camera } from '../geometry';
import type { GpuMpi, MpiStore } from '../mpi/mpi_store';
import { HoleFiller } from './hole_filling';
import keepFragment from './keep.frag.glsl?raw';
import type { NearViews } from './near_views';
import opacityFragment from './opacity.frag.glsl?raw';
import { Program } from './program';
import screenVertex from './screen.vert.glsl?raw';
import type { Target } from './target';
import type { ViewTargets } from './view_targets';
import underFragment from './under.frag.glsl?raw';

/** What is empty is looked at again after so many frames: what fills may lag, what is shown does not. */
const EVERY_FRAMES = 6;

/** What the renderer does for it. */
export interface Drawing {
  bind(unit: number, texture: WebGLTexture): void;
  /** Draws a triangle over all of the target. */
  cover(): void;
  renderMpi(mpi: GpuMpi, camera: Camera, target: Target): void;
}

export class Filling implements Disposable {
  /** So many fill at most, whatever the options say. */
  most = Infinity;
  readonly #gl: WebGL2RenderingContext;
  readonly #opacity: Program;
  readonly #keep: Program;
  readonly #under: Program;
  readonly #filler: HoleFiller;
  /** The views that fill, best first; as long as they are. */
  readonly #ids: string[] = [];
  readonly #blocks = { opacity: new Uint8Array(0), cols: 0, rows: 0 };
  #near: NearViews | null = null;
  #views: MpiStore['views'] = [];
  #frame = 0;

  constructor(gl: WebGL2RenderingContext, most: number, readonly drawing: Drawing) {
    this.#gl = gl;
    this.#filler = new HoleFiller(most);
    this.#opacity = new Program(gl, screenVertex, opacityFragment);
    this.#keep = new Program(gl, screenVertex, keepFragment);
    this.#under = new Program(gl, screenVertex, underFragment);
  }

  [Symbol.dispose](): void {
    this.#opacity[Symbol.dispose]();
    this.#keep[Symbol.dispose]();
    this.#under[Symbol.dispose]();
  }

  /** Choose which views fill, if it is known anew what is empty. */
  choose(store: MpiStore, near: NearViews, camera: Camera, targets: ViewTargets): void {
    this.#frame += 1;
    const opacity = targets.opacityBack.take();
    const closest = near.mpis[0];
    if (opacity === null || closest === undefined || near.count === 0) return;
    this.#near = near;
    this.#views = store.views;
    this.#blocks.opacity = opacity;
    this.#blocks.cols = targets.opacity.width;
    this.#blocks.rows = targets.opacity.height;
    this.#filler.choose(store.cameras, camera, this.#blocks, closest, this.#isBlended);
    this.#ids.length = this.#filler.count;
    for (let k = 0; k < this.#filler.count; k += 1) {
      this.#ids[k] = store.views[this.#filler.index[k] ?? -1]?.id ?? '';
    }
  }

  /** Find those that are on the card. Returns whether they are others than before. */
  find(store: MpiStore, near: NearViews, { filledFrom }: ViewTargets): boolean {
    let changed = false;
    for (let k = 0; k < filledFrom.length; k += 1) {
      const id = k < this.most ? this.#ids[k] : undefined;
      const mpi = id === undefined || near.ids.includes(id) ? null : store.want(id);
      if (filledFrom[k] === mpi) continue;
      filledFrom[k] = mpi;
      changed = true;
    }
    return changed;
  }

  /** Ask what is empty in what was blended, then draw under it: of each view, what is not yet opaque. */
  draw(camera: Camera, targets: ViewTargets): void {
    this.#ask(targets);
    const gl = this.#gl;
    for (const mpi of targets.filledFrom) {
      if (mpi === null) continue;
      gl.enable(gl.DEPTH_TEST);
      this.#keepOpaque(targets);
      this.drawing.renderMpi(mpi, camera, targets.filling);
      gl.disable(gl.DEPTH_TEST);
      gl.depthMask(true);
      targets.view.begin();
      this.#under.use();
      this.drawing.bind(0, targets.filling.texture);
      gl.uniform1i(this.#under.uniform('view'), 0);
      gl.enable(gl.BLEND);
      gl.blendEquation(gl.FUNC_ADD);
      gl.blendFunc(gl.ONE_MINUS_DST_ALPHA, gl.ONE);
      this.drawing.cover();
      gl.disable(gl.BLEND);
    }
  }

  /** Let nothing be drawn where the picture is opaque: most of an MPI, which is most of its time. */
  #keepOpaque({ view, filling }: ViewTargets): void {
    const gl = this.#gl;
    filling.begin();
    gl.depthMask(true);
    gl.clearDepth(1);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.depthFunc(gl.ALWAYS);
    gl.colorMask(false, false, false, false);
    this.#keep.use();
    this.drawing.bind(0, view.texture);
    gl.uniform1i(this.#keep.uniform('view'), 0);
    this.drawing.cover();
    gl.colorMask(true, true, true, true);
    gl.depthMask(false);
    gl.depthFunc(gl.LEQUAL);
  }

  #ask(targets: ViewTargets): void {
    if (targets.filledFrom.length === 0 || targets.opacityBack.pending) return;
    if (this.#frame % EVERY_FRAMES !== 0 && targets.asked) return;
    targets.asked = true;
    targets.opacity.begin();
    this.#opacity.use();
    this.drawing.bind(0, targets.view.texture);
    this.#gl.uniform1i(this.#opacity.uniform('view'), 0);
    this.#gl.uniform2i(this.#opacity.uniform('blocks'), targets.opacity.width, targets.opacity.height);
    this.drawing.cover();
    targets.opacityBack.request();
  }

  readonly #isBlended = (index: number): boolean =>
    this.#near?.ids.includes(this.#views[index]?.id ?? '') ?? false;
}
