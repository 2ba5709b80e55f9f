/**
 * What the alignment compares, small, and read back without waiting: rendering, its depth, live picture.
 * The client's renderings have no depth, so the views that are blended are drawn once more for it.
 */

import { pinholeScratch, type Camera } from '../geometry';
import alignDepthFragment from './align_depth.frag.glsl?raw';
import alignPackFragment from './align_pack.frag.glsl?raw';
import alignWeighFragment from './align_weigh.frag.glsl?raw';
import { FloatTarget } from './float_target';
import mpiVertex from './mpi.vert.glsl?raw';
import { drawMpi } from './mpi_quads';
import type { NearViews } from './near_views';
import { Program } from './program';
import { newProjection } from './projection';
import reduceFragment from './reduce.frag.glsl?raw';
import screenVertex from './screen.vert.glsl?raw';
import { ReadBack, Target } from './target';

/** Pixels of each of the three pictures, at most. */
export const ALIGN_PIXELS = 24_000;

export class AlignPictures implements Disposable {
  readonly width: number;
  readonly height: number;
  readonly #gl: WebGL2RenderingContext;
  readonly #programs;
  readonly #screen: WebGLVertexArrayObject;
  /** Depth of one view, and of all. */
  readonly #one: FloatTarget;
  readonly #sum: FloatTarget;
  readonly #out: Target;
  readonly #back: ReadBack;
  readonly #quads = { small: pinholeScratch(), projection: newProjection() };

  /**
   * @param view The size of what is rendered.
   * @throws RangeError The card cannot do it; see `supportedBy`.
   */
  constructor(gl: WebGL2RenderingContext, private readonly view: { readonly width: number; readonly height: number }) {
    this.#gl = gl;
    // Asking for the extension is what switches it on.
    if (!AlignPictures.supportedBy(gl)) throw new RangeError('need a card that draws into half floats');
    const scale = Math.min(1, Math.sqrt(ALIGN_PIXELS / (view.width * view.height)));
    this.width = Math.max(1, Math.round(view.width * scale));
    this.height = Math.max(1, Math.round(view.height * scale));
    this.#programs = {
      depth: new Program(gl, mpiVertex, alignDepthFragment),
      weigh: new Program(gl, screenVertex, alignWeighFragment),
      pack: new Program(gl, screenVertex, alignPackFragment),
      reduce: new Program(gl, screenVertex, reduceFragment),
    };
    this.#screen = gl.createVertexArray();
    this.#one = new FloatTarget(gl, this.width, this.height);
    this.#sum = new FloatTarget(gl, this.width, this.height);
    this.#out = new Target(gl, this.width, 3 * this.height);
    this.#back = new ReadBack(gl, this.#out);
  }

  /** Whether the card can add up depths; without this there is no alignment. */
  static supportedBy(gl: WebGL2RenderingContext): boolean {
    return gl.getExtension('EXT_color_buffer_float') !== null
      || gl.getExtension('EXT_color_buffer_half_float') !== null;
  }

  /** Whether pictures of these sizes fit. */
  fits(view: { readonly width: number; readonly height: number }): boolean {
    return view.width === this.view.width && view.height === this.view.height;
  }

  get pending(): boolean {
    return this.#back.pending;
  }

  /** Ask for the pictures of what was just rendered. Leaves another framebuffer bound. */
  request(near: NearViews, camera: Camera, view: Target, live: Target): void {
    const gl = this.#gl;
    this.#addDepths(near, camera);
    const { pack } = this.#programs;
    this.#out.begin();
    this.#reduce(view, 0);
    gl.viewport(0, this.height, this.width, this.height);
    pack.use();
    this.#bind(this.#sum.texture);
    gl.uniform1i(pack.uniform('sums'), 0);
    this.#cover();
    this.#reduce(live, 2);
    this.#back.request();
  }

  /**
   * RGBA8, bottom row first, once it is there: the rendering, above it (in the array: after it) its
   * depth in tenths of a millimetre, 24 bits, then the live picture. The array is used again.
   */
  take(): Uint8Array<ArrayBuffer> | null {
    return this.#back.take();
  }

  [Symbol.dispose](): void {
    for (const program of Object.values(this.#programs)) program[Symbol.dispose]();
    this.#gl.deleteVertexArray(this.#screen);
    for (const each of [this.#back, this.#one, this.#sum, this.#out]) each[Symbol.dispose]();
  }

  #addDepths({ count, mpis, weights }: NearViews, camera: Camera): void {
    const gl = this.#gl;
    const { depth, weigh } = this.#programs;
    this.#sum.begin();
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    for (let k = 0; k < count; k += 1) {
      const mpi = mpis[k];
      if (mpi === undefined) continue;
      this.#one.begin();
      gl.clear(gl.COLOR_BUFFER_BIT);
      depth.use();
      this.#bind(mpi.texture);
      drawMpi(gl, depth, mpi, camera, this, this.#quads);
      this.#sum.begin();
      weigh.use();
      this.#bind(this.#one.texture);
      gl.uniform1i(weigh.uniform('view'), 0);
      gl.uniform1f(weigh.uniform('weight'), weights[k] ?? 0);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE);
      this.#cover();
      gl.disable(gl.BLEND);
    }
  }

  #reduce(picture: Target, place: number): void {
    const gl = this.#gl;
    const { reduce } = this.#programs;
    gl.viewport(0, place * this.height, this.width, this.height);
    reduce.use();
    this.#bind(picture.texture);
    gl.uniform1i(reduce.uniform('picture'), 0);
    gl.uniform2f(reduce.uniform('size'), this.width, this.height);
    // Each tap looks at two texels per axis.
    const taps = Math.ceil(picture.width / this.width / 2 + 0.499);
    gl.uniform1i(reduce.uniform('taps'), Math.min(Math.max(taps, 1), 4));
    this.#cover();
  }

  #bind(texture: WebGLTexture): void {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.bindSampler(0, null);
  }

  #cover(): void {
    this.#gl.bindVertexArray(this.#screen);
    this.#gl.drawArrays(this.#gl.TRIANGLES, 0, 3);
    this.#gl.bindVertexArray(null);
  }
}
