/**
 * What each view has seen, as depth, in the layers of one texture: a view's MPI may leave the card,
 * what it saw is remembered. Layers are used again when there are more views.
 */

import {
  identity, inverse, pinholeScratch, type Cam, type Camera, type Rigid, type World,
} from '../geometry';
import type { GpuMpi } from '../mpi/mpi_store';
import alignDepthFragment from '../render/align_depth.frag.glsl?raw';
import { FloatTarget } from '../render/float_target';
import mpiVertex from '../render/mpi.vert.glsl?raw';
import { drawMpi } from '../render/mpi_quads';
import { Program } from '../render/program';
import { newProjection } from '../render/projection';
import screenVertex from '../render/screen.vert.glsl?raw';
import storeDepthFragment from './store_depth.frag.glsl?raw';

/** So many views are asked at a time, of ask.frag.glsl. */
export const MAX_ASKED = 16;
/** About as many pixels as a picture has at half of its size; whatever its shape, it fills the square. */
const MAP_PX = 216;
/** Every card has room for so many layers: 24 MB. */
const MAX_LAYERS = 256;
/** Layers are made in portions, so that a short session takes little. */
const FIRST_LAYERS = 16;

interface Layer {
  id: string;
  mpi: GpuMpi;
  lastAsked: number;
}

/** What the shader is told of the views that are asked; written anew for every question. */
export interface Asked {
  count: number;
  readonly layers: Int32Array;
  /** Three rows of [R | t] of each, from the asking camera to the view's. */
  readonly rows: Float32Array;
  /** fx, fy, cx, cy of each, of a picture from 0 to 1. */
  readonly inner: Float32Array;
}

export class DepthMaps implements Disposable {
  readonly asked: Asked = {
    count: 0, layers: new Int32Array(MAX_ASKED), rows: new Float32Array(12 * MAX_ASKED),
    inner: new Float32Array(4 * MAX_ASKED),
  };

  readonly #gl: WebGL2RenderingContext;
  readonly #depth: Program;
  readonly #store: Program;
  readonly #screen: WebGLVertexArrayObject;
  readonly #sum: FloatTarget;
  readonly #framebuffer: WebGLFramebuffer;
  readonly #quads = { small: pinholeScratch(), projection: newProjection() };
  readonly #layers: (Layer | null)[] = [];
  readonly #numbers = new Map<string, number>();
  readonly #viewFromWorld: Rigid<Cam, World> = identity();
  #texture: WebGLTexture;
  #clock = 0;

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#depth = new Program(gl, mpiVertex, alignDepthFragment);
    this.#store = new Program(gl, screenVertex, storeDepthFragment);
    this.#screen = gl.createVertexArray();
    this.#sum = new FloatTarget(gl, MAP_PX, MAP_PX);
    this.#framebuffer = gl.createFramebuffer();
    this.#texture = this.#room(FIRST_LAYERS);
  }

  get texture(): WebGLTexture {
    return this.#texture;
  }

  /** Whether what a view saw is remembered. */
  has(id: string): boolean {
    return this.#numbers.has(id);
  }

  /** Remember what a view saw, or that it sees better now. Returns whether that is new. */
  remember(id: string, mpi: GpuMpi): boolean {
    const known = this.#numbers.get(id);
    if (known !== undefined && this.#layers[known]?.mpi === mpi) return false;
    const number = known ?? this.#free();
    this.#layers[number] = { id, mpi, lastAsked: this.#clock };
    this.#numbers.set(id, number);
    this.#draw(mpi, number);
    return true;
  }

  /** Forget the views that are not among these. Returns whether there were any. */
  keep(ids: ReadonlySet<string>): boolean {
    let forgotten = false;
    for (const [id, number] of Array.from(this.#numbers)) {
      if (ids.has(id)) continue;
      this.#numbers.delete(id);
      this.#layers[number] = null;
      forgotten = true;
    }
    return forgotten;
  }

  /** Begin a question; `ask` adds views to it. */
  begin(): void {
    this.#clock += 1;
    this.asked.count = 0;
  }

  /** Ask a view, if what it saw is remembered. */
  ask(id: string, from: Camera): void {
    const number = this.#numbers.get(id) ?? -1;
    const layer = this.#layers[number];
    const k = this.asked.count;
    if (layer == null || k >= MAX_ASKED) return;
    layer.lastAsked = this.#clock;
    this.asked.count = k + 1;
    this.asked.layers[k] = number;
    writeInner(layer.mpi.camera, this.asked.inner, 4 * k);
    inverse(layer.mpi.camera.worldFromCam, this.#viewFromWorld);
    compose(this.#viewFromWorld.rows, from.worldFromCam.rows, this.asked.rows, 12 * k);
  }

  [Symbol.dispose](): void {
    this.#depth[Symbol.dispose]();
    this.#store[Symbol.dispose]();
    this.#sum[Symbol.dispose]();
    this.#gl.deleteVertexArray(this.#screen);
    this.#gl.deleteFramebuffer(this.#framebuffer);
    this.#gl.deleteTexture(this.#texture);
  }

  /** A free layer; if there is none, that of the view that was not asked for the longest time. */
  #free(): number {
    const empty = this.#layers.indexOf(null);
    if (empty >= 0) return empty;
    if (this.#layers.length < MAX_LAYERS) {
      this.#grow(2 * this.#layers.length);
      return this.#layers.indexOf(null);
    }
    let oldest = 0;
    for (let i = 1; i < this.#layers.length; i += 1) {
      if ((this.#layers[i]?.lastAsked ?? 0) < (this.#layers[oldest]?.lastAsked ?? 0)) oldest = i;
    }
    this.#numbers.delete(this.#layers[oldest]?.id ?? '');
    return oldest;
  }

  /** MPIs are still on the card or gone; layers are copied either way. */
  #grow(count: number): void {
    const gl = this.#gl;
    const before = this.#texture;
    const filled = this.#layers.length;
    this.#texture = this.#room(count);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#framebuffer);
    for (let layer = 0; layer < filled; layer += 1) {
      gl.framebufferTextureLayer(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, before, 0, layer);
      gl.copyTexSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, layer, 0, 0, MAP_PX, MAP_PX);
    }
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
    gl.deleteTexture(before);
  }

  #room(count: number): WebGLTexture {
    const gl = this.#gl;
    const texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RG8, MAP_PX, MAP_PX, count);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, name, gl.NEAREST);
    }
    while (this.#layers.length < count) this.#layers.push(null);
    return texture;
  }

  #draw(mpi: GpuMpi, number: number): void {
    const gl = this.#gl;
    for (const test of [gl.DEPTH_TEST, gl.SCISSOR_TEST, gl.CULL_FACE, gl.BLEND]) gl.disable(test);
    this.#sum.begin();
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.#depth.use();
    this.#bind(mpi.texture);
    drawMpi(gl, this.#depth, mpi, mpi.camera, { width: MAP_PX, height: MAP_PX }, this.#quads);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer);
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, this.#texture, 0, number);
    gl.viewport(0, 0, MAP_PX, MAP_PX);
    this.#store.use();
    this.#bind(this.#sum.texture);
    gl.uniform1i(this.#store.uniform('sums'), 0);
    gl.bindVertexArray(this.#screen);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
  }

  #bind(texture: WebGLTexture): void {
    this.#gl.activeTexture(this.#gl.TEXTURE0);
    this.#gl.bindTexture(this.#gl.TEXTURE_2D, texture);
    this.#gl.bindSampler(0, null);
  }
}

/** Write fx, fy, cx, cy of a camera whose picture goes from 0 to 1. */
export function writeInner({ pinhole }: Camera, into: Float32Array, at: number): void {
  const { width_px, height_px } = pinhole;
  into[at] = pinhole.fx_px / width_px;
  into[at + 1] = pinhole.fy_px / height_px;
  into[at + 2] = pinhole.cx_px / width_px;
  into[at + 3] = pinhole.cy_px / height_px;
}

/** Write a b, of two [R | t] row by row. */
function compose(a: Float64Array, b: Float64Array, into: Float32Array, at: number): void {
  for (let row = 0; row < 3; row += 1) {
    for (let column = 0; column < 4; column += 1) {
      let sum = column === 3 ? a[4 * row + 3] ?? NaN : 0;
      for (let k = 0; k < 3; k += 1) sum += (a[4 * row + k] ?? NaN) * (b[4 * k + column] ?? NaN);
      into[at + 4 * row + column] = sum;
    }
  }
}
