import { createHash } from 'node:crypto';
import { crc32 } from 'node:zlib';
import { describe, expect, test } from 'vitest';
import { cameraOfWire } from '../src/geometry';
import { decodeMpi, TEXTURE_COLS, type DecodedMpi } from '../src/mpi/decode';
import { MpiFileError, parseMpi, TILE_PX } from '../src/mpi/mpi_file';
import type { Camera as WireCamera } from '../src/wire';
import { fileFixture, jsonFixture } from './fixtures';

interface Content {
  readonly camera: WireCamera;
  readonly plane_depths_m: readonly number[];
  readonly num_tiles: number;
  readonly places: readonly number[];
  readonly texels_sha256: string;
}

const CONTENT = jsonFixture<Content>('mpi_file.json');
const FILES = ['desk.jpeg.mpi', 'desk.lossless.mpi'] as const;

/** The texels tile by tile, as Python holds them. */
function tilesOf(mpi: DecodedMpi): Uint8Array {
  const stride = 4 * TILE_PX * TEXTURE_COLS;
  const tiles = new Uint8Array(mpi.numTiles * 4 * TILE_PX * TILE_PX);
  for (let row = 0; row < mpi.numTiles * TILE_PX; row += 1) {
    const tile = Math.floor(row / TILE_PX);
    const y = TILE_PX * Math.floor(tile / TEXTURE_COLS) + (row % TILE_PX);
    const from = y * stride + 4 * TILE_PX * (tile % TEXTURE_COLS);
    tiles.set(mpi.texels.subarray(from, from + 4 * TILE_PX), 4 * TILE_PX * row);
  }
  return tiles;
}

describe.each(FILES)('%s', (name) => {
  test('holds what Python wrote', () => {
    const mpi = parseMpi(fileFixture(name));
    expect(mpi.camera).toEqual(cameraOfWire(CONTENT.camera));
    expect(Array.from(mpi.planeDepths_m)).toEqual(CONTENT.plane_depths_m);
    expect(mpi.numTiles).toBe(CONTENT.num_tiles);
    expect(Array.from(mpi.places)).toEqual(CONTENT.places);
  });

  test('every flipped bit is noticed', () => {
    const bytes = fileFixture(name);
    for (let i = 0; i < bytes.byteLength; i += 997) {
      const damaged = new Uint8Array(bytes.slice(0));
      damaged[i] = (damaged[i] ?? 0) ^ 0x10;
      expect(() => parseMpi(damaged.buffer), `byte ${i}`).toThrow(MpiFileError);
    }
  });

  test('every file that is broken off is noticed', () => {
    const bytes = fileFixture(name);
    for (const length of [0, 7, 15, 16, 400, bytes.byteLength - 1]) {
      expect(() => parseMpi(bytes.slice(0, length)), `${length} bytes`).toThrow(MpiFileError);
    }
  });
});

test('lossless texels are those of Python, every one', async () => {
  const mpi = await decodeMpi(fileFixture('desk.lossless.mpi'));
  const digest = createHash('sha256').update(tilesOf(mpi)).digest('hex');
  expect(digest).toBe(CONTENT.texels_sha256);
});

type Header = Record<string, unknown>;

/** The lossless file with another header, and a checksum that is right. */
function withHeader(change: (header: Header) => void, payload?: Uint8Array): ArrayBuffer {
  const bytes = new Uint8Array(fileFixture('desk.lossless.mpi'));
  const end = 16 + new DataView(bytes.buffer).getUint32(8, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(16, end))) as Header;
  const kept = bytes.subarray(end, end + Number(header['occupancy_bytes']));
  const texels = payload ?? bytes.subarray(end + kept.length);
  header['payload_bytes'] = texels.length;
  change(header);
  return fileOf(new TextEncoder().encode(JSON.stringify(header)), kept, texels);
}

function fileOf(...parts: readonly Uint8Array[]): ArrayBuffer {
  const body = Buffer.concat(parts);
  const fixed = Buffer.from('PKMPI\x02\r\n--------', 'latin1');
  fixed.writeUInt32LE(parts[0]?.length ?? 0, 8);
  fixed.writeUInt32LE(crc32(body), 12);
  return Uint8Array.from(Buffer.concat([fixed, body])).buffer;
}

test('an unchanged header is read again', () => {
  const mpi = parseMpi(withHeader((header) => { header['a_field_of_later'] = [1]; }));
  expect(mpi.numTiles).toBe(CONTENT.num_tiles);
});

const REFUSED: readonly [string, (header: Header) => void][] = [
  ['no planes', (h) => { h['plane_depths_m'] = []; }],
  ['planes the other way', (h) => { h['plane_depths_m'] = [...CONTENT.plane_depths_m].reverse(); }],
  ['a plane twice', (h) => { h['plane_depths_m'] = CONTENT.plane_depths_m.map(() => 1); }],
  ['a plane behind the camera', (h) => {
    h['plane_depths_m'] = [...CONTENT.plane_depths_m.slice(0, -1), -1];
  }],
  ['a width of nothing', (h) => { h['width_px'] = 0; }],
  ['a width that is not whole', (h) => { h['width_px'] = 60.5; }],
  ['a huge picture', (h) => { h['height_px'] = 20000; }],
  ['more tiles than bits', (h) => { h['num_tiles'] = CONTENT.num_tiles + 1; }],
  ['fewer tiles than bits', (h) => { h['num_tiles'] = CONTENT.num_tiles - 1; }],
  ['no focal length', (h) => { h['fx_px'] = 0; }],
  ['a centre that is text', (h) => { h['cx_px'] = '30'; }],
  ['a pose of 11 numbers', (h) => {
    h['world_from_cam'] = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1]];
  }],
  ['a codec of later', (h) => { h['codec'] = 'avif'; }],
  ['no codec', (h) => { delete h['codec']; }],
  ['another length of the occupancy', (h) => { h['occupancy_bytes'] = 1; }],
  ['another length of the payload', (h) => { h['payload_bytes'] = 1; }],
  ['a number that is not finite', (h) => { h['cy_px'] = 1e999; }],
];

test.each(REFUSED)('refused: %s', (_, change) => {
  expect(() => parseMpi(withHeader(change))).toThrow(MpiFileError);
});

test.each(['[]', '7', '"text"', '{', ''])('refused: %s as the header', (text) => {
  expect(() => parseMpi(fileOf(new TextEncoder().encode(text)))).toThrow(MpiFileError);
});

describe('texels of another length', () => {
  test.each([[0], [1], [100_000_000]])('%i bytes', async (length) => {
    const { deflateSync } = await import('node:zlib');
    const packed = Uint8Array.from(deflateSync(Buffer.alloc(length), { level: 9 }));
    const file = withHeader(() => undefined, packed);
    await expect(decodeMpi(file)).rejects.toThrow(MpiFileError);
  });

  test('what is not deflated at all', async () => {
    const file = withHeader(() => undefined, Uint8Array.of(1, 2, 3));
    await expect(decodeMpi(file)).rejects.toThrow(MpiFileError);
  });
});

test('an MPI without tiles is an MPI', async () => {
  const bytes = new Uint8Array(fileFixture('desk.lossless.mpi'));
  const end = 16 + new DataView(bytes.buffer).getUint32(8, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(16, end))) as Header;
  const occupancy = new Uint8Array(Number(header['occupancy_bytes']));
  Object.assign(header, { num_tiles: 0, payload_bytes: 0 });
  const file = fileOf(new TextEncoder().encode(JSON.stringify(header)), occupancy);
  expect((await decodeMpi(file)).numTiles).toBe(0);
});
