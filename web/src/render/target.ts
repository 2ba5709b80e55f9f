/** A texture that can be drawn into, and pixels that come back without waiting. */

export class Target implements Disposable {
  readonly texture: WebGLTexture;
  readonly framebuffer: WebGLFramebuffer;

  constructor(
    private readonly gl: WebGL2RenderingContext, readonly width: number, readonly height: number,
  ) {
    this.texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    this.framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  /** Make it what is drawn into. */
  begin(): void {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.framebuffer);
    this.gl.viewport(0, 0, this.width, this.height);
  }

  [Symbol.dispose](): void {
    this.gl.deleteTexture(this.texture);
    this.gl.deleteFramebuffer(this.framebuffer);
  }
}

/** A target that can be told which of its pixels are not drawn into: those with a depth before all else. */
export class MaskedTarget extends Target {
  readonly #depth: WebGLRenderbuffer;

  constructor(private readonly card: WebGL2RenderingContext, width: number, height: number) {
    super(card, width, height);
    this.#depth = card.createRenderbuffer();
    card.bindRenderbuffer(card.RENDERBUFFER, this.#depth);
    card.renderbufferStorage(card.RENDERBUFFER, card.DEPTH_COMPONENT16, width, height);
    card.framebufferRenderbuffer(card.FRAMEBUFFER, card.DEPTH_ATTACHMENT, card.RENDERBUFFER, this.#depth);
  }

  override [Symbol.dispose](): void {
    super[Symbol.dispose]();
    this.card.deleteRenderbuffer(this.#depth);
  }
}

/** Reads a target back without stalling: asked for in one frame, there in a later one. */
export class ReadBack implements Disposable {
  readonly #gl: WebGL2RenderingContext;
  readonly #buffer: WebGLBuffer;
  readonly #pixels: Uint8Array<ArrayBuffer>;
  #fence: WebGLSync | null = null;

  constructor(gl: WebGL2RenderingContext, private readonly target: Target) {
    this.#gl = gl;
    this.#pixels = new Uint8Array(4 * target.width * target.height);
    this.#buffer = gl.createBuffer();
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, this.#pixels.length, gl.STREAM_READ);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
  }

  get pending(): boolean {
    return this.#fence !== null;
  }

  /** Ask for what the target holds now. */
  request(): void {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target.framebuffer);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
    gl.readPixels(0, 0, this.target.width, this.target.height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    this.#fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  /** RGBA, bottom row first, once it is there; the array is used again. */
  take(): Uint8Array<ArrayBuffer> | null {
    const gl = this.#gl;
    if (this.#fence === null) return null;
    const status = gl.clientWaitSync(this.#fence, 0, 0);
    if (status !== gl.ALREADY_SIGNALED && status !== gl.CONDITION_SATISFIED) return null;
    gl.deleteSync(this.#fence);
    this.#fence = null;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, this.#pixels);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    return this.#pixels;
  }

  [Symbol.dispose](): void {
    this.#gl.deleteBuffer(this.#buffer);
    if (this.#fence !== null) this.#gl.deleteSync(this.#fence);
  }
}
