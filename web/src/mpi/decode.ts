/** From the bytes of an `.mpi` file to texels; runs in a worker. */

import type { Pinhole } from '../wire';
import { baselineSize_px } from './jpeg';
import { MpiFileError, parseMpi, TILE_PX, type ParsedMpi } from './mpi_file';

/** Tiles beside each other in the texture: 2048 texels, which every WebGL2 device has. */
export const TEXTURE_COLS = 128;

/** Everything of it can be handed to another thread. */
export interface DecodedMpi {
  readonly pinhole: Pinhole;
  /** `[R | t]`, 12 numbers. */
  readonly worldFromCam: Float64Array<ArrayBufferLike>;
  readonly planeDepths_m: Float64Array<ArrayBufferLike>;
  /** Plane, row and column of every tile. */
  readonly places: Uint16Array<ArrayBuffer>;
  readonly numTiles: number;
  /**
   * Premultiplied RGBA8, `TEXTURE_COLS` tiles beside each other, `textureRows` below: tile i begins at
   * texel (16·(i mod TEXTURE_COLS), 16·floor(i / TEXTURE_COLS)).
   */
  readonly texels: Uint8Array<ArrayBuffer>;
  readonly textureRows: number;
}

export async function decodeMpi(bytes: ArrayBuffer): Promise<DecodedMpi> {
  const mpi = parseMpi(bytes);
  const textureRows = Math.max(Math.ceil(mpi.numTiles / TEXTURE_COLS), 1);
  const texels = new Uint8Array(TEXTURE_COLS * TILE_PX * textureRows * TILE_PX * 4);
  if (mpi.numTiles === 0) {
    if (mpi.payload.length > 0) throw new MpiFileError('need no texels for no tiles');
  } else {
    await (mpi.codec === 'jpeg' ? fromJpeg(mpi, texels) : fromLossless(mpi, texels));
  }
  return {
    pinhole: mpi.camera.pinhole,
    worldFromCam: mpi.camera.worldFromCam.rows,
    planeDepths_m: mpi.planeDepths_m,
    places: mpi.places,
    numTiles: mpi.numTiles,
    texels,
    textureRows,
  };
}

async function fromJpeg(mpi: ParsedMpi, texels: Uint8Array): Promise<void> {
  const { atlasCols, numTiles } = mpi;
  const width = TILE_PX * atlasCols;
  const half = TILE_PX * Math.ceil(numTiles / atlasCols);
  const size = baselineSize_px(mpi.payload);
  if (size.width !== width || size.height !== 2 * half) {
    throw new MpiFileError('the picture of the tiles has not the size that the header says');
  }
  let picture: ImageBitmap;
  try {
    picture = await createImageBitmap(new Blob([mpi.payload], { type: 'image/jpeg' }), {
      premultiplyAlpha: 'none', colorSpaceConversion: 'none',
    });
  } catch {
    throw new MpiFileError('the picture of the tiles cannot be decoded');
  }
  const context = new OffscreenCanvas(width, 2 * half).getContext('2d', {
    willReadFrequently: true, alpha: false,
  });
  if (context === null) throw new MpiFileError('this browser has no 2D canvas in workers');
  context.drawImage(picture, 0, 0);
  picture.close();
  const pixels = context.getImageData(0, 0, width, 2 * half).data;
  for (let tile = 0; tile < numTiles; tile += 1) {
    const left = TILE_PX * (tile % atlasCols);
    const top = TILE_PX * Math.floor(tile / atlasCols);
    combine(pixels, 4 * width, 4 * (top * width + left), 4 * (half * width), texels, tile);
  }
}

/** Opacity of a luma of 0…255: the ends are 16 apart from what lies between. */
const ALPHA_OF_LUMA = Uint8Array.from({ length: 256 }, (_, luma) =>
  Math.min(Math.max(Math.round(((luma - 16) * 255) / 96), 0), 255));

/** Join colour and alpha of one tile, and premultiply. */
export function combine(
  pixels: Uint8ClampedArray, stride: number, from: number, alphaAt: number,
  texels: Uint8Array, tile: number,
): void {
  let to = texelOf(tile);
  for (let y = 0; y < TILE_PX; y += 1) {
    let at = from + y * stride;
    for (let x = 0; x < TILE_PX; x += 1) {
      const s = at + alphaAt;
      const luma = (pixels[s] ?? 0) * 0.299 + (pixels[s + 1] ?? 0) * 0.587
        + (pixels[s + 2] ?? 0) * 0.114;
      const alpha = ALPHA_OF_LUMA[Math.round(luma)] ?? 0;
      texels[to] = ((pixels[at] ?? 0) * alpha + 127) / 255;
      texels[to + 1] = ((pixels[at + 1] ?? 0) * alpha + 127) / 255;
      texels[to + 2] = ((pixels[at + 2] ?? 0) * alpha + 127) / 255;
      texels[to + 3] = alpha;
      at += 4;
      to += 4;
    }
    to += 4 * TILE_PX * (TEXTURE_COLS - 1);
  }
}

async function fromLossless(mpi: ParsedMpi, texels: Uint8Array): Promise<void> {
  const expected = mpi.numTiles * 4 * TILE_PX * TILE_PX;
  const stream = new Blob([mpi.payload]).stream().pipeThrough(new DecompressionStream('deflate'));
  const planar = new Uint8Array(expected);
  let size = 0;
  const reader = stream.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      if (size + value.length > expected) {
        void reader.cancel().catch(() => undefined);
        throw new MpiFileError('more texels than tiles');
      }
      planar.set(value, size);
      size += value.length;
    }
  } catch (error) {
    if (error instanceof MpiFileError) throw error;
    throw new MpiFileError('the texels cannot be unpacked');
  }
  if (size !== expected) throw new MpiFileError('fewer texels than tiles');
  let at = 0;
  for (let tile = 0; tile < mpi.numTiles; tile += 1) {
    for (let channel = 0; channel < 4; channel += 1) {
      for (let y = 0; y < TILE_PX; y += 1) {
        let value = 0;
        let to = texelOf(tile) + 4 * TILE_PX * TEXTURE_COLS * y + channel;
        for (let x = 0; x < TILE_PX; x += 1) {
          value = (value + (planar[at] ?? 0)) & 255;
          texels[to] = value;
          at += 1;
          to += 4;
        }
      }
    }
  }
}

/** Index of the first byte of a tile in the texture. */
function texelOf(tile: number): number {
  const x = TILE_PX * (tile % TEXTURE_COLS);
  const y = TILE_PX * Math.floor(tile / TEXTURE_COLS);
  return 4 * (y * TEXTURE_COLS * TILE_PX + x);
}
