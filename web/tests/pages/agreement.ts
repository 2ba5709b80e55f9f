/** Renders MPIs and a live picture that a test hands in, and hands back what came out. */

import { cameraOfWire } from '../../src/geometry';
import { MpiDecoder } from '../../src/mpi/decoder';
import { MpiStore } from '../../src/mpi/mpi_store';
import { AlignPictures } from '../../src/render/align_pictures';
import type { Target } from '../../src/render/target';
import { ViewRenderer, type Look } from '../../src/render/view_renderer';
import type { LiveFrame } from '../../src/sources/frame_source';
import { ViewWeights } from '../../src/view_weights';
import type { Camera as WireCamera, Options } from '../../src/wire';

interface Fixture {
  readonly mpis: readonly { readonly camera: WireCamera; readonly file: string }[];
  readonly camera: WireCamera;
  /** RGBA, bottom row first. */
  readonly live: string;
  readonly options: Options;
  readonly look: Look;
}

/** Frames until what is read back asynchronously has come. */
const FRAMES = 90;

function bytesOf(base64: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
}

function base64Of(bytes: Uint8Array): string {
  let text = '';
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
}

async function renderFixture(fixture: Fixture): Promise<object> {
  const canvas = document.createElement('canvas');
  const camera = cameraOfWire(fixture.camera);
  const { width_px, height_px } = camera.pinhole;
  canvas.width = width_px;
  canvas.height = height_px;
  const gl = canvas.getContext('webgl2', { alpha: false, antialias: false });
  if (gl === null) throw new Error('no WebGL 2');
  const image = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, image);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width_px, height_px, 0, gl.RGBA, gl.UNSIGNED_BYTE,
    bytesOf(fixture.live));
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  using decoder = new MpiDecoder();
  using store = new MpiStore(gl, {
    decoder, maxResident: 8, onProblem: (_, error) => { throw error; },
  });
  let coming = fixture.mpis.length;
  const here = new Promise<void>((resolve) => store.onResident(() => {
    coming -= 1;
    if (coming === 0) resolve();
  }));
  fixture.mpis.forEach((mpi, i) =>
    store.add(String(i), cameraOfWire(mpi.camera), async () => bytesOf(mpi.file).buffer));
  await here;
  using renderer = new ViewRenderer(gl, fixture.options);
  const frame: LiveFrame = {
    time_ms: 0, camera, image, framebuffer: null,
    viewport: { x: 0, y: 0, width: width_px, height: height_px }, pictureId: 1, hasDepth: () => false,
    depth: () => null,
  };
  using pictures = new AlignPictures(gl, targetSizeOf(fixture.options, width_px, height_px));
  let asked = false;
  renderer.onRendered = (_, near, at, targets) => {
    if (asked) return;
    asked = true;
    pictures.request(near, at, targets.view, targets.live);
  };
  let seen = renderer.draw(frame, store, fixture.look);
  for (let i = 1; i < FRAMES || (seen.peakedShare === null && i < 20 * FRAMES); i += 1) {
    gl.finish(); // a busy machine would read back what is older than the last frame
    await new Promise(requestAnimationFrame);
    seen = renderer.draw({ ...frame, time_ms: 100 * i }, store, fixture.look);
  }
  const pixels = (framebuffer: WebGLFramebuffer | null): string => {
    const data = new Uint8Array(4 * width_px * height_px);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.readPixels(0, 0, width_px, height_px, gl.RGBA, gl.UNSIGNED_BYTE, data);
    return base64Of(data);
  };
  let align = pictures.take();
  for (let i = 0; align === null && i < 20 * FRAMES; i += 1) {
    await new Promise(requestAnimationFrame);
    align = pictures.take();
  }
  const targets = renderer.targets();
  if (targets === null) throw new Error('nothing was rendered');
  const of = (target: Target): string => pixels(target.framebuffer);
  return {
    ...seen, display: pixels(null), view: of(targets.view), result: of(targets.result),
    align: base64Of(align ?? new Uint8Array()), align_size: [pictures.width, pictures.height],
    gl_error: gl.getError(),
  };
}

/** As the renderer has it. */
function targetSizeOf(options: Options, width_px: number, height_px: number): { width: number; height: number } {
  const scale = Math.sqrt(options.pixels / (width_px * height_px));
  return { width: Math.round(width_px * scale), height: Math.round(height_px * scale) };
}

function nearest(
  cameras: readonly WireCamera[], target: WireCamera, depth_m: number | null, count: number,
): object {
  const weights = new ViewWeights(count);
  weights.measure(cameras.map(cameraOfWire), cameraOfWire(target));
  const chosen = depth_m === null ? weights.byDistance(count) : weights.byOverlap(depth_m, count);
  return Array.from({ length: chosen.count }, (_, k) => ({
    index: chosen.index[k], weight: chosen.weight[k], distance_m: chosen.distance_m[k],
  }));
}

Object.assign(window, { renderFixture, nearest });
