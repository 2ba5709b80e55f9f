/**
 * What a JPEG says of itself, looked at before it is decoded: the twin of
 * src/peaking/mpi_file/_jpeg.py.
 */

import { MpiFileError } from './mpi_file';

const SOF0 = 0xc0;
const DHT = 0xc4;
const JPG = 0xc8;
const DAC = 0xcc;
const FIRST_RESTART = 0xd0;
const LAST_RESTART = 0xd7;
const EOI = 0xd9;
const SOS = 0xda;

/** Sampling factors of the components. */
const SAMPLINGS = { 'YCbCr 4:2:0': [0x22, 0x11, 0x11], grey: [0x11] } as const;

/**
 * Width and height of a baseline JPEG of a kind, in one scan. Others are refused: every further scan,
 * of a few bytes, can cost a decoder a walk over the whole picture.
 *
 * @throws MpiFileError It is another kind, or is broken off.
 */
export function baselineSize_px(
  jpeg: Uint8Array, kind: keyof typeof SAMPLINGS,
): { readonly width: number; readonly height: number } {
  const at = (i: number): number => jpeg[i] ?? -1;
  const two = (i: number): number => 256 * at(i) + at(i + 1);
  if (at(0) !== 0xff || at(1) !== 0xd8) throw new MpiFileError('need a JPEG as payload');
  const samplings = SAMPLINGS[kind];
  let size: { width: number; height: number } | null = null;
  for (let i = 2; ;) {
    const marker = at(i + 1);
    const next = i + 2 + two(i + 2);
    if (at(i) !== 0xff || next < i + 4 || next > jpeg.length) {
      throw new MpiFileError('unsound JPEG: a segment is broken off');
    }
    if (beginsFrame(marker)) {
      if (marker !== SOF0 || size !== null) throw new MpiFileError('need a baseline JPEG');
      // length, precision, height, width, number of components; then id, sampling, table of each
      if (next !== i + 10 + 3 * samplings.length || at(i + 4) !== 8
        || samplings.some((sampling, c) => at(i + 11 + 3 * c) !== sampling)) {
        throw new MpiFileError(`need a JPEG of 8-bit ${kind}`);
      }
      size = { height: two(i + 5), width: two(i + 7) };
    }
    if (marker === SOS) {
      if (size === null || at(i + 4) !== samplings.length || !endsAfterScan(jpeg, next)) {
        throw new MpiFileError('need a JPEG in one scan, with nothing behind it');
      }
      return size;
    }
    i = next;
  }
}

/** SOF0 … SOF15 without the three markers among them that are something else. */
function beginsFrame(marker: number): boolean {
  return marker >= SOF0 && marker <= 0xcf && marker !== DHT && marker !== JPG && marker !== DAC;
}

/** Whether the first marker in the scan's data, other than a restart, is the end of the file. */
function endsAfterScan(jpeg: Uint8Array, from: number): boolean {
  for (let i = jpeg.indexOf(0xff, from); i >= 0; i = jpeg.indexOf(0xff, i + 1)) {
    const marker = jpeg[i + 1] ?? 0;
    if (marker === 0 || (marker >= FIRST_RESTART && marker <= LAST_RESTART)) continue;
    return marker === EOI && i + 2 === jpeg.length;
  }
  return false;
}
