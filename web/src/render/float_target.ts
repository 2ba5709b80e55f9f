/** A texture of half floats that can be drawn into. */

export class FloatTarget implements Disposable {
  readonly texture: WebGLTexture;
  readonly #framebuffer: WebGLFramebuffer;

  constructor(
    private readonly gl: WebGL2RenderingContext, private readonly width: number, private readonly height: number,
  ) {
    this.texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA16F, width, height);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    this.#framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
  }

  begin(): void {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.#framebuffer);
    this.gl.viewport(0, 0, this.width, this.height);
  }

  [Symbol.dispose](): void {
    this.gl.deleteTexture(this.texture);
    this.gl.deleteFramebuffer(this.#framebuffer);
  }
}
