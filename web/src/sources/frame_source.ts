/**
 * Where live pictures, depth and poses come from. Phone, virtual phone and recording are the same to
 * the rest of the client.
 *
 * A callback, not an async iterator: WebXR's camera texture is only valid inside the callback.
 */

import type { Camera } from '../geometry';

export type SourceKind = 'webxr' | 'virtual' | 'replay';

/** Millimetres along +z, 0 = unknown, rows from the top; covers the picture's field of view. */
export interface DepthMap {
  readonly width_px: number;
  readonly height_px: number;
  readonly depth_mm: Uint16Array<ArrayBuffer>;
}

export interface Viewport {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

/** How often the device gave its world another origin. */
export interface WorldResets {
  /** It said where the old one lies, so poses go on as if nothing had happened. */
  readonly followed: number;
  /** It did not: what was captured before lies elsewhere. */
  readonly lost: number;
}

/** The part of `XRDepthInformation` that is needed: how a buffer of depth lies in the view. */
export interface DepthGeometry {
  readonly width: number;
  readonly height: number;
  readonly rawValueToMeters: number;
  /** From normalized view coordinates (top left origin) to normalized depth coordinates. */
  readonly normDepthBufferFromNormView: { readonly matrix: Float32Array };
}

/** The part of `XRCPUDepthInformation` that is needed. */
export interface RawDepth extends DepthGeometry {
  readonly data: ArrayBuffer;
}

export type DepthFormat = 'luminance-alpha' | 'unsigned-short' | 'float32';

/** What a device says of a frame, before anything is made of it. Valid only during the callback. */
export interface Told {
  /** `XRView.transform` and `projectionMatrix`, column by column; null while tracking is lost. */
  readonly worldFromView: Float32Array | null;
  readonly projection: Float32Array | null;
  /** Null where there is none, or it is not in memory. */
  depth(): { readonly raw: RawDepth; readonly format: DepthFormat } | null;
  /** Events `reset` since the frame before: the transform, where it is told. */
  readonly resets: readonly (Float32Array | null)[];
}

/** One moment of the live picture. Valid only during the callback; the object is used again. */
export interface LiveFrame {
  /** Of `performance.now()`'s clock. */
  readonly time_ms: number;
  /** Of the live picture at its own size; null while tracking is lost. Its numbers change with the frame. */
  readonly camera: Camera | null;
  /** The live picture, RGBA8 without alpha, **bottom row first** as GL has it; null when there is none. */
  readonly image: WebGLTexture | null;
  /** Since the source began; absent where it cannot happen. */
  readonly resets?: WorldResets;
  /** Of devices only. */
  readonly told?: Told;
  /** Changes when the picture does; null where nobody knows, as of a camera. */
  readonly pictureId: number | null;
  /** Where to draw. */
  readonly framebuffer: WebGLFramebuffer | null;
  readonly viewport: Viewport;
  /** Whether `depth()` would give something; costs less. */
  hasDepth(): boolean;
  /** Depth of this very frame, resampled to the picture's field of view; null when there is none yet. */
  depth(): DepthMap | null;
}

export interface FrameSource {
  readonly kind: SourceKind;
  /** For people: "ARCore camera", "virtual phone", "recording desk". */
  readonly label: string;
  /**
   * Call `onFrame` for every frame until the signal aborts or the device ends the session; then
   * resolve. Rejects with `SourceError` when it cannot begin.
   */
  run(
    gl: WebGL2RenderingContext, onFrame: (frame: LiveFrame) => void, signal: AbortSignal,
  ): Promise<void>;
}

/** A sentence for the photographer: what is wrong and what to do. */
export class SourceError extends Error {
  override readonly name = 'SourceError';
}
