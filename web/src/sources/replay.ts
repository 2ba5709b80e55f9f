/** A recording of the server, played as the camera. */

import { cameraOfWire, type Camera } from '../geometry';
import type { RecordingIndex } from '../wire';
import { known } from './depth';
import type { DepthMap, FrameSource, LiveFrame, Viewport } from './frame_source';

/** What is needed of the server; `Api` has it. */
export interface RecordingServer {
  recording(name: string): Promise<RecordingIndex>;
  recordedPhoto(name: string, index: number): Promise<Blob>;
  recordedDepth(name: string, index: number): Promise<Uint16Array<ArrayBuffer>>;
}

interface Loaded {
  readonly picture: ImageBitmap;
  readonly depth: DepthMap | null;
}

/** Frames that are held decoded around the one that is shown. */
const AHEAD = 4;

/** Where the recording is, and the buttons to move it. */
export class ReplayControls {
  index = 0;
  count = 0;
  playing = false;

  play(): void { this.playing = true; }

  pause(): void { this.playing = false; }

  step(frames: number): void {
    this.playing = false;
    this.seek(this.index + frames);
  }

  seek(index: number): void {
    this.index = Math.min(Math.max(Math.round(index), 0), Math.max(this.count - 1, 0));
  }

  /** Go on by one, and stop at the end. */
  advance(): void {
    if (this.index + 1 >= this.count) this.playing = false;
    else this.index += 1;
  }
}

export function replaySource(
  server: RecordingServer, name: string, controls: ReplayControls,
): FrameSource {
  return {
    kind: 'replay',
    label: `recording ${name}`,
    run: (gl, onFrame, signal) => run(server, name, controls, gl, onFrame, signal),
  };
}

async function run(
  server: RecordingServer, name: string, controls: ReplayControls, gl: WebGL2RenderingContext,
  onFrame: (frame: LiveFrame) => void, signal: AbortSignal,
): Promise<void> {
  const index = await server.recording(name);
  controls.count = index.frames.length;
  const cameras = index.frames.map((recorded) => cameraOfWire(recorded.camera));
  const cache = new FrameCache(server, index);
  const frame = new ReplayFrame(gl);
  let shownAt_ms = -Infinity;
  await new Promise<void>((resolve, reject) => {
    const next = (time_ms: number): void => {
      if (signal.aborted) {
        resolve();
        return;
      }
      requestAnimationFrame(next);
      try {
        if (controls.playing && time_ms - shownAt_ms >= 1000 / index.fps
          && cache.has(Math.min(controls.index + 1, controls.count - 1))) {
          controls.advance();
        }
        const loaded = cache.get(controls.index);
        const camera = cameras[controls.index];
        if (loaded === null || camera === undefined) return;
        if (frame.show(controls.index, loaded, camera)) shownAt_ms = time_ms;
        frame.time_ms = time_ms;
        onFrame(frame);
      } catch (error) {
        reject(error instanceof Error ? error : new Error(String(error)));
      }
    };
    requestAnimationFrame(next);
  });
  cache.close();
  frame.close();
}

/** Fetches and decodes frames before they are shown. */
class FrameCache {
  readonly #frames = new Map<number, Loaded | 'coming'>();
  /** The frame around which others were let go last. */
  #around = -1;

  constructor(private readonly server: RecordingServer, private readonly index: RecordingIndex) {}

  has(index: number): boolean {
    const held = this.#frames.get(index);
    return held !== undefined && held !== 'coming';
  }

  /** The frame if it is here; it and the next ones are fetched if they are not. */
  get(index: number): Loaded | null {
    const last = Math.min(index + AHEAD, this.index.frames.length - 1);
    for (let i = index; i <= last; i += 1) if (!this.#frames.has(i)) void this.#fetch(i);
    if (index !== this.#around) this.#letGo(index - AHEAD, last);
    this.#around = index;
    const held = this.#frames.get(index);
    return held === undefined || held === 'coming' ? null : held;
  }

  close(): void {
    for (const held of this.#frames.values()) if (held !== 'coming') held.picture.close();
    this.#frames.clear();
  }

  /** All but those from `first` to `last`; what is still coming is let go another time. */
  #letGo(first: number, last: number): void {
    for (const [i, held] of this.#frames) {
      if ((i >= first && i <= last) || held === 'coming') continue;
      held.picture.close();
      this.#frames.delete(i);
    }
  }

  async #fetch(index: number): Promise<void> {
    this.#frames.set(index, 'coming');
    try {
      const layout = this.index.frames[index]?.depth ?? null;
      const [photo, depth_mm] = await Promise.all([
        this.server.recordedPhoto(this.index.name, index),
        layout === null ? null : this.server.recordedDepth(this.index.name, index),
      ]);
      // Textures are filled bottom row first.
      const picture = await createImageBitmap(photo, {
        imageOrientation: 'flipY', colorSpaceConversion: 'none',
      });
      const depth = layout === null || depth_mm === null ? null : known({ ...layout, depth_mm });
      this.#frames.set(index, { picture, depth });
    } catch {
      this.#frames.delete(index); // asked for again at the next frame
    }
  }
}

class ReplayFrame implements LiveFrame {
  time_ms = 0;
  camera: Camera | null = null;
  image: WebGLTexture | null = null;
  readonly framebuffer = null;
  readonly #viewport = { x: 0, y: 0, width: 0, height: 0 };
  #index = -1;
  #depth: DepthMap | null = null;

  constructor(private readonly gl: WebGL2RenderingContext) {}

  get pictureId(): number {
    return this.#index;
  }

  get viewport(): Viewport {
    this.#viewport.width = this.gl.drawingBufferWidth;
    this.#viewport.height = this.gl.drawingBufferHeight;
    return this.#viewport;
  }

  /** Returns whether it is another frame than before. */
  show(index: number, loaded: Loaded, camera: Camera): boolean {
    if (index === this.#index) return false;
    const gl = this.gl;
    this.image ??= gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.image);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, loaded.picture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
    }
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) {
      gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    }
    this.#index = index;
    this.#depth = loaded.depth;
    this.camera = camera;
    const { width_px, height_px } = camera.pinhole;
    fitCanvas(gl.canvas, width_px, height_px);
    return true;
  }

  hasDepth(): boolean {
    return this.#depth !== null;
  }

  depth(): DepthMap | null {
    return this.#depth;
  }

  close(): void {
    this.gl.deleteTexture(this.image);
  }
}

/** Draw at the picture's own aspect; the page's style scales it. */
function fitCanvas(
  canvas: HTMLCanvasElement | OffscreenCanvas, width_px: number, height_px: number,
): void {
  if (canvas.width === width_px && canvas.height === height_px) return;
  canvas.width = width_px;
  canvas.height = height_px;
}
