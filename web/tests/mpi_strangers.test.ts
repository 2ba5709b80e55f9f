/** Files whose checksum is right, and that still must not be believed. */

import { crc32 } from 'node:zlib';
import { describe, expect, test } from 'vitest';
import { decodeMpi } from '../src/mpi/decode';
import { MpiFileError, parseMpi } from '../src/mpi/mpi_file';
import { fileFixture } from './fixtures';

type Header = Record<string, unknown>;

interface Parts {
  header: Header;
  occupancy: Uint8Array;
  payload: Uint8Array;
}

function partsOf(name: string): Parts {
  const bytes = new Uint8Array(fileFixture(name));
  const end = 16 + new DataView(bytes.buffer).getUint32(8, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(16, end))) as Header;
  const payloadAt = end + Number(header['occupancy_bytes']);
  return { header, occupancy: bytes.slice(end, payloadAt), payload: bytes.slice(payloadAt) };
}

function fileOf({ header, occupancy, payload }: Parts, json?: string): ArrayBuffer {
  header['occupancy_bytes'] = occupancy.length;
  header['payload_bytes'] = payload.length;
  const text = new TextEncoder().encode(json ?? JSON.stringify(header));
  const body = Buffer.concat([text, occupancy, payload]);
  const fixed = Buffer.from('PKMPI\x02\r\n--------', 'latin1');
  fixed.writeUInt32LE(text.length, 8);
  fixed.writeUInt32LE(crc32(body), 12);
  return Uint8Array.from(Buffer.concat([fixed, body])).buffer;
}

function changed(change: (parts: Parts) => void): ArrayBuffer {
  const parts = partsOf('desk.lossless.mpi');
  change(parts);
  return fileOf(parts);
}

const HEADERS: readonly [string, (parts: Parts) => void][] = [
  ['a bit after the last place', (parts) => {
    // 7 planes of 9 x 5 places are 315 bits, 5 fewer than 40 bytes have.
    const depths = parts.header['plane_depths_m'] as number[];
    parts.header['plane_depths_m'] = depths.slice(0, 7);
    parts.occupancy = parts.occupancy.slice(0, 40);
    parts.occupancy[39] = ((parts.occupancy[39] ?? 0) & 0xe0) | 1;
    const bits = Array.from(parts.occupancy, (byte) => byte.toString(2)).join('');
    parts.header['num_tiles'] = bits.replaceAll('0', '').length - 1;
  }],
  ['a rotation that is none', (parts) => {
    parts.header['world_from_cam'] = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]];
  }],
  ['a mirroring', (parts) => {
    parts.header['world_from_cam'] = [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]];
  }],
  ['twelve numbers in other rows', (parts) => {
    parts.header['world_from_cam'] = [[1, 0, 0, 0, 0, 1], [0, 0, 0, 0, 1, 0], []];
  }],
  ['no generator', (parts) => { delete parts.header['generator']; }],
];

test.each(HEADERS)('refused: %s', (_, change) => {
  expect(() => parseMpi(changed(change))).toThrow(MpiFileError);
});

test.each([
  [16384, 16384, 1, /pixels/],
  [16384, 1025, 1, /pixels/],
  [4096, 4096, 1024, /places/],
])('refused: %d x %d pixels in %d planes', (width, height, planes, says) => {
  const file = changed((parts) => {
    const places = planes * Math.ceil((width + 1) / 15) * Math.ceil((height + 1) / 15);
    parts.occupancy = new Uint8Array(Math.min(Math.ceil(places / 8), 2 ** 22));
    parts.payload = new Uint8Array(0);
    const depths = Array.from({ length: planes }, (__, i) => planes - i);
    Object.assign(parts.header, {
      width_px: width, height_px: height, plane_depths_m: depths, num_tiles: 0,
    });
  });
  expect(() => parseMpi(file)).toThrow(says);
});

test('refused: null as the header', () => {
  expect(() => parseMpi(fileOf(partsOf('desk.lossless.mpi'), 'null'))).toThrow(MpiFileError);
});

test('refused: a header of more than a megabyte', () => {
  const file = changed((parts) => { parts.header['generator'] = 'x'.repeat(2 ** 20); });
  expect(() => parseMpi(file)).toThrow(/header/);
});

test('refused: texels for no tiles', async () => {
  const file = changed((parts) => {
    parts.occupancy.fill(0);
    parts.header['num_tiles'] = 0;
  });
  await expect(decodeMpi(file)).rejects.toThrow(MpiFileError);
});

/** Where the first segment with this marker begins. */
function segment(jpeg: Uint8Array, marker: number): number {
  for (let i = 2; i < jpeg.length;) {
    if (jpeg[i + 1] === marker) return i;
    i += 2 + 256 * (jpeg[i + 2] ?? 0) + (jpeg[i + 3] ?? 0);
  }
  throw new Error(`no segment ${marker.toString(16)}`);
}

const SOF = 0xc0;
const SOS = 0xda;

const PICTURES: readonly [string, (jpeg: Uint8Array) => Uint8Array, RegExp][] = [
  ['a progressive one', (jpeg) => {
    jpeg[segment(jpeg, SOF) + 1] = 0xc2;
    return jpeg;
  }, /baseline/],
  ['an arithmetic one', (jpeg) => {
    jpeg[segment(jpeg, SOF) + 1] = 0xc9;
    return jpeg;
  }, /baseline/],
  ['12 bits', (jpeg) => { jpeg[segment(jpeg, SOF) + 4] = 12; return jpeg; }, /4:2:0/],
  ['4:4:4', (jpeg) => { jpeg[segment(jpeg, SOF) + 11] = 0x11; return jpeg; }, /4:2:0/],
  ['another size', (jpeg) => { jpeg[segment(jpeg, SOF) + 5] = 2; return jpeg; }, /size|pixels/],
  ['a first scan of one component', (jpeg) => {
    jpeg[segment(jpeg, SOS) + 4] = 1;
    return jpeg;
  }, /one scan/],
  ['a second scan', (jpeg) => {
    const scan = jpeg.subarray(segment(jpeg, SOS), jpeg.length - 2);
    return Buffer.concat([jpeg.subarray(0, jpeg.length - 2), scan, Uint8Array.of(0xff, 0xd9)]);
  }, /one scan/],
  ['something behind it', (jpeg) => Buffer.concat([jpeg, Uint8Array.of(0)]), /one scan/],
  ['nothing but a beginning', (jpeg) => jpeg.subarray(0, 30), /JPEG/],
  ['no end', (jpeg) => jpeg.subarray(0, jpeg.length - 2), /one scan/],
  ['a PNG', () => Uint8Array.of(0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a), /JPEG/],
];

/** What the payload of the JPEG codec is made of. */
interface Pictures {
  isNew: Uint8Array;
  colors: Uint8Array;
  alphas: Uint8Array;
}

function picturesOf({ header, payload }: Parts): Pictures {
  const lengthAt = Math.ceil(Number(header['num_tiles']) / 8);
  const colorsAt = lengthAt + 4;
  const alphasAt = colorsAt + new DataView(payload.buffer).getUint32(lengthAt, true);
  return {
    isNew: payload.slice(0, lengthAt),
    colors: payload.slice(colorsAt, alphasAt),
    alphas: payload.slice(alphasAt),
  };
}

function withPictures(change: (pictures: Pictures) => void): ArrayBuffer {
  const parts = partsOf('desk.jpeg.mpi');
  const pictures = picturesOf(parts);
  change(pictures);
  const length = Buffer.alloc(4);
  length.writeUInt32LE(pictures.colors.length);
  const joined = Buffer.concat([pictures.isNew, length, pictures.colors, pictures.alphas]);
  parts.payload = Uint8Array.from(joined);
  return fileOf(parts);
}

describe('refused as the picture of colours, before it is decoded', () => {
  test.each(PICTURES)('%s', async (_, change, reason) => {
    const file = withPictures((pictures) => { pictures.colors = change(pictures.colors); });
    await expect(decodeMpi(file)).rejects.toThrow(reason);
    await expect(decodeMpi(file)).rejects.toThrow(MpiFileError);
  });
});

const OTHERS: readonly [string, (pictures: Pictures) => void, RegExp][] = [
  ['colours as alpha', (p) => { p.alphas = p.colors; }, /grey/],
  ['alpha as colours', (p) => { p.colors = p.alphas; }, /4:2:0/],
  ['alpha of other tiles', (p) => { p.alphas[segment(p.alphas, SOF) + 6] = 16; }, /picture of/],
  ['no alpha', (p) => { p.alphas = new Uint8Array(); }, /alpha/],
  ['a tile without colours', (p) => { p.isNew.fill(0); }, /colours of one that is not there/],
  ['a tile more with colours', (p) => { p.isNew.fill(0xff); }, /more tiles|picture of/],
];

test.each(OTHERS)('refused: %s', async (_, change, reason) => {
  await expect(decodeMpi(withPictures(change))).rejects.toThrow(reason);
});

test.each([0, 3, 40])('refused: a payload of %i bytes', async (length) => {
  const parts = partsOf('desk.jpeg.mpi');
  parts.payload = parts.payload.slice(0, length);
  await expect(decodeMpi(fileOf(parts))).rejects.toThrow(MpiFileError);
});
