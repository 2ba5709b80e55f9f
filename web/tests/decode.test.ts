import { crc32, deflateSync } from 'node:zlib';
import { expect, test } from 'vitest';
import { combine, decodeMpi, TEXTURE_COLS } from '../src/mpi/decode';
import { TILE_PX } from '../src/mpi/mpi_file';

/** One plane of `cols` cells beside each other, all of them tiles; tile i is all (i, 1, 2, 255). */
function fileOfTiles(cols: number): ArrayBuffer {
  const occupancy = new Uint8Array(Math.ceil(cols / 8));
  for (let i = 0; i < cols; i += 1) occupancy[i >> 3] = (occupancy[i >> 3] ?? 0) | (1 << (7 - (i & 7)));
  const planar = new Uint8Array(cols * 4 * TILE_PX * TILE_PX);
  for (let tile = 0; tile < cols; tile += 1) {
    [tile & 255, 1, 2, 255].forEach((value, channel) => {
      for (let y = 0; y < TILE_PX; y += 1) {
        // The first texel of a row, then differences: nothing changes.
        planar[((tile * 4 + channel) * TILE_PX + y) * TILE_PX] = value;
      }
    });
  }
  const payload = deflateSync(planar);
  const header = Buffer.from(JSON.stringify({
    width_px: 15 * cols - 1, height_px: 14, fx_px: 1, fy_px: 1, cx_px: 1, cy_px: 1,
    world_from_cam: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], plane_depths_m: [2],
    generator: 'by hand', codec: 'lossless', num_tiles: cols,
    occupancy_bytes: occupancy.length, payload_bytes: payload.length,
  }));
  const body = Buffer.concat([header, occupancy, payload]);
  const fixed = Buffer.from('PKMPI\x02\r\n--------', 'latin1');
  fixed.writeUInt32LE(header.length, 8);
  fixed.writeUInt32LE(crc32(body), 12);
  return Uint8Array.from(Buffer.concat([fixed, body])).buffer;
}

test('tiles lie beside each other, and go on in the next row of the texture', async () => {
  const mpi = await decodeMpi(fileOfTiles(130));
  expect([mpi.numTiles, mpi.textureRows, TEXTURE_COLS]).toEqual([130, 2, 128]);
  const texel = (x: number, y: number): number[] => {
    const at = 4 * (y * TEXTURE_COLS * TILE_PX + x);
    return Array.from(mpi.texels.subarray(at, at + 4));
  };
  expect(texel(0, 0)).toEqual([0, 1, 2, 255]);
  expect(texel(15, 15)).toEqual([0, 1, 2, 255]);
  expect(texel(16, 0)).toEqual([1, 1, 2, 255]);
  expect(texel(16 * 127 + 15, 15)).toEqual([127, 1, 2, 255]);
  expect(texel(0, 16)).toEqual([128, 1, 2, 255]);
  expect(texel(31, 31)).toEqual([129, 1, 2, 255]);
  expect(texel(32, 16)).toEqual([0, 0, 0, 0]); // no tile
  expect(Array.from(mpi.places.subarray(3 * 129))).toEqual([0, 0, 129]);
});

test.each([
  // What is stored of alpha, and what it makes of (200, 100, 7).
  [0, [0, 0, 0, 0]],
  [16, [0, 0, 0, 0]],
  [64, [100, 50, 4, 128]], // (64 - 16) · 255 / 96 = 127.5; 7 · 128 / 255 = 3.51
  [112, [200, 100, 7, 255]],
  [128, [200, 100, 7, 255]],
  [255, [200, 100, 7, 255]],
])('a tile of colour and one of alpha: %i', (stored, expected) => {
  // Two tiles beside each other, two below: the colours are the last of four, alpha is the fourth
  // of six in a row.
  const colors = picture(2, 2, (tile) => (tile === 3 ? [200, 100, 7] : [1, 2, 3]));
  const alphas = picture(6, 1, (tile) => (tile === 3 ? [stored, 9, 9] : [128, 128, 128]));
  const texels = new Uint8Array(4 * TEXTURE_COLS * TILE_PX * TILE_PX);
  combine(colors, 3, alphas, texels, 3);
  const last = 4 * (15 * TEXTURE_COLS * TILE_PX + 3 * TILE_PX + 15);
  expect(Array.from(texels.subarray(4 * 3 * TILE_PX, 4 * 3 * TILE_PX + 4))).toEqual(expected);
  expect(Array.from(texels.subarray(last, last + 4))).toEqual(expected);
  expect(Array.from(texels.subarray(last + 4, last + 8))).toEqual([0, 0, 0, 0]);
  expect(Array.from(texels.subarray(4 * 2 * TILE_PX, 4 * 2 * TILE_PX + 4))).toEqual([0, 0, 0, 0]);
});

function picture(
  cols: number, rows: number, colorOf: (tile: number) => readonly number[],
): { readonly pixels: Uint8ClampedArray; readonly cols: number } {
  const width = TILE_PX * cols;
  const pixels = new Uint8ClampedArray(4 * width * TILE_PX * rows);
  for (let i = 0; i < pixels.length / 4; i += 1) {
    const tile = cols * Math.floor(i / width / TILE_PX) + Math.floor((i % width) / TILE_PX);
    pixels.set([...colorOf(tile), 255], 4 * i);
  }
  return { pixels, cols };
}
