/** The parts of the renderer that a test asks for one by one, in a real browser. */

import { PhotoReader } from '../../src/capture/photo';
import { cameraOfWire, type Camera } from '../../src/geometry';
import { Memory } from '../../src/memory/memory';
import { MpiDecoder } from '../../src/mpi/decoder';
import { MpiStore } from '../../src/mpi/mpi_store';
import { Program, ShaderError } from '../../src/render/program';
import type { Part } from '../../src/render/shares';
import type { Targets } from '../../src/render/targets';
import { ViewRenderer, type Look, type Seen } from '../../src/render/view_renderer';
import { depthMapOf, type DepthFormat, type DepthGeometry } from '../../src/sources/depth';
import type { DepthMap, LiveFrame, Viewport } from '../../src/sources/frame_source';
import type { DepthTexture } from '../../src/sources/gpu_depth';
import { webXrSource } from '../../src/sources/webxr';
import type { Camera as WireCamera, Options } from '../../src/wire';
import { TEXTURE_COLS } from '../../src/mpi/decode';
import { TILE_PX } from '../../src/mpi/mpi_file';

const LOOK: Look = { overlay: 'peaks', threshold: 0.4, peakOpacity: 1, pattern: false };

function bytesOf(base64: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
}

function base64Of(bytes: Uint8Array): string {
  let text = '';
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
}

/** The texels as they go to the card, and the median of the times that decoding took. */
async function decode(file: string, times: number): Promise<object> {
  using decoder = new MpiDecoder();
  const bytes = bytesOf(file).buffer;
  await decoder.decode(bytes); // the worker starts, and what it runs is compiled
  const took_ms: number[] = [];
  let mpi = await decoder.decode(bytes);
  for (let i = 0; i < times; i += 1) {
    const begin_ms = performance.now();
    mpi = await decoder.decode(bytes);
    took_ms.push(performance.now() - begin_ms);
  }
  took_ms.sort((a, b) => a - b);
  return {
    texels: base64Of(mpi.texels), width: TEXTURE_COLS * TILE_PX,
    height: mpi.textureRows * TILE_PX, num_tiles: mpi.numTiles,
    took_ms: took_ms[times >> 1] ?? null,
  };
}

function contextOf(width: number, height: number): WebGL2RenderingContext {
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  const gl = canvas.getContext('webgl2', { alpha: false, antialias: false });
  if (gl === null) throw new Error('no WebGL 2');
  return gl;
}

/** A renderer with MPIs on the card and a live picture, frame by frame. */
class Bench implements Disposable {
  readonly gl: WebGL2RenderingContext;
  readonly store: MpiStore;
  readonly renderer: ViewRenderer;
  readonly #decoder = new MpiDecoder();
  readonly #image: WebGLTexture;
  #camera: Camera;
  depth: DepthMap | null = null;

  constructor(
    options: Options, camera: WireCamera, live: string, readonly viewport: Viewport,
    size: { readonly width: number; readonly height: number } = viewport,
  ) {
    const gl = contextOf(size.width, size.height);
    this.gl = gl;
    this.#camera = cameraOfWire(camera);
    const { width_px, height_px } = camera.pinhole;
    this.#image = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.#image);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width_px, height_px, 0, gl.RGBA, gl.UNSIGNED_BYTE,
      bytesOf(live));
    this.store = new MpiStore(gl, {
      decoder: this.#decoder, maxResident: 12, onProblem: (_, error) => { throw error; },
    });
    this.renderer = new ViewRenderer(gl, options);
  }

  async add(files: Scene['mpis'], prefix = ''): Promise<void> {
    let coming = files.length;
    if (coming === 0) return;
    const here = new Promise<void>((resolve) => this.store.onResident(() => {
      coming -= 1;
      if (coming === 0) resolve();
    }));
    files.forEach(({ camera, file }, i) =>
      this.store.add(prefix + String(i), cameraOfWire(camera), async () => bytesOf(file).buffer));
    await here;
  }

  /** Another live picture of the same size. */
  setLive(live: string): void {
    const { gl } = this;
    const { width_px, height_px } = this.#camera.pinhole;
    gl.bindTexture(gl.TEXTURE_2D, this.#image);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width_px, height_px, gl.RGBA, gl.UNSIGNED_BYTE,
      bytesOf(live));
  }

  /** Look from somewhere else, with a picture of the same size. */
  look(camera: Camera): void {
    this.#camera = camera;
  }

  frame(time_ms: number, pictureId: number | null = null): LiveFrame {
    return {
      time_ms, camera: this.#camera, image: this.#image, framebuffer: null,
      viewport: this.viewport, pictureId, hasDepth: () => this.depth !== null, depth: () => this.depth,
    };
  }

  draw(time_ms: number, look: Partial<Look> = {}, pictureId: number | null = null): Seen {
    return this.renderer.draw(this.frame(time_ms, pictureId), this.store, { ...LOOK, ...look });
  }

  get targets(): Targets {
    const targets = this.renderer.targets();
    if (targets === null) throw new Error('nothing was drawn');
    return targets as Targets;
  }

  /** RGBA, bottom row first, of a texture that is so many times as large as the view. */
  readTexture(texture: WebGLTexture, scale: number): Uint8Array {
    const { gl } = this;
    const width = Math.floor(scale * this.targets.view.width);
    const height = Math.floor(scale * this.targets.view.height);
    const pixels = new Uint8Array(4 * width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return pixels;
  }

  /** RGBA, bottom row first. */
  read(name: 'view' | 'result' | 'live' | 'display'): Uint8Array {
    const { gl } = this;
    const target = name === 'display' ? null : this.renderer.targets()?.[name] ?? null;
    const width = target?.width ?? gl.drawingBufferWidth;
    const height = target?.height ?? gl.drawingBufferHeight;
    const pixels = new Uint8Array(4 * width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target?.framebuffer ?? null);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return pixels;
  }

  [Symbol.dispose](): void {
    this.renderer[Symbol.dispose]();
    this.store[Symbol.dispose]();
    this.#decoder[Symbol.dispose]();
    this.gl.getExtension('WEBGL_lose_context')?.loseContext();
  }
}

interface Scene {
  readonly options: Options;
  readonly camera: WireCamera;
  readonly live: string;
  readonly mpis: readonly { readonly camera: WireCamera; readonly file: string }[];
}

function viewportOf({ camera }: Scene): Viewport {
  return { x: 0, y: 0, width: camera.pinhole.width_px, height: camera.pinhole.height_px };
}

/** One frame: what was rendered, compared and drawn into the viewport of a canvas. */
async function oneFrame(
  scene: Scene, viewport: Viewport, size: { width: number; height: number },
): Promise<object> {
  using bench = new Bench(scene.options, scene.camera, scene.live, viewport, size);
  await bench.add(scene.mpis);
  bench.gl.clearColor(0, 1, 0, 1);
  bench.gl.clear(bench.gl.COLOR_BUFFER_BIT);
  bench.draw(0);
  const display = base64Of(bench.read('display'));
  const { width, height } = bench.renderer.targets()?.live ?? { width: 0, height: 0 };
  return {
    display, width, height, live: base64Of(bench.read('live')), view: base64Of(bench.read('view')),
    gl_error: bench.gl.getError(),
  };
}

/**
 * Red or not, of one pixel after every frame: all pixels are wrong in a frame where `wrong` says
 * so, and none in the others.
 */
async function flicker(
  scene: Scene, wrong: readonly boolean[], frame_ms: number,
): Promise<readonly boolean[]> {
  using bench = new Bench(scene.options, scene.camera, scene.live, viewportOf(scene));
  await bench.add(scene.mpis);
  const { width, height } = viewportOf(scene);
  const middle = 4 * (width * (height >> 1) + (width >> 1));
  return wrong.map((all, i) => {
    bench.draw(1000 + frame_ms * i, { threshold: all ? -1 : 3 });
    const pixels = bench.read('display');
    return pixels[middle] === 255 && pixels[middle + 1] === 0;
  });
}

interface MarksAsked {
  readonly look: Partial<Look>;
  /** Of the memory: its size, and RGBA, bottom row first; null: there is none. */
  readonly memory: { readonly width: number; readonly height: number; readonly rgba: string } | null;
  readonly visible: Part;
  /** Pixels of the screen per pixel of the view. */
  readonly scale: number;
  readonly touches: readonly (readonly [x: number, y: number])[];
}

/** Frames until what is shown has settled, and what is read back asynchronously has come. */
const SETTLED_FRAMES = 90;

/** What is marked of a scene, once it has settled; and what a memory that comes later changes. */
async function marks(scene: Scene, asked: MarksAsked): Promise<object> {
  const { width, height } = viewportOf(scene);
  const screen = { x: 0, y: 0, width: asked.scale * width, height: asked.scale * height };
  using bench = new Bench(scene.options, scene.camera, scene.live, screen);
  await bench.add(scene.mpis);
  const { gl, renderer } = bench;
  renderer.visible = asked.visible;
  bench.draw(0, asked.look, 1);
  const without = base64Of(bench.read('result'));
  if (asked.memory !== null) {
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, asked.memory.width, asked.memory.height, 0, gl.RGBA,
      gl.UNSIGNED_BYTE, bytesOf(asked.memory.rgba));
    const remembered = { texture, number: 0 };
    renderer.remembered = () => remembered;
  }
  let seen = bench.draw(100, asked.look, 1);
  for (let i = 2; i < SETTLED_FRAMES; i += 1) {
    seen = bench.draw(100 * i, asked.look, 1);
    gl.finish();
    await new Promise(requestAnimationFrame);
  }
  return {
    ...seen, without, result: base64Of(bench.read('result')), display: base64Of(bench.read('display')),
    why: asked.touches.map(([x, y]) => renderer.whyUnfixable(x, y)), gl_error: gl.getError(),
  };
}

interface Looked {
  readonly camera: WireCamera;
  readonly live: string;
  /** Millimetres, top row first; null: none. */
  readonly depth: { readonly width: number; readonly height: number; readonly mm: string } | null;
}

/** What is remembered of places that are looked at one after the other, and where else it is wrong. */
async function lookAround(
  scene: Scene, looks: readonly Looked[], copies: number,
): Promise<readonly object[]> {
  using bench = new Bench(scene.options, scene.camera, scene.live, viewportOf(scene));
  const { gl, renderer, store } = bench;
  using memory = new Memory(gl, store);
  await bench.add(scene.mpis);
  for (let copy = 0; copy < copies; copy += 1) {
    // Views of another place: they want layers, and push the others off the card.
    memory.observe(bench.frame(0));
    memory.observe(bench.frame(0));
    const away = scene.mpis.map(({ camera, file }) => ({
      file,
      camera: { ...camera, world_from_cam: camera.world_from_cam.map((x, i) => i === 3 ? x + 90 + copy : x) },
    }));
    await bench.add(away, `copy ${copy} `);
  }
  const told: object[] = [];
  for (const { camera, live, depth } of looks) {
    bench.look(cameraOfWire(camera));
    bench.setLive(live);
    const map: DepthMap | null = depth === null ? null : {
      width_px: depth.width, height_px: depth.height, depth_mm: new Uint16Array(bytesOf(depth.mm).buffer),
    };
    bench.depth = map;
    renderer.remembered = memory.tell;
    for (let i = 0; i < SETTLED_FRAMES; i += 1) {
      memory.observe(bench.frame(100 * i));
      bench.draw(100 * i);
      await new Promise(requestAnimationFrame);
    }
    const said = memory.tell(cameraOfWire(camera), bench.targets);
    told.push({
      said: said === null ? null : base64Of(bench.readTexture(said.texture, 0.5)),
      result: base64Of(bench.read('result')), elsewhere: memory.elsewhere(cameraOfWire(camera)),
      gl_error: gl.getError(),
    });
  }
  return told;
}

/** Milliseconds of a frame whose end is waited for: median, and bytes of an MPI on the card. */
async function frameTime(scene: Scene, frames: number): Promise<object> {
  using bench = new Bench(scene.options, scene.camera, scene.live, viewportOf(scene));
  await bench.add(scene.mpis);
  const pixel = new Uint8Array(4);
  const took_ms: number[] = [];
  for (let i = 0; i < frames + 2; i += 1) {
    const begin_ms = performance.now();
    bench.draw(100 * i);
    bench.gl.readPixels(0, 0, 1, 1, bench.gl.RGBA, bench.gl.UNSIGNED_BYTE, pixel);
    if (i >= 2) took_ms.push(performance.now() - begin_ms);
    await new Promise((resolve) => setTimeout(resolve, 0));
  }
  took_ms.sort((a, b) => a - b);
  return {
    median_ms: took_ms[frames >> 1] ?? null, least_ms: took_ms[0] ?? null,
    bytes_per_view: bench.store.residentBytes / Math.max(bench.store.residentCount, 1),
  };
}

/**
 * Frames of a phone that is held still, then another picture, then another threshold: passes drawn
 * in each, and whether the result is that of a renderer that computes everything anew.
 */
async function stillFrames(scene: Scene, other: string): Promise<readonly object[]> {
  using still = new Bench(scene.options, scene.camera, scene.live, viewportOf(scene));
  using anew = new Bench(scene.options, scene.camera, scene.live, viewportOf(scene));
  await still.add(scene.mpis);
  await anew.add(scene.mpis);
  let passes = 0;
  for (const name of ['drawArrays', 'drawArraysInstanced'] as const) {
    const draw = still.gl[name].bind(still.gl) as (...args: number[]) => void;
    still.gl[name] = (...args: number[]) => { passes += 1; draw(...args); };
  }
  const steps: readonly (readonly [picture: number, threshold: number])[] = [
    [1, 0.4], [1, 0.4], [1, 0.4], [2, 0.4], [2, 0.4], [2, 0.4], [2, 0.1], [2, 0.1]];
  return steps.map(([picture, threshold], i) => {
    if (picture === 2 && steps[i - 1]?.[0] === 1) for (const each of [still, anew]) each.setLive(other);
    passes = 0;
    still.draw(100 * i, { threshold }, picture);
    anew.draw(100 * i, { threshold });
    const [ours, theirs] = [still, anew].map((each) => base64Of(each.read('result')));
    return { passes, same: ours === theirs };
  });
}

function brokenShader(): string {
  const vertex = '#version 300 es\nvoid main() {\n  gl_Position = nonsense;\n}\n';
  try {
    using program = new Program(contextOf(1, 1), vertex, vertex);
    program.use();
  } catch (error) {
    if (error instanceof ShaderError) return error.message;
    throw error;
  }
  return '';
}

interface DepthOnTheCard {
  readonly format: DepthFormat;
  /** Layers of the texture, of which the last is the one; null: not an array. */
  readonly layers: number | null;
  readonly width: number;
  readonly height: number;
  /** The buffer's bytes. */
  readonly data: string;
  readonly raw_value_to_meters: number;
  readonly matrix: readonly number[];
  readonly aspect: number;
}

/** A texture as a headset hands it out: nobody set a filter. */
function depthTexture(gl: WebGL2RenderingContext, depth: DepthOnTheCard): WebGLTexture {
  const bytes = bytesOf(depth.data).buffer;
  const { width, height, layers } = depth;
  const kinds: Record<DepthFormat, readonly [GLenum, GLenum, GLenum, ArrayBufferView]> = {
    'luminance-alpha': [
      gl.LUMINANCE_ALPHA, gl.LUMINANCE_ALPHA, gl.UNSIGNED_BYTE, new Uint8Array(bytes)],
    'unsigned-short': [gl.R16UI, gl.RED_INTEGER, gl.UNSIGNED_SHORT, new Uint16Array(bytes)],
    float32: [gl.R32F, gl.RED, gl.FLOAT, new Float32Array(bytes)],
  };
  const [inside, format, type, values] = kinds[depth.format];
  const texture = gl.createTexture();
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  if (layers === null) {
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, format, type, values);
  } else {
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
    gl.texImage3D(
      gl.TEXTURE_2D_ARRAY, 0, inside, width, height, layers, 0, format, type, null);
    gl.texSubImage3D(
      gl.TEXTURE_2D_ARRAY, 0, 0, 0, layers - 1, width, height, 1, format, type, values);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, null);
  }
  return texture;
}

/**
 * A device that gives depth as a texture only, through the source as phones run it; and what the
 * same buffer gives in memory.
 */
async function headsetDepth(depth: DepthOnTheCard): Promise<object> {
  const gl = contextOf(4, 4);
  const geometry: DepthGeometry = {
    width: depth.width, height: depth.height, rawValueToMeters: depth.raw_value_to_meters,
    normDepthBufferFromNormView: { matrix: Float32Array.from(depth.matrix) },
  };
  const given: DepthTexture = {
    ...geometry, texture: depthTexture(gl, depth),
    textureType: depth.layers === null ? 'texture' : 'texture-array',
    imageIndex: depth.layers === null ? null : depth.layers - 1,
  };
  let asked: XRSessionInit | undefined;
  const device = new Headset(given, depth.format, Math.round(1000 * depth.aspect));
  Object.defineProperty(navigator, 'xr', {
    configurable: true,
    value: { requestSession: (_: string, init: XRSessionInit) => { asked = init; return device; } },
  });
  Object.assign(window, {
    XRWebGLLayer: class { framebuffer = null; getViewport(): null { return null; } },
    XRWebGLBinding: class {
      getCameraImage(): null { return null; }
      getDepthInformation(): DepthTexture { return given; }
    },
  });
  Object.assign(gl, { makeXRCompatible: async () => undefined });
  let read: DepthMap | null = null;
  const stop = new AbortController();
  await webXrSource({ overlay: null }).run(gl, (frame) => {
    if (frame.hasDepth()) read = frame.depth();
    stop.abort();
  }, stop.signal);
  const inMemory = depthMapOf(
    { ...geometry, data: bytesOf(depth.data).buffer }, depth.format, depth.aspect);
  const listed = (map: DepthMap | null): object | null =>
    (map === null ? null : { ...map, depth_mm: Array.from(map.depth_mm) });
  return { asked, read: listed(read), in_memory: listed(inMemory), gl_error: gl.getError() };
}

/** A session with one view whose camera picture is `width` × 1000. */
class Headset extends EventTarget {
  readonly depthUsage = 'gpu-optimized';
  readonly #view;

  constructor(
    private readonly given: DepthTexture, readonly depthDataFormat: DepthFormat, width: number,
  ) {
    super();
    const identity = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1);
    this.#view = {
      camera: { width, height: 1000 }, projectionMatrix: identity, transform: { matrix: identity },
    };
  }

  async updateRenderState(): Promise<void> { /* nothing to draw on */ }

  async requestReferenceSpace(): Promise<object> { return new EventTarget(); }

  requestAnimationFrame(next: (time_ms: number, frame: object) => void): void {
    setTimeout(next, 0, 0, {
      getViewerPose: () => ({ views: [this.#view] }),
      getDepthInformation: () => {
        throw new DOMException(`a texture of ${this.given.width}`, 'InvalidStateError');
      },
    });
  }

  async end(): Promise<void> { this.dispatchEvent(new Event('end')); }
}

/** What goes to the encoder of a photo whose longer side may have so many pixels: RGBA, top row first. */
async function photoOf(camera: WireCamera, live: string, longSide_px: number): Promise<object> {
  const { width_px, height_px } = camera.pinhole;
  const gl = contextOf(8, 8);
  const image = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, image);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width_px, height_px, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytesOf(live));
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  let pixels = '';
  const encoder = {
    encode(rgba: Uint8Array) {
      pixels = base64Of(rgba);
      return Promise.resolve({ jpeg: new Blob(), thumbnail: new Blob() });
    },
    [Symbol.dispose]() { /* nothing is held */ },
  };
  using reader = new PhotoReader(gl, { encoder, longSide_px });
  const frame = {
    camera: cameraOfWire(camera), image, depth: () => null, hasDepth: () => false,
  } as unknown as LiveFrame;
  const photo = await reader.read(frame);
  return { pixels, pinhole: photo.camera.pinhole, error: gl.getError() };
}

const core = { stillFrames, photoOf, headsetDepth, decode, oneFrame, flicker, frameTime, brokenShader, marks, lookAround };
export type Core = typeof core;
Object.assign(window, { core });
