/**
 * A trace of a phone, played: what the device said goes through the same functions as on the phone.
 * docs/trace.md describes the file.
 */

import {
  pinholeOfProjection, rigid, worldFromCamOfWebXr, type Camera,
} from '../geometry';
import type { Trace, TracedFrame } from '../wire';
import { depthMapOf, known } from './depth';
import type { DepthMap, WorldResets } from './frame_source';
import { textureOf, type Played, type RecordingServer } from './played';
import { WorldOrigin } from './world_origin';

/** A frame without a successor is shown as long as most are. */
const LAST_MS = 33;

interface Moment {
  /** In the trace. */
  readonly index: number;
  readonly time_ms: number;
  readonly camera: Camera | null;
  readonly resets: WorldResets;
}

/** Frames with a picture, and those in which tracking was lost, at their own times. */
export function playedTrace(server: RecordingServer, name: string, trace: Trace): Played {
  const moments = momentsOf(trace);
  const at = (i: number): Moment => {
    const moment = moments[i];
    if (moment === undefined) throw new RangeError(`the trace has ${moments.length} moments, not ${i}`);
    return moment;
  };
  return {
    count: moments.length,
    camera: (i) => at(i).camera,
    duration_ms: (i) => (moments[i + 1]?.time_ms ?? at(i).time_ms + LAST_MS) - at(i).time_ms,
    resets: (i) => at(i).resets,
    async load(i) {
      const { index, camera } = at(i);
      const traced = trace.frames[index];
      if (camera === null || traced === undefined) return { picture: null, depth: null };
      const [photo, raw] = await Promise.all([
        server.recordedPhoto(name, index),
        traced.depth == null ? null : server.recordedDepth(name, index),
      ]);
      return { picture: await textureOf(photo), depth: raw === null ? null : depthOf(traced, raw) };
    },
  };
}

function momentsOf(trace: Trace): Moment[] {
  const origin = new WorldOrigin();
  const moments: Moment[] = [];
  trace.frames.forEach((frame, index) => {
    for (const matrix of frame.resets ?? []) origin.reset(matrix);
    const lost = frame.world_from_view == null;
    if (!lost && frame.picture == null) return;
    moments.push({
      index, time_ms: frame.time_ms, camera: cameraOf(frame, origin), resets: { ...origin.resets },
    });
  });
  return moments;
}

function cameraOf(
  { world_from_view, projection, picture }: TracedFrame, origin: WorldOrigin,
): Camera | null {
  if (world_from_view == null || projection == null || picture == null) return null;
  const worldFromCam = worldFromCamOfWebXr(world_from_view, rigid(new Float64Array(12)));
  origin.follow(worldFromCam);
  return { pinhole: pinholeOfProjection(projection, picture.width_px, picture.height_px), worldFromCam };
}

function depthOf({ depth, picture }: TracedFrame, data: ArrayBuffer): DepthMap | null {
  if (depth == null || picture == null) return null;
  const raw = {
    width: depth.width_px, height: depth.height_px, data, rawValueToMeters: depth.metres_per_unit,
    normDepthBufferFromNormView: { matrix: Float32Array.from(depth.buffer_from_view) },
  };
  return known(depthMapOf(raw, depth.format, picture.width_px / picture.height_px));
}
