/** What every pass over a whole target needs: a triangle over all of it, and textures with their sampler. */

export class Screen implements Disposable {
  readonly #gl: WebGL2RenderingContext;
  readonly #triangle: WebGLVertexArrayObject;
  readonly #sampler: WebGLSampler;

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#triangle = gl.createVertexArray();
    // Camera textures of WebXR are not ours to set filters on.
    this.#sampler = gl.createSampler();
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  /** What a pass assumes of the context, which others may have used meanwhile. */
  reset(): void {
    const gl = this.#gl;
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.CULL_FACE);
    gl.disable(gl.BLEND);
  }

  bind(unit: number, texture: WebGLTexture | null): void {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.bindSampler(unit, this.#sampler);
  }

  /** Leave the units to others, without the sampler. */
  release(units: number): void {
    for (let unit = 0; unit < units; unit += 1) this.#gl.bindSampler(unit, null);
  }

  /** Draw a triangle over all of the target. */
  cover(): void {
    this.#gl.bindVertexArray(this.#triangle);
    this.#gl.drawArrays(this.#gl.TRIANGLES, 0, 3);
    this.#gl.bindVertexArray(null);
  }

  [Symbol.dispose](): void {
    this.#gl.deleteVertexArray(this.#triangle);
    this.#gl.deleteSampler(this.#sampler);
  }
}
