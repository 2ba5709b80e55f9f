/** Lets what is shown follow what is measured. */

import { SETTLING_S } from '../wire';
import type { Drawing } from './filling';
import { Program } from './program';
import screenVertex from './screen.vert.glsl?raw';
import settleFragment from './settle.frag.glsl?raw';
import type { Targets } from './targets';

/**
 * What is shown follows what is measured: with this time constant a pixel gets red within 0.28 s,
 * and changes at most every 0.22 s, which is less than three flashes a second.
 */
const SETTLING_MS = 1000 * SETTLING_S;
/** After so long without anything new nothing moves any more, by a 255th. */
export const SETTLED_MS = 8 * SETTLING_MS;

export class Settling implements Disposable {
  readonly #program: Program;
  #last_ms = 0;

  /** @param apart Whether never seen and "no view will help" have marks of their own. */
  constructor(
    private readonly gl: WebGL2RenderingContext, readonly apart: boolean, readonly drawing: Drawing,
  ) {
    this.#program = new Program(gl, screenVertex, settleFragment);
  }

  /** Let what is shown follow the result. */
  follow(time_ms: number, targets: Targets): void {
    const gl = this.gl;
    const program = this.#program;
    const passed_ms = Math.max(time_ms - this.#last_ms, 0);
    this.#last_ms = time_ms;
    targets.swapShown();
    targets.shown.begin();
    program.use();
    this.drawing.bind(0, targets.shownBefore.levels.texture);
    this.drawing.bind(1, targets.shownBefore.states.texture);
    this.drawing.bind(2, targets.result.texture);
    gl.uniform1i(program.uniform('levels'), 0);
    gl.uniform1i(program.uniform('states'), 1);
    gl.uniform1i(program.uniform('result'), 2);
    gl.uniform1f(program.uniform('share'), 1 - Math.exp(-passed_ms / SETTLING_MS));
    gl.uniform1i(program.uniform('apart'), this.apart ? 1 : 0);
    this.drawing.cover();
  }

  /** All has settled; what comes next begins to settle then. */
  rest(time_ms: number): void {
    this.#last_ms = time_ms;
  }

  [Symbol.dispose](): void {
    this.#program[Symbol.dispose]();
  }
}
