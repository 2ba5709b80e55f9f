/** The bytes of an upload: docs/protocol.md, `CaptureHeader` in wire.ts. */

import type { DepthMap } from '../sources/frame_source';
import { PROTOCOL, type Camera, type CaptureHeader } from '../wire';

export interface UploadParts {
  /** Of the photo, at its full size. */
  readonly camera: Camera;
  /** Where the picture shows that it was taken, as on the wire. */
  readonly correctedPose?: readonly number[] | null;
  /** Seconds since 1970. */
  readonly time_s: number;
  /** Now, by the same clock. */
  readonly sent_s: number;
  readonly automatic?: boolean;
  readonly jpeg: Blob;
  readonly depth: DepthMap | null;
}

/**
 * `u32 little-endian length of the header | header as JSON | photo as JPEG | depth`.
 *
 * @throws RangeError The depth map has not as many values as it says.
 */
export function uploadBody(
  { camera, correctedPose, time_s, sent_s, automatic, jpeg, depth }: UploadParts,
): Blob {
  const header: CaptureHeader = {
    protocol: PROTOCOL,
    camera,
    time_s,
    sent_s,
    photo_bytes: jpeg.size,
    depth: depth === null ? null : { width_px: depth.width_px, height_px: depth.height_px },
    ...(correctedPose == null ? {} : { corrected_world_from_cam: correctedPose }),
    ...(automatic === true ? { automatic } : {}),
  };
  const json = new TextEncoder().encode(JSON.stringify(header));
  const length = new DataView(new ArrayBuffer(4));
  length.setUint32(0, json.byteLength, true);
  return new Blob([length, json, jpeg, ...(depth === null ? [] : [littleEndian(depth)])]);
}

function littleEndian(depth: DepthMap): ArrayBuffer {
  const { width_px, height_px, depth_mm } = depth;
  if (depth_mm.length !== width_px * height_px) {
    throw new RangeError(
      `need ${width_px} x ${height_px} depth values, got ${depth_mm.length}`);
  }
  const view = new DataView(new ArrayBuffer(2 * depth_mm.length));
  depth_mm.forEach((value, i) => view.setUint16(2 * i, value, true));
  return view.buffer;
}
