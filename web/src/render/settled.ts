/** What is shown of the marks: how far each has settled, and whether it is on. */

import { Target } from './target';

/** Red: what is wrong; green: what was never seen; blue: where no view will help. */
export class Settled implements Disposable {
  readonly levels: Target;
  /** 0 or 1. */
  readonly states: Target;
  readonly #framebuffer: WebGLFramebuffer;

  constructor(private readonly gl: WebGL2RenderingContext, width: number, height: number) {
    this.levels = new Target(gl, width, height);
    this.states = new Target(gl, width, height);
    this.#framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer);
    const places = [gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1];
    [this.levels, this.states].forEach(({ texture }, i) =>
      gl.framebufferTexture2D(gl.FRAMEBUFFER, places[i] ?? 0, gl.TEXTURE_2D, texture, 0));
    gl.drawBuffers(places);
  }

  /** Make both what is drawn into. */
  begin(): void {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.#framebuffer);
    this.gl.viewport(0, 0, this.levels.width, this.levels.height);
  }

  /** Be what others of another size are. */
  goOnFrom({ levels, states }: Settled): void {
    const { gl } = this;
    for (const [from, to] of [[levels, this.levels], [states, this.states]] as const) {
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from.framebuffer);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to.framebuffer);
      gl.blitFramebuffer(
        0, 0, from.width, from.height, 0, 0, to.width, to.height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    }
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
  }

  [Symbol.dispose](): void {
    this.gl.deleteFramebuffer(this.#framebuffer);
    this.levels[Symbol.dispose]();
    this.states[Symbol.dispose]();
  }
}
