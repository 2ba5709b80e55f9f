/** What is played as the camera, whatever it was recorded as. */

import type { Camera } from '../geometry';
import type { RecordingIndex } from '../wire';
import type { DepthMap, WorldResets } from './frame_source';

/** What is needed of the server; `Api` has it. */
export interface RecordingServer {
  recording(name: string): Promise<RecordingIndex>;
  recordedPhoto(name: string, index: number): Promise<Blob>;
  recordedDepth(name: string, index: number): Promise<ArrayBuffer>;
}

/** A frame that can be shown. */
export interface Loaded {
  /** Bottom row first, as textures are filled; null while tracking was lost. */
  readonly picture: ImageBitmap | null;
  readonly depth: DepthMap | null;
}

/** What is played: frames in their order. */
export interface Played {
  readonly count: number;
  camera(index: number): Camera | null;
  /** How long a frame is shown. */
  duration_ms(index: number): number;
  /** Until a frame, where the device could tell. */
  resets(index: number): WorldResets | null;
  load(index: number): Promise<Loaded>;
}

/** Textures are filled bottom row first. */
export function textureOf(photo: Blob): Promise<ImageBitmap> {
  return createImageBitmap(photo, { imageOrientation: 'flipY', colorSpaceConversion: 'none' });
}
