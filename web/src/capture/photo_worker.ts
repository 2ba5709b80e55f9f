/** Worker: pixels to a JPEG and its thumbnail. `photo_encoder.ts` is the other end. */

import { thumbnailSize } from './thumbnail';

export interface EncodeRequest {
  readonly ticket: number;
  /** RGBA8, top row first. */
  readonly rgba: ArrayBuffer;
  readonly width_px: number;
  readonly height_px: number;
  /** Of the JPEG, 0…1. */
  readonly quality: number;
}

export type EncodeAnswer =
  | { readonly ticket: number; readonly jpeg: Blob; readonly thumbnail: Blob }
  | { readonly ticket: number; readonly problem: string };

const THUMBNAIL_QUALITY = 0.8;

async function encode(
  { ticket, rgba, width_px, height_px, quality }: EncodeRequest,
): Promise<EncodeAnswer> {
  const bytes = new Uint8ClampedArray(rgba);
  // A camera's texture may have any alpha, and a canvas would multiply by it.
  for (let i = 3; i < bytes.length; i += 4) bytes[i] = 255;
  const full = canvas(width_px, height_px);
  full.pen.putImageData(new ImageData(bytes, width_px, height_px), 0, 0);
  const size = thumbnailSize(width_px, height_px);
  const small = canvas(size.width_px, size.height_px);
  small.pen.imageSmoothingQuality = 'high';
  small.pen.drawImage(full.sheet, 0, 0, size.width_px, size.height_px);
  const [jpeg, thumbnail] = await Promise.all([
    full.sheet.convertToBlob({ type: 'image/jpeg', quality }),
    small.sheet.convertToBlob({ type: 'image/jpeg', quality: THUMBNAIL_QUALITY }),
  ]);
  return { ticket, jpeg, thumbnail };
}

function canvas(width_px: number, height_px: number): {
  sheet: OffscreenCanvas; pen: OffscreenCanvasRenderingContext2D;
} {
  const sheet = new OffscreenCanvas(width_px, height_px);
  // Without the last option the pixels go to the graphics card and come back.
  const pen = sheet.getContext('2d', { alpha: false, willReadFrequently: true });
  if (pen === null) throw new Error('This browser gives no canvas to a worker.');
  return { sheet, pen };
}

self.onmessage = async ({ data }: MessageEvent<EncodeRequest>) => {
  try {
    self.postMessage(await encode(data));
  } catch (error) {
    const answer: EncodeAnswer = { ticket: data.ticket, problem: String(error) };
    self.postMessage(answer);
  }
};
