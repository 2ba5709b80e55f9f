/** How much of what is visible has which mark: counted on the card, read back frames later. */

import countFragment from './count.frag.glsl?raw';
import type { Drawing } from './filling';
import { Program } from './program';
import screenVertex from './screen.vert.glsl?raw';
import { BLOCKS, type Targets } from './targets';

/** Of a frame or two ago; all are null before the first view. Pixels / visible pixels, 0…1. */
export interface Shares {
  /** What a view from here mends: wrong or never seen, where these are marked apart. */
  readonly peakedShare: number | null;
  /** What is shown otherwise than it is, and a view mends it. */
  readonly wrongShare: number | null;
  /** What no view shows. */
  readonly unseenShare: number | null;
  /** What is wrong, and no view will help. */
  readonly unfixableShare: number | null;
}

export const NO_SHARES: Shares = {
  peakedShare: null, wrongShare: null, unseenShare: null, unfixableShare: null,
};

/** A part of a picture, in shares of its width and height from its top left corner. */
export interface Part {
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

export const WHOLE: Part = { left: 0, top: 0, right: 1, bottom: 1 };

export class ShareCounter implements Disposable {
  readonly #gl: WebGL2RenderingContext;
  readonly #program: Program;
  readonly #now: { -readonly [K in keyof Shares]: Shares[K] } = { ...NO_SHARES };
  #visible: Part = WHOLE;
  /** Another part is visible than what was counted. */
  #isNew = false;
  /** Pixels that were looked at in what is on its way back. */
  #counted = 1;

  constructor(gl: WebGL2RenderingContext, readonly drawing: Drawing) {
    this.#gl = gl;
    this.#program = new Program(gl, screenVertex, countFragment);
  }

  /** The object is used again. */
  get now(): Shares {
    return this.#now;
  }

  /** What of the picture is visible on the screen; the rest is not counted. */
  get visible(): Part {
    return this.#visible;
  }

  set visible(part: Part) {
    this.#visible = part;
    this.#isNew = true;
  }

  forget(): void {
    Object.assign(this.#now, NO_SHARES);
  }

  /** Take what was counted, if it is there. */
  take(targets: Targets): void {
    const counts = targets.countsBack.take();
    if (counts === null) return;
    const half = counts.length / 2;
    this.#now.peakedShare = this.#sum(counts, 0, half, 0);
    this.#now.unseenShare = this.#sum(counts, 0, half, 1);
    this.#now.wrongShare = this.#sum(counts, half, counts.length, 0);
    this.#now.unfixableShare = this.#sum(counts, half, counts.length, 1);
  }

  /** Count what was compared last, unless that is done or on its way. */
  count(targets: Targets): void {
    if ((!targets.uncounted && !this.#isNew) || targets.countsBack.pending) return;
    targets.uncounted = false;
    this.#isNew = false;
    const gl = this.#gl;
    const { width, height } = targets.result;
    const { left, top, right, bottom } = this.#visible;
    const x0 = Math.min(Math.round(left * width), width - 1);
    const x1 = Math.max(Math.round(right * width), x0 + 1);
    const y0 = Math.min(Math.round((1 - bottom) * height), height - 1);
    const y1 = Math.max(Math.round((1 - top) * height), y0 + 1);
    this.#counted = (x1 - x0) * (y1 - y0);
    targets.counts.begin();
    this.#program.use();
    gl.uniform1i(this.#program.uniform('result'), 0);
    gl.uniform4i(this.#program.uniform('visible'), x0, y0, x1, y1);
    gl.uniform2i(this.#program.uniform('blocks'), BLOCKS.x, BLOCKS.y);
    this.drawing.bind(0, targets.result.texture);
    this.drawing.cover();
    targets.countsBack.request();
  }

  [Symbol.dispose](): void {
    this.#program[Symbol.dispose]();
  }

  #sum(counts: Uint8Array, from: number, to: number, kind: number): number {
    let sum = 0;
    for (let at = from; at < to; at += 4) {
      sum += 256 * (counts[at + kind] ?? 0) + (counts[at + 2 + kind] ?? 0);
    }
    return sum / this.#counted;
  }
}
