import { expect, test } from 'vitest';

import { uploadBody } from '../../src/capture/upload_body';
import { wireOfCamera } from '../../src/geometry';
import { PROTOCOL } from '../../src/wire';
import { parseUpload } from './model_server';
import { photo } from './support';

test('an upload says what it carries, and carries it byte for byte', async () => {
  const { camera, ...rest } = photo(7, 'JPEG');
  const body = uploadBody({ ...rest, camera: wireOfCamera(camera), sent_s: 9 });
  const { header, jpeg, depth } = await parseUpload(body);
  expect(header).toEqual({
    protocol: PROTOCOL,
    camera: {
      pinhole: { width_px: 4, height_px: 2, fx_px: 3, fy_px: 3, cx_px: 2, cy_px: 1 },
      world_from_cam: [1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 7],
    },
    time_s: 7,
    sent_s: 9,
    photo_bytes: 4,
    depth: { width_px: 2, height_px: 1 },
  });
  expect(new TextDecoder().decode(jpeg)).toBe('JPEG');
  expect([...depth]).toEqual([2, 1, 255, 255]);
});

test('it is said of what the automatic shutter took, and of nothing else', async () => {
  const { camera, ...rest } = photo(7);
  for (const automatic of [true, false]) {
    const body = uploadBody({ ...rest, camera: wireOfCamera(camera), sent_s: 9, automatic });
    expect((await parseUpload(body)).header.automatic).toBe(automatic ? true : undefined);
  }
});

test('without depth nothing follows the photo', async () => {
  const { camera, ...rest } = photo(7, 'JPEG');
  const body = uploadBody({ ...rest, camera: wireOfCamera(camera), sent_s: 9, depth: null });
  const { header, depth } = await parseUpload(body);
  expect(header.depth).toBeNull();
  expect(depth).toHaveLength(0);
});

test('a depth map of the wrong size is refused', () => {
  const { camera, ...rest } = photo(7);
  const depth = { width_px: 2, height_px: 2, depth_mm: new Uint16Array(3) };
  expect(() => uploadBody({ ...rest, camera: wireOfCamera(camera), sent_s: 9, depth })).toThrow(RangeError);
});
