/**
 * Depth that a device gives only as a texture (`gpu-optimized`: headsets), read back. It is turned to
 * the picture's frame on the way, so that only the map itself comes back; what comes is what
 * `depthMapOf` makes of the same numbers.
 */

import { Program } from '../render/program';
import screenVertex from '../render/screen.vert.glsl?raw';
import { Target } from '../render/target';
import { sizeInView, type DepthFormat, type DepthGeometry } from './depth';
import type { DepthMap } from './frame_source';
import fragment from './gpu_depth.frag.glsl?raw';

/** The part of `XRWebGLDepthInformation` that is needed. */
export interface DepthTexture extends DepthGeometry {
  readonly texture: WebGLTexture;
  readonly textureType?: 'texture' | 'texture-array';
  /** The layer, of an array. */
  readonly imageIndex?: number | null;
}

export class GpuDepthReader implements Disposable {
  readonly #gl: WebGL2RenderingContext;
  readonly #programs = new Map<string, Program>();
  readonly #sampler: WebGLSampler;
  readonly #screen: WebGLVertexArrayObject;
  #target: Target | null = null;

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#screen = gl.createVertexArray();
    // Numbers are not mixed; with the usual filter, textures of 32-bit floats cannot be read at all.
    this.#sampler = gl.createSampler();
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.samplerParameteri(this.#sampler, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  }

  /**
   * Waits for the card, so not for every frame. Leaves the framebuffer and the program changed.
   *
   * @param aspect Width / height of the picture.
   */
  read(raw: DepthTexture, format: DepthFormat, aspect: number): DepthMap {
    const gl = this.#gl;
    const { width_px, height_px } = sizeInView(raw, aspect);
    if (this.#target?.width !== width_px || this.#target.height !== height_px) {
      this.#target?.[Symbol.dispose]();
      this.#target = new Target(gl, width_px, height_px);
    }
    const isArray = raw.textureType === 'texture-array';
    const program = this.#program(format, isArray);
    const where = isArray ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D;
    for (const test of [gl.DEPTH_TEST, gl.SCISSOR_TEST, gl.CULL_FACE, gl.BLEND]) gl.disable(test);
    this.#target.begin();
    program.use();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(where, raw.texture);
    gl.bindSampler(0, this.#sampler);
    gl.uniform1i(program.uniform('depth'), 0);
    if (isArray) gl.uniform1i(program.uniform('layer'), raw.imageIndex ?? 0);
    gl.uniformMatrix4fv(
      program.uniform('buffer_from_picture'), false, raw.normDepthBufferFromNormView.matrix);
    gl.uniform2f(program.uniform('picture_size'), width_px, height_px);
    gl.uniform1f(program.uniform('mm_per_unit'), 1000 * raw.rawValueToMeters);
    gl.bindVertexArray(this.#screen);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
    gl.bindSampler(0, null);
    gl.bindTexture(where, null);
    const pixels = new Uint8Array(4 * width_px * height_px);
    gl.readPixels(0, 0, width_px, height_px, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const depth_mm = new Uint16Array(width_px * height_px);
    for (let i = 0; i < depth_mm.length; i += 1) {
      depth_mm[i] = (pixels[4 * i] ?? 0) + 256 * (pixels[4 * i + 1] ?? 0);
    }
    return { width_px, height_px, depth_mm };
  }

  [Symbol.dispose](): void {
    for (const program of this.#programs.values()) program[Symbol.dispose]();
    this.#programs.clear();
    this.#target?.[Symbol.dispose]();
    this.#target = null;
    this.#gl.deleteSampler(this.#sampler);
    this.#gl.deleteVertexArray(this.#screen);
  }

  #program(format: DepthFormat, isArray: boolean): Program {
    const name = `IS_${format.replace('-', '_').toUpperCase()}`;
    const key = `${name} ${isArray}`;
    let program = this.#programs.get(key);
    if (program === undefined) {
      const defines = `#define ${name}\n${isArray ? '#define IS_ARRAY\n' : ''}`;
      const [version = '', rest = ''] = fragment.split(/(?<=#version 300 es\n)/);
      program = new Program(this.#gl, screenVertex, version + defines + rest);
      this.#programs.set(key, program);
    }
    return program;
  }
}
