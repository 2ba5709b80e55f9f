/**
 * Says what is wrong with the live picture, a few times a second: it is made small on the card, read
 * back and measured in a worker, and nothing waits for it.
 */

import { rigid, type Cam, type Rigid, type World } from '../geometry';
import { Program } from '../render/program';
import reduceFragment from '../render/reduce.frag.glsl?raw';
import screenVertex from '../render/screen.vert.glsl?raw';
import { ReadBack, Target } from '../render/target';
import type { LiveFrame } from '../sources/frame_source';
import { PictureGate, type PictureFault } from './picture_gate';
import type { MeasureReply, MeasureRequest } from './picture_quality_worker';

/** Longer side of what is measured. */
const LONG_SIDE_PX = 640;
const EVERY_MS = 250;

interface Slot {
  readonly target: Target;
  readonly back: ReadBack;
}

export class PictureSampler implements Disposable {
  /** What was wrong with the picture that was measured last. */
  fault: PictureFault | null = null;
  readonly #gate = new PictureGate();
  readonly #reduce: Program;
  readonly #screen: WebGLVertexArrayObject;
  readonly #worker = new Worker(new URL('./picture_quality_worker.ts', import.meta.url), { type: 'module' });
  readonly #asked: ((fault: PictureFault | null) => void)[] = [];
  /** Those that asked before the picture that is on its way. */
  readonly #answered: ((fault: PictureFault | null) => void)[] = [];
  #slot: Slot | null = null;
  /** From where the picture on its way was taken; null: none is on its way. */
  #worldFromCam: Rigid<World, Cam> | null = null;
  #begun_ms = -Infinity;
  #spare = new ArrayBuffer(0);

  constructor(readonly gl: WebGL2RenderingContext) {
    this.#reduce = new Program(gl, screenVertex, reduceFragment);
    this.#screen = gl.createVertexArray();
    this.#worker.onmessage = ({ data }: MessageEvent<MeasureReply>) => this.#hear(data);
    this.#worker.onerror = () => this.#end(null);
  }

  /** What is wrong with the next picture that is looked at: at once, if none is on its way. */
  next(): Promise<PictureFault | null> {
    this.#begun_ms = -Infinity;
    return new Promise((resolve) => this.#asked.push(resolve));
  }

  /** To be called for every frame, inside its callback. Leaves another framebuffer bound. */
  look({ time_ms, camera, image }: LiveFrame): void {
    this.#takeBack();
    if (camera === null || image === null || this.#worldFromCam !== null) return;
    if (time_ms - this.#begun_ms < EVERY_MS) return;
    this.#begun_ms = time_ms;
    this.#worldFromCam = rigid(camera.worldFromCam.rows);
    this.#answered.push(...this.#asked.splice(0));
    const { width_px, height_px } = camera.pinhole;
    const { target, back } = this.#slotOf(width_px, height_px);
    const { gl } = this;
    target.begin();
    this.#reduce.use();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, image);
    gl.bindSampler(0, null);
    gl.uniform1i(this.#reduce.uniform('picture'), 0);
    gl.uniform2f(this.#reduce.uniform('size'), target.width, target.height);
    // Each tap looks at two texels per axis.
    const taps = Math.ceil(width_px / target.width / 2 + 0.499);
    gl.uniform1i(this.#reduce.uniform('taps'), Math.min(Math.max(taps, 1), 4));
    gl.bindVertexArray(this.#screen);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
    back.request();
  }

  [Symbol.dispose](): void {
    this.#worker.terminate();
    this.#end(null);
    this.#slot?.back[Symbol.dispose]();
    this.#slot?.target[Symbol.dispose]();
    this.#reduce[Symbol.dispose]();
    this.gl.deleteVertexArray(this.#screen);
  }

  #takeBack(): void {
    const slot = this.#slot;
    const pixels = slot?.back.take() ?? null;
    if (slot === null || pixels === null) return;
    if (this.#spare.byteLength !== pixels.byteLength) this.#spare = new ArrayBuffer(pixels.byteLength);
    new Uint8Array(this.#spare).set(pixels);
    const request: MeasureRequest = { width: slot.target.width, height: slot.target.height, rgba: this.#spare };
    this.#worker.postMessage(request, [this.#spare]);
  }

  #hear({ quality, rgba }: MeasureReply): void {
    this.#spare = rgba;
    this.#end(this.#worldFromCam === null ? null : this.#gate.judge(quality, this.#worldFromCam));
  }

  #end(fault: PictureFault | null): void {
    this.fault = fault;
    this.#worldFromCam = null;
    for (const answer of this.#answered.splice(0)) answer(fault);
  }

  #slotOf(width_px: number, height_px: number): Slot {
    const scale = Math.min(1, LONG_SIDE_PX / Math.max(width_px, height_px));
    const width = Math.max(1, Math.round(scale * width_px));
    const height = Math.max(1, Math.round(scale * height_px));
    if (this.#slot?.target.width === width && this.#slot.target.height === height) return this.#slot;
    this.#slot?.back[Symbol.dispose]();
    this.#slot?.target[Symbol.dispose]();
    const target = new Target(this.gl, width, height);
    this.#slot = { target, back: new ReadBack(this.gl, target) };
    return this.#slot;
  }
}
