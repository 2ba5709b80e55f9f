/** From the bytes of an `.mpi` file to texels; runs in a worker. */

import type { Pinhole } from '../wire';
import { baselineSize_px } from './jpeg';
import { MpiFileError, parseMpi, TILE_PX, type ParsedMpi } from './mpi_file';

/** Tiles beside each other in the texture: 2048 texels, which every WebGL2 device has. */
export const TEXTURE_COLS = 128;
/** At most so many tiles are beside each other in a picture of a file. */
const MAX_COLS = 256;

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
    await (mpi.codec === 'jpeg' ? fromPictures(mpi, texels) : fromLossless(mpi, texels));
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

/** Pixels of tiles, `cols` beside each other, four bytes each. */
interface TilePicture {
  readonly pixels: Uint8ClampedArray;
  readonly cols: number;
}

async function fromPictures(mpi: ParsedMpi, texels: Uint8Array): Promise<void> {
  const { payload, numTiles } = mpi;
  const lengthAt = Math.ceil(numTiles / 8);
  const colorsAt = lengthAt + 4;
  if (colorsAt > payload.length) throw new MpiFileError('the texels are broken off');
  const length = new DataView(payload.buffer, payload.byteOffset + lengthAt, 4);
  const alphasAt = colorsAt + length.getUint32(0, true);
  if (alphasAt >= payload.length) throw new MpiFileError('broken off before the picture of alpha');
  const { colorOf, numColors } = colorsOf(payload.subarray(0, lengthAt), mpi.stacks);
  const colorJpeg = payload.subarray(colorsAt, alphasAt);
  const alphaJpeg = payload.subarray(alphasAt);
  checkSize(baselineSize_px(colorJpeg, 'YCbCr 4:2:0'), numColors);
  checkSize(baselineSize_px(alphaJpeg, 'grey'), numTiles);
  const [colors, alphas] = await Promise.all([pictureOf(colorJpeg), pictureOf(alphaJpeg)]);
  for (let tile = 0; tile < numTiles; tile += 1) {
    combine(colors, colorOf[tile] ?? 0, alphas, texels, tile);
  }
}

/**
 * Which tile of the picture of colours goes with every tile: a new one where its bit is set, else
 * that of the tile behind it.
 */
function colorsOf(
  isNew: Uint8Array, stacks: Int32Array,
): { readonly colorOf: Int32Array; readonly numColors: number } {
  const latest = new Map<number, number>();
  const colorOf = new Int32Array(stacks.length);
  let numColors = 0;
  for (const [tile, stack] of stacks.entries()) {
    if ((((isNew[tile >> 3] ?? 0) >> (7 - (tile & 7))) & 1) === 1) {
      latest.set(stack, numColors);
      numColors += 1;
    }
    const color = latest.get(stack);
    if (color === undefined) throw new MpiFileError('a tile has the colours of one that is not there');
    colorOf[tile] = color;
  }
  const spare = 8 * isNew.length - stacks.length;
  if (((isNew.at(-1) ?? 0) & ((1 << spare) - 1)) !== 0) {
    throw new MpiFileError('more tiles have colours than there are');
  }
  return { colorOf, numColors };
}

function checkSize(
  { width, height }: { readonly width: number; readonly height: number }, numTiles: number,
): void {
  const cols = width / TILE_PX;
  if (!Number.isInteger(cols) || cols < 1 || cols > MAX_COLS
    || height !== TILE_PX * Math.ceil(numTiles / cols)) {
    throw new MpiFileError(`${width}x${height} pixels are not a picture of ${numTiles} tiles`);
  }
}

async function pictureOf(jpeg: Uint8Array<ArrayBuffer>): Promise<TilePicture> {
  let bitmap: ImageBitmap;
  try {
    bitmap = await createImageBitmap(new Blob([jpeg], { type: 'image/jpeg' }), {
      premultiplyAlpha: 'none', colorSpaceConversion: 'none',
    });
  } catch {
    throw new MpiFileError('a picture of the tiles cannot be decoded');
  }
  const { width, height } = bitmap;
  const context = new OffscreenCanvas(width, height).getContext('2d', {
    willReadFrequently: true, alpha: false,
  });
  if (context === null) throw new MpiFileError('this browser has no 2D canvas in workers');
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
  return { pixels: context.getImageData(0, 0, width, height).data, cols: width / TILE_PX };
}

/** Opacity of a stored value of 0…255: the ends are 16 apart from what lies between. */
const ALPHA_OF_STORED = Uint8Array.from({ length: 256 }, (_, stored) =>
  Math.min(Math.max(Math.round(((stored - 16) * 255) / 96), 0), 255));

/** Join colour and alpha of one tile, and premultiply. */
export function combine(
  colors: TilePicture, color: number, alphas: TilePicture, texels: Uint8Array, tile: number,
): void {
  const { pixels } = colors;
  for (let y = 0; y < TILE_PX; y += 1) {
    let from = pixelOf(colors.cols, color) + 4 * TILE_PX * colors.cols * y;
    let stored = pixelOf(alphas.cols, tile) + 4 * TILE_PX * alphas.cols * y;
    let to = pixelOf(TEXTURE_COLS, tile) + 4 * TILE_PX * TEXTURE_COLS * y;
    for (let x = 0; x < TILE_PX; x += 1) {
      const alpha = ALPHA_OF_STORED[alphas.pixels[stored] ?? 0] ?? 0;
      texels[to] = ((pixels[from] ?? 0) * alpha + 127) / 255;
      texels[to + 1] = ((pixels[from + 1] ?? 0) * alpha + 127) / 255;
      texels[to + 2] = ((pixels[from + 2] ?? 0) * alpha + 127) / 255;
      texels[to + 3] = alpha;
      from += 4;
      stored += 4;
      to += 4;
    }
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
        let to = pixelOf(TEXTURE_COLS, tile) + 4 * TILE_PX * TEXTURE_COLS * y + channel;
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

/** Index of the first byte of a tile in a picture of `cols` tiles beside each other. */
function pixelOf(cols: number, tile: number): number {
  return 4 * TILE_PX * (TILE_PX * cols * Math.floor(tile / cols) + (tile % cols));
}
