/** A zip file, so that everybody can look into it: names, sizes and checksums around the files. */

const LOCAL = 0x04034b50;
const CENTRAL = 0x02014b50;
const END = 0x06054b50;
/** The version that is needed to read it: 2.0. */
const VERSION = 20;
/** 1 January 1980, the first day that the format knows. */
const DATE = 0x21;
const DEFLATED = 8;

/** Pictures are packed already, and stay as they are; the rest is deflated. */
export async function zipOf(files: ReadonlyMap<string, Blob>): Promise<Blob> {
  const parts: (Blob | Uint8Array<ArrayBuffer>)[] = [];
  const directory: Uint8Array<ArrayBuffer>[] = [];
  let at = 0;
  for (const [path, file] of files) {
    const data = new Uint8Array(await file.arrayBuffer());
    const name = new TextEncoder().encode(path);
    const isPacked = path.endsWith('.jpg');
    const packed = isPacked ? data : await deflated(data);
    const shared = [
      u16(VERSION, 0, isPacked ? 0 : DEFLATED, 0, DATE), u32(crc32(data), packed.length, data.length),
      u16(name.length, 0),
    ];
    const head = joined(u32(LOCAL), ...shared, name);
    directory.push(joined(u32(CENTRAL), u16(VERSION), ...shared, u16(0, 0, 0), u32(0, at), name));
    parts.push(head, packed);
    at += head.length + packed.length;
  }
  const list = joined(...directory);
  const count = directory.length;
  const end = joined(u32(END), u16(0, 0, count, count), u32(list.length, at), u16(0));
  return new Blob([...parts, list, end], { type: 'application/zip' });
}

async function deflated(data: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  const packed = new Blob([data]).stream().pipeThrough(new CompressionStream('deflate-raw'));
  return new Uint8Array(await new Response(packed).arrayBuffer());
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let bit = 0; bit < 8; bit += 1) value = (value >>> 1) ^ (value & 1 ? 0xedb88320 : 0);
  return value;
});

export function crc32(data: Uint8Array): number {
  let crc = 0xffffffff;
  for (const byte of data) crc = (crc >>> 8) ^ (CRC_TABLE[(crc ^ byte) & 255] ?? 0);
  return ~crc >>> 0;
}

function u16(...values: readonly number[]): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(values.flatMap((value) => [value & 255, value >>> 8]));
}

function u32(...values: readonly number[]): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(values.flatMap((value) => [0, 8, 16, 24].map((by) => (value >>> by) & 255)));
}

function joined(...parts: readonly Uint8Array[]): Uint8Array<ArrayBuffer> {
  const whole = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}
