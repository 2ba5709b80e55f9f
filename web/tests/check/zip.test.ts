import { inflateRawSync } from 'node:zlib';
import { expect, test } from 'vitest';
import { crc32, zipOf } from '../../src/check/zip';

const bytesOf = (text: string): Uint8Array<ArrayBuffer> => new TextEncoder().encode(text);

test('the checksum is that of the standard', () => {
  expect(crc32(bytesOf('123456789'))).toBe(0xcbf43926);
  expect(crc32(new Uint8Array(0))).toBe(0);
});

test('what is written is found by its directory, deflated or as it is', async () => {
  const long = 'depth '.repeat(1000);
  const files = new Map([['a.bin', new Blob([long])], ['ü/b.jpg', new Blob(['picture'])]]);
  const zip = new Uint8Array(await (await zipOf(files)).arrayBuffer());
  const view = new DataView(zip.buffer);
  const end = zip.length - 22;
  expect(view.getUint32(end, true)).toBe(0x06054b50);
  expect(view.getUint16(end + 10, true)).toBe(2);
  let at = view.getUint32(end + 16, true);
  expect(at + view.getUint32(end + 12, true)).toBe(end);
  const found: Record<string, string> = {};
  for (let i = 0; i < 2; i += 1) {
    const nameLength = view.getUint16(at + 28, true);
    const name = new TextDecoder().decode(zip.subarray(at + 46, at + 46 + nameLength));
    const local = view.getUint32(at + 42, true);
    expect(view.getUint32(local, true)).toBe(0x04034b50);
    const begin = local + 30 + nameLength;
    const packed = zip.subarray(begin, begin + view.getUint32(at + 20, true));
    const data = view.getUint16(at + 10, true) === 8 ? inflateRawSync(packed) : packed;
    expect(data.length).toBe(view.getUint32(at + 24, true));
    expect(crc32(data)).toBe(view.getUint32(at + 16, true));
    found[name] = new TextDecoder().decode(data);
    at += 46 + nameLength;
  }
  expect(found).toEqual({ 'a.bin': long, 'ü/b.jpg': 'picture' });
  expect(zip.length).toBeLessThan(500);
});
