/** Reads the header and the occupancy of an `.mpi` file; docs/mpi-format.md is the definition. */

import { rigid, type Camera } from '../geometry';
import { integer, list, number, oneOf, parseJson, record, text } from '../schema';

export class MpiFileError extends Error {
  override readonly name = 'MpiFileError';
}

export interface ParsedMpi {
  readonly camera: Camera;
  /** Farthest first. */
  readonly planeDepths_m: Float64Array;
  /** Plane, row and column of every tile, in the order of the file. */
  readonly places: Uint16Array<ArrayBuffer>;
  readonly numTiles: number;
  readonly codec: 'jpeg' | 'lossless';
  /** Row and column of every tile as one number: tiles of one stack lie behind each other. */
  readonly stacks: Int32Array<ArrayBuffer>;
  readonly payload: Uint8Array<ArrayBuffer>;
}

export const CELL_PX = 15;
export const TILE_PX = 16;
const MAX_FILE_BYTES = 256 * 2 ** 20;
const MAX_HEADER_BYTES = 2 ** 20;
/** The same as in src/peaking/limits.py. */
const MAX_PIXELS = 2 ** 24;
const MAX_PLACES = 2 ** 25;
/** How far RᵀR may be from the identity; `RIGID_TOLERANCE` of src/peaking/geometry.py. */
const RIGID_TOLERANCE = 1e-3;
const MAGIC = [0x50, 0x4b, 0x4d, 0x50, 0x49, 0x02, 0x0d, 0x0a];

export function parseMpi(bytes: ArrayBuffer): ParsedMpi {
  const all = new Uint8Array(bytes);
  if (all.length < 16 || MAGIC.some((byte, i) => all[i] !== byte)) {
    throw new MpiFileError('not an .mpi file of version 2');
  }
  if (all.length > MAX_FILE_BYTES) {
    throw new MpiFileError(`need at most ${MAX_FILE_BYTES} bytes, got ${all.length}`);
  }
  const view = new DataView(bytes);
  if (view.getUint32(8, true) > MAX_HEADER_BYTES) {
    throw new MpiFileError(`need a header of at most ${MAX_HEADER_BYTES} bytes`);
  }
  const payloadAt = 16 + view.getUint32(8, true);
  if (payloadAt > all.length) throw new MpiFileError('the header is cut off');
  if (crc32(all.subarray(16)) !== view.getUint32(12, true)) {
    throw new MpiFileError('the checksum is wrong: the file was damaged on its way');
  }
  const header = readHeader(all.subarray(16, payloadAt));
  const planes = header.plane_depths_m.length;
  const rows = Math.ceil((header.height_px + 1) / CELL_PX);
  const cols = Math.ceil((header.width_px + 1) / CELL_PX);
  if (planes * rows * cols > MAX_PLACES) {
    throw new MpiFileError(`need at most ${MAX_PLACES} places of tiles`);
  }
  const occupancyEnd = payloadAt + header.occupancy_bytes;
  if (header.occupancy_bytes !== Math.ceil((planes * rows * cols) / 8)
    || occupancyEnd + header.payload_bytes !== all.length) {
    throw new MpiFileError('the lengths in the header are not those of the file');
  }
  const occupancy = all.subarray(payloadAt, occupancyEnd);
  const places = placesOf(occupancy, planes, rows, cols, header.num_tiles);
  return {
    camera: {
      pinhole: {
        width_px: header.width_px,
        height_px: header.height_px,
        fx_px: header.fx_px,
        fy_px: header.fy_px,
        cx_px: header.cx_px,
        cy_px: header.cy_px,
      },
      worldFromCam: rigid(header.world_from_cam.flat()),
    },
    planeDepths_m: Float64Array.from(header.plane_depths_m),
    places,
    numTiles: header.num_tiles,
    codec: header.codec,
    stacks: Int32Array.from({ length: header.num_tiles }, (_, tile) =>
      (places[3 * tile + 1] ?? 0) * cols + (places[3 * tile + 2] ?? 0)),
    payload: new Uint8Array(bytes, occupancyEnd),
  };
}

interface Header {
  readonly width_px: number;
  readonly height_px: number;
  readonly fx_px: number;
  readonly fy_px: number;
  readonly cx_px: number;
  readonly cy_px: number;
  readonly world_from_cam: readonly (readonly number[])[];
  readonly plane_depths_m: readonly number[];
  readonly generator: string;
  readonly codec: 'jpeg' | 'lossless';
  readonly num_tiles: number;
  readonly occupancy_bytes: number;
  readonly payload_bytes: number;
}

const headerSchema = record<Header>({
  width_px: integer(1, 16384),
  height_px: integer(1, 16384),
  fx_px: number(),
  fy_px: number(),
  cx_px: number(),
  cy_px: number(),
  world_from_cam: list(list(number(), 4, 4), 3, 3),
  plane_depths_m: list(number(), 1, 1024),
  generator: text,
  codec: oneOf('jpeg', 'lossless'),
  num_tiles: integer(0, 65536),
  occupancy_bytes: integer(0, 2 ** 22),
  payload_bytes: integer(0, 2 ** 30),
});

function readHeader(bytes: Uint8Array): Header {
  const header = parsedHeader(bytes);
  const depths = header.plane_depths_m;
  if (header.width_px * header.height_px > MAX_PIXELS) {
    throw new MpiFileError(`need at most ${MAX_PIXELS} pixels`);
  }
  if (depths.some((depth, i) => depth <= 0 || (i > 0 && depth >= Number(depths[i - 1])))) {
    throw new MpiFileError('plane_depths_m must be depths > 0, farthest first');
  }
  if (header.fx_px <= 0 || header.fy_px <= 0) {
    throw new MpiFileError('the intrinsics are not those of a camera');
  }
  if (!isRotation(header.world_from_cam)) {
    throw new MpiFileError('world_from_cam must begin with a rotation');
  }
  return header;
}

function parsedHeader(bytes: Uint8Array): Header {
  try {
    return parseJson(headerSchema, new TextDecoder('utf-8', { fatal: true }).decode(bytes));
  } catch (error) {
    // A TypeError: it is not UTF-8 either.
    throw new MpiFileError(`the header: ${error instanceof Error ? error.message : String(error)}`);
  }
}

/** Whether the first three columns are orthonormal and keep their handedness. */
function isRotation(rows: readonly (readonly number[])[]): boolean {
  const column = (c: number): number[] => rows.map((row) => row[c] ?? NaN);
  const [x, y, z] = [column(0), column(1), column(2)];
  const dot = (a: readonly number[], b: readonly number[]): number =>
    a.reduce((sum, value, i) => sum + value * (b[i] ?? NaN), 0);
  const away = [dot(x, x) - 1, dot(y, y) - 1, dot(z, z) - 1, dot(x, y), dot(y, z), dot(z, x)];
  const [a = NaN, b = NaN, c = NaN] = x;
  const [d = NaN, e = NaN, f = NaN] = y;
  const across = [b * f - c * e, c * d - a * f, a * e - b * d];
  return away.every((value) => Math.abs(value) <= RIGID_TOLERANCE) && dot(across, z) > 0;
}

function placesOf(
  occupancy: Uint8Array, planes: number, rows: number, cols: number, numTiles: number,
): Uint16Array<ArrayBuffer> {
  const places = new Uint16Array(3 * numTiles);
  const numPlaces = planes * rows * cols;
  const spare = 8 * occupancy.length - numPlaces;
  if (((occupancy.at(-1) ?? 0) & ((1 << spare) - 1)) !== 0) {
    throw new MpiFileError('bits are set after the last place');
  }
  let tile = 0;
  for (let place = 0; place < numPlaces; place += 1) {
    const byte = occupancy[place >> 3] ?? 0;
    if (byte === 0) {
      place |= 7; // nothing in these eight
      continue;
    }
    if (((byte >> (7 - (place & 7))) & 1) === 0) continue;
    if (tile === numTiles) throw new MpiFileError('more tiles are marked than there are');
    places[3 * tile] = Math.floor(place / (rows * cols));
    places[3 * tile + 1] = Math.floor(place / cols) % rows;
    places[3 * tile + 2] = place % cols;
    tile += 1;
  }
  if (tile !== numTiles) throw new MpiFileError('fewer tiles are marked than there are');
  return places;
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k += 1) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

function crc32(bytes: Uint8Array): number {
  let crc = 0xffffffff;
  for (const byte of bytes) crc = (CRC_TABLE[(crc ^ byte) & 255] ?? 0) ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
}
