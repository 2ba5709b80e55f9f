/**
 * Reads the live picture at its full size, with the depth and the camera of that very frame,
 * without making the frame loop wait: the pixels come through a pixel buffer and a fence, and JPEG
 * is made in a worker.
 */

import {
  resized, rigid, type Cam, type Camera, type Pinhole, type Rigid, type World,
} from '../geometry';
import type { DepthMap, LiveFrame } from '../sources/frame_source';
import { WorkerPhotoEncoder, type PhotoEncoder } from './photo_encoder';

export interface CapturedPhoto {
  /** Of the photo, at its full size. */
  readonly camera: Camera;
  readonly jpeg: Blob;
  /** JPEG, long side 260 px. */
  readonly thumbnail: Blob;
  /** Null when the device had none for this frame. */
  readonly depth: DepthMap | null;
  /** Seconds since 1970. */
  readonly time_s: number;
  /** Where the picture shows that it was taken, beside what the device says; null when nobody knows. */
  readonly correctedWorldFromCam?: Rigid<World, Cam> | null;
  /** Taken by the automatic shutter. */
  readonly automatic?: boolean;
}

/** A sentence for the photographer: why there is no photo. */
export class PhotoError extends Error {
  override readonly name = 'PhotoError';
}

export interface PhotoReaderOptions {
  /** Seconds since 1970. */
  readonly clock_s?: () => number;
  readonly encoder?: PhotoEncoder;
  /** Pictures whose longer side has more pixels are made smaller. */
  readonly longSide_px?: number;
  /** Of the JPEG, 0…1. */
  readonly quality?: number;
}

const POLL_MS = 4;
const PATIENCE_MS = 10_000;

export class PhotoReader implements Disposable {
  readonly #clock_s: () => number;
  readonly #encoder: PhotoEncoder;
  readonly #longSide_px: number;
  readonly #quality: number | undefined;
  readonly #camera: WebGLFramebuffer;
  readonly #upright: WebGLFramebuffer;

  constructor(readonly gl: WebGL2RenderingContext, options: PhotoReaderOptions = {}) {
    this.#clock_s = options.clock_s ?? (() => Date.now() / 1000);
    this.#encoder = options.encoder ?? new WorkerPhotoEncoder();
    this.#longSide_px = options.longSide_px ?? Infinity;
    this.#quality = options.quality;
    this.#camera = gl.createFramebuffer();
    this.#upright = gl.createFramebuffer();
  }

  /**
   * Call it inside the frame's callback: all that is only valid there is copied before it returns.
   *
   * @throws PhotoError Tracking or picture is missing, the picture cannot be read, or the graphics
   *   driver does not answer.
   */
  async read(frame: LiveFrame): Promise<CapturedPhoto> {
    const { camera: live, image } = frame;
    if (live === null) throw new PhotoError('No photo: tracking is lost.');
    if (image === null) throw new PhotoError('No photo: there is no camera picture yet.');
    const time_s = this.#clock_s();
    const { pinhole } = live;
    const scale = Math.min(1, this.#longSide_px / Math.max(pinhole.width_px, pinhole.height_px));
    const width_px = Math.max(1, Math.round(scale * pinhole.width_px));
    const height_px = Math.max(1, Math.round(scale * pinhole.height_px));
    const camera: Camera = {
      pinhole: resized(pinhole, width_px, height_px), worldFromCam: rigid(live.worldFromCam.rows),
    };
    const map = frame.depth();
    const depth = map === null ? null : { ...map, depth_mm: map.depth_mm.slice() };
    const buffer = this.#beginReading(image, pinhole, camera.pinhole);
    const rgba = await this.#pixels(buffer, 4 * width_px * height_px);
    const { jpeg, thumbnail } = await this.#encoder.encode(
      rgba, width_px, height_px, this.#quality);
    return { camera, jpeg, thumbnail, depth, time_s };
  }

  [Symbol.dispose](): void {
    this.gl.deleteFramebuffer(this.#camera);
    this.gl.deleteFramebuffer(this.#upright);
    this.#encoder[Symbol.dispose]();
  }

  /**
   * Copies the picture, top row first, and begins to read the copy; WebXR's texture may only be
   * read from, and only now. Leaves GL as it was.
   */
  #beginReading(image: WebGLTexture, whole: Pinhole, photo: Pinhole): WebGLBuffer {
    const { gl } = this;
    const { width_px, height_px } = photo;
    const before = bindings(gl);
    const copy = gl.createRenderbuffer();
    const buffer = gl.createBuffer();
    try {
      gl.bindRenderbuffer(gl.RENDERBUFFER, copy);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width_px, height_px);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.#upright);
      gl.framebufferRenderbuffer(
        gl.DRAW_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, copy);
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#camera);
      gl.framebufferTexture2D(
        gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, image, 0);
      const status = gl.checkFramebufferStatus(gl.READ_FRAMEBUFFER);
      if (status !== gl.FRAMEBUFFER_COMPLETE) {
        throw new PhotoError(`No photo: this browser does not allow reading the camera picture `
          + `(framebuffer status 0x${status.toString(16)}).`);
      }
      gl.disable(gl.SCISSOR_TEST);
      // Turned upside down on the way: GL's rows begin at the bottom, a photo's at the top.
      gl.blitFramebuffer(0, 0, whole.width_px, whole.height_px, 0, height_px, width_px, 0,
        gl.COLOR_BUFFER_BIT, width_px === whole.width_px ? gl.NEAREST : gl.LINEAR);
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#upright);
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
      gl.bufferData(gl.PIXEL_PACK_BUFFER, 4 * width_px * height_px, gl.STREAM_READ);
      for (const name of packingOf(gl)) gl.pixelStorei(name, name === gl.PACK_ALIGNMENT ? 4 : 0);
      gl.readPixels(0, 0, width_px, height_px, gl.RGBA, gl.UNSIGNED_BYTE, 0);
      return buffer;
    } catch (error) {
      gl.deleteBuffer(buffer);
      throw error;
    } finally {
      // The texture is the browser's: nothing of it is kept.
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#camera);
      gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, null, 0);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.#upright);
      gl.framebufferRenderbuffer(
        gl.DRAW_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, null);
      gl.deleteRenderbuffer(copy);
      before.restore();
    }
  }

  async #pixels(buffer: WebGLBuffer, num_bytes: number): Promise<Uint8Array<ArrayBuffer>> {
    const { gl } = this;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    try {
      if (fence === null) throw new PhotoError('No photo: the graphics context is lost.');
      for (let waited_ms = 0; !hasPassed(gl, fence); waited_ms += POLL_MS) {
        if (gl.isContextLost() || waited_ms > PATIENCE_MS) {
          throw new PhotoError('No photo: the graphics driver did not return the picture.');
        }
        await new Promise((resolve) => setTimeout(resolve, POLL_MS));
      }
      const bytes = new Uint8Array(num_bytes);
      const bound = gl.getParameter(gl.PIXEL_PACK_BUFFER_BINDING) as WebGLBuffer | null;
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
      gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, bytes);
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, bound);
      return bytes;
    } finally {
      gl.deleteSync(fence);
      gl.deleteBuffer(buffer);
    }
  }
}

function hasPassed(gl: WebGL2RenderingContext, fence: WebGLSync): boolean {
  const status = gl.clientWaitSync(fence, 0, 0);
  return status === gl.ALREADY_SIGNALED || status === gl.CONDITION_SATISFIED;
}

function packingOf(gl: WebGL2RenderingContext): readonly GLenum[] {
  return [gl.PACK_ALIGNMENT, gl.PACK_ROW_LENGTH, gl.PACK_SKIP_PIXELS, gl.PACK_SKIP_ROWS];
}

/** What reading a photo touches, to be put back for the renderer. */
function bindings(gl: WebGL2RenderingContext): { restore(): void } {
  const bound = <T>(name: GLenum): T | null => gl.getParameter(name) as T | null;
  const draw = bound<WebGLFramebuffer>(gl.DRAW_FRAMEBUFFER_BINDING);
  const read = bound<WebGLFramebuffer>(gl.READ_FRAMEBUFFER_BINDING);
  const renderbuffer = bound<WebGLRenderbuffer>(gl.RENDERBUFFER_BINDING);
  const pack = bound<WebGLBuffer>(gl.PIXEL_PACK_BUFFER_BINDING);
  const scissor = gl.isEnabled(gl.SCISSOR_TEST);
  const packing = packingOf(gl).map((name) => [name, gl.getParameter(name) as number] as const);
  return {
    restore() {
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, draw);
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, read);
      gl.bindRenderbuffer(gl.RENDERBUFFER, renderbuffer);
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, pack);
      if (scissor) gl.enable(gl.SCISSOR_TEST);
      for (const [name, value] of packing) gl.pixelStorei(name, value);
    },
  };
}
