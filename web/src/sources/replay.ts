/** A recording of the server, or a trace of a phone, played as the camera. */

import { cameraOfWire, type Camera } from '../geometry';
import type { RecordingIndex } from '../wire';
import { known } from './depth';
import type { DepthMap, FrameSource, LiveFrame, Viewport, WorldResets } from './frame_source';
import { textureOf, type Loaded, type Played, type RecordingServer } from './played';
import { playedTrace } from './trace';

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
  const played = index.trace == null ? playedRecording(server, index)
    : playedTrace(server, name, index.trace);
  controls.count = played.count;
  const cache = new FrameCache(played);
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
        if (controls.playing && time_ms - shownAt_ms >= played.duration_ms(controls.index)
          && cache.has(Math.min(controls.index + 1, controls.count - 1))) {
          controls.advance();
        }
        const loaded = cache.get(controls.index);
        if (loaded === null) return;
        if (frame.show(controls.index, loaded, played)) shownAt_ms = time_ms;
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

function playedRecording(server: RecordingServer, index: RecordingIndex): Played {
  const cameras = index.frames.map((recorded) => cameraOfWire(recorded.camera));
  return {
    count: cameras.length,
    camera: (i) => cameras[i] ?? null,
    duration_ms: () => 1000 / index.fps,
    resets: () => null,
    async load(i) {
      const layout = index.frames[i]?.depth ?? null;
      const [photo, depth] = await Promise.all([
        server.recordedPhoto(index.name, i),
        layout === null ? null : server.recordedDepth(index.name, i),
      ]);
      return {
        picture: await textureOf(photo),
        depth: layout === null || depth === null ? null
          : known({ ...layout, depth_mm: new Uint16Array(depth) }),
      };
    },
  };
}

/** Fetches and decodes frames before they are shown. */
class FrameCache {
  readonly #frames = new Map<number, Loaded | 'coming'>();
  /** The frame around which others were let go last. */
  #around = -1;

  constructor(private readonly played: Played) {}

  has(index: number): boolean {
    const held = this.#frames.get(index);
    return held !== undefined && held !== 'coming';
  }

  /** The frame if it is here; it and the next ones are fetched if they are not. */
  get(index: number): Loaded | null {
    const last = Math.min(index + AHEAD, this.played.count - 1);
    for (let i = index; i <= last; i += 1) if (!this.#frames.has(i)) void this.#fetch(i);
    if (index !== this.#around) this.#letGo(index - AHEAD, last);
    this.#around = index;
    const held = this.#frames.get(index);
    return held === undefined || held === 'coming' ? null : held;
  }

  close(): void {
    for (const held of this.#frames.values()) if (held !== 'coming') held.picture?.close();
    this.#frames.clear();
  }

  /** All but those from `first` to `last`; what is still coming is let go another time. */
  #letGo(first: number, last: number): void {
    for (const [i, held] of this.#frames) {
      if ((i >= first && i <= last) || held === 'coming') continue;
      held.picture?.close();
      this.#frames.delete(i);
    }
  }

  async #fetch(index: number): Promise<void> {
    this.#frames.set(index, 'coming');
    try {
      this.#frames.set(index, await this.played.load(index));
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
  resets: WorldResets = { followed: 0, lost: 0 };
  readonly #texture: WebGLTexture;
  readonly #viewport = { x: 0, y: 0, width: 0, height: 0 };
  #index = -1;
  #depth: DepthMap | null = null;

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.#texture = gl.createTexture();
  }

  get pictureId(): number {
    return this.#index;
  }

  get viewport(): Viewport {
    this.#viewport.width = this.gl.drawingBufferWidth;
    this.#viewport.height = this.gl.drawingBufferHeight;
    return this.#viewport;
  }

  /** Returns whether it is another frame than before. */
  show(index: number, { picture, depth }: Loaded, played: Played): boolean {
    if (index === this.#index) return false;
    this.#index = index;
    this.#depth = depth;
    this.resets = played.resets(index) ?? this.resets;
    this.camera = picture === null ? null : played.camera(index);
    this.image = picture === null ? null : this.#texture;
    if (picture === null || this.camera === null) return true;
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#texture);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
    }
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) {
      gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    }
    fitCanvas(gl.canvas, this.camera.pinhole.width_px, this.camera.pinhole.height_px);
    return true;
  }

  hasDepth(): boolean {
    return this.#depth !== null;
  }

  depth(): DepthMap | null {
    return this.#depth;
  }

  close(): void {
    this.gl.deleteTexture(this.#texture);
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
