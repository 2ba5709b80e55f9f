/** Lines in the room or on the camera, drawn over the picture: instanced quads, as thick as asked. */

import { identity, inverse, type Cam, type Camera, type World } from '../geometry';
import type { LiveFrame } from '../sources/frame_source';
import fragment from './line.frag.glsl?raw';
import vertex from './line.vert.glsl?raw';
import { Program } from './program';

type Point = readonly [number, number, number];
/** Red, green, blue, opacity, 0…1. */
export type Paint = readonly [number, number, number, number];

/** 3 of the begin, 3 of the end, 4 of the paint, 1 of the width. */
const FLOATS = 11;
/** Lines are this part of the picture's height thick, times their width. */
const UNIT_SHARE = 1 / 480;
const RIM_SHARE = 1 / 700;

/** A set of lines on the card. */
export class Lines implements Disposable {
  readonly #buffer: WebGLBuffer;
  readonly #array: WebGLVertexArrayObject;
  #floats: number[] = [];
  #count = 0;

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.#buffer = gl.createBuffer();
    this.#array = gl.createVertexArray();
    gl.bindVertexArray(this.#array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.#buffer);
    let offset = 0;
    for (const [location, size] of [[0, 3], [1, 3], [2, 4], [3, 1]] as const) {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, gl.FLOAT, false, 4 * FLOATS, 4 * offset);
      gl.vertexAttribDivisor(location, 1);
      offset += size;
    }
    gl.bindVertexArray(null);
  }

  add(begin: Point, end: Point, paint: Paint, width = 1): void {
    this.#floats.push(...begin, ...end, ...paint, width);
  }

  /** Put what was added on the card, in place of what was there. */
  upload(): void {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.#buffer);
    gl.bufferData(gl.ARRAY_BUFFER, Float32Array.from(this.#floats), gl.DYNAMIC_DRAW);
    this.#count = this.#floats.length / FLOATS;
    this.#floats = [];
  }

  draw(): void {
    const { gl } = this;
    if (this.#count === 0) return;
    gl.bindVertexArray(this.#array);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.#count);
    gl.bindVertexArray(null);
  }

  [Symbol.dispose](): void {
    this.gl.deleteBuffer(this.#buffer);
    this.gl.deleteVertexArray(this.#array);
  }
}

export class LineRenderer implements Disposable {
  readonly #program: Program;
  readonly #rotation = new Float32Array(9);
  readonly #camFromWorld = identity<Cam, World>();

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.#program = new Program(gl, vertex, fragment);
  }

  /** Draw lines that stand in the room, then lines that go with the camera, over what is there. */
  draw(frame: LiveFrame, camera: Camera, inRoom: Lines, onCamera: Lines): void {
    const { gl } = this;
    const program = this.#program;
    const { x, y, width, height } = frame.viewport;
    const k = camera.pinhole;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame.framebuffer);
    gl.viewport(x, y, width, height);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    program.use();
    gl.uniform4f(program.uniform('pinhole'), k.fx_px, k.fy_px, k.cx_px, k.cy_px);
    gl.uniform2f(program.uniform('picture'), k.width_px, k.height_px);
    gl.uniform2f(program.uniform('viewport'), width, height);
    gl.uniform1f(program.uniform('unit_px'), Math.max(height * UNIT_SHARE, 1));
    const rim_px = Math.max(height * RIM_SHARE, 1);
    this.#drawFrom(inverse(camera.worldFromCam, this.#camFromWorld).rows, inRoom, rim_px);
    this.#drawFrom(IDENTITY, onCamera, rim_px);
    gl.disable(gl.BLEND);
  }

  /** The rim first, and the lines on it. */
  #drawFrom(camFromLines: Float64Array, lines: Lines, rim_px: number): void {
    const { gl } = this;
    const program = this.#program;
    for (let i = 0; i < 9; i += 1) {
      this.#rotation[i] = camFromLines[4 * (i % 3) + Math.floor(i / 3)] ?? 0;
    }
    gl.uniformMatrix3fv(program.uniform('rotation'), false, this.#rotation);
    gl.uniform3f(program.uniform('translation'),
      camFromLines[3] ?? 0, camFromLines[7] ?? 0, camFromLines[11] ?? 0);
    gl.uniform1f(program.uniform('rim_px'), rim_px);
    lines.draw();
    gl.uniform1f(program.uniform('rim_px'), 0);
    lines.draw();
  }

  [Symbol.dispose](): void {
    this.#program[Symbol.dispose]();
  }
}

const IDENTITY = identity<Cam, Cam>().rows;
