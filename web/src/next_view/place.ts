/**
 * Where a suggested view lies, seen from where the camera is now: as a frame in the room to step
 * into, and in words. Nothing is made: results are written into what is handed in.
 */

import type { Cam, Camera, Rigid, World } from '../geometry';

/** The frame stands so far ahead of the suggested pose; a small step then moves it clearly. */
export const AHEAD_M = 0.7;
/** It surrounds this part of the picture from there, per axis, so that it can be stepped into. */
export const INNER = 0.6;
/** A pose is reached when its frame lies within this part of the picture's side from its middle … */
export const REACHED = 0.09;
/** … and is about as large as it should be. */
const REACHED_SIZE = 0.2;
/** The frame counts as in the picture from this share of the half side on, and until that. */
const INSIDE = { begins: 0.72, ends: 0.9 } as const;

/** A frame in the picture, in shares of its width and height from the top left corner. */
export interface FrameInPicture {
  /** x and y of the corners: top left, top right, bottom right, bottom left. */
  readonly corners: Float64Array;
  /** The middle, in axes of the live camera, metres. */
  readonly direction: [number, number, number];
  /** Whether its middle lies in the picture; with hysteresis, so that it does not flicker. */
  inside: boolean;
  /** The camera is where the view should be taken. */
  reached: boolean;
}

export function newFrame(): FrameInPicture {
  return { corners: new Float64Array(8), direction: [0, 0, 0], inside: false, reached: false };
}

/** Signs of x and y of the corners. */
const RIGHT = [-1, 1, 1, -1] as const;
const DOWN = [-1, -1, 1, 1] as const;
const point: [number, number, number] = [0, 0, 0];

/**
 * Find the frame of a suggested view in the live picture.
 *
 * @param out Written to, and returned; `inside` before says which way the hysteresis leans.
 */
export function frameOf(live: Camera, suggested: Camera, out: FrameInPicture): FrameInPicture {
  const there = suggested.pinhole;
  const half_x = (INNER * AHEAD_M * there.width_px) / (2 * there.fx_px);
  const half_y = (INNER * AHEAD_M * there.height_px) / (2 * there.fy_px);
  inLive(live.worldFromCam, suggested.worldFromCam, 0, 0, AHEAD_M, out.direction);
  const x = out.direction[0];
  const y = out.direction[1];
  const z = out.direction[2];
  const k = live.pinhole;
  const u = (2 * k.fx_px * x) / (z * k.width_px);
  const v = (2 * k.fy_px * y) / (z * k.height_px);
  const far = Math.max(Math.abs(u), Math.abs(v));
  let ahead = z > 0.1 * AHEAD_M;
  let size = 0;
  for (let i = 0; i < 4; i += 1) {
    const right_m = (RIGHT[i] ?? NaN) * half_x;
    inLive(live.worldFromCam, suggested.worldFromCam, right_m, (DOWN[i] ?? NaN) * half_y, AHEAD_M, point);
    ahead &&= point[2] > 0.05 * AHEAD_M;
    out.corners[2 * i] = (k.fx_px * point[0] / point[2] + k.cx_px) / k.width_px;
    out.corners[2 * i + 1] = (k.fy_px * point[1] / point[2] + k.cy_px) / k.height_px;
  }
  for (let i = 0; i < 4; i += 1) {
    const j = (i + 1) % 4;
    size += Math.hypot(corner(out, j, 0) - corner(out, i, 0), corner(out, j, 1) - corner(out, i, 1)) / 4;
  }
  out.inside = ahead && far < (out.inside ? INSIDE.ends : INSIDE.begins);
  out.reached = ahead && far < 2 * REACHED && Math.abs(size / INNER - 1) < REACHED_SIZE;
  return out;
}

function corner(frame: FrameInPicture, i: number, axis: number): number {
  return frame.corners[2 * i + axis] ?? NaN;
}

/** A point of the suggested camera's frame, in the live camera's. */
function inLive(
  worldFromLive: Rigid<World, Cam>, worldFromSuggested: Rigid<World, Cam>,
  x: number, y: number, z: number, out: [number, number, number],
): void {
  const s = worldFromSuggested.rows;
  const l = worldFromLive.rows;
  const dx = at(s, 0) * x + at(s, 1) * y + at(s, 2) * z + at(s, 3) - at(l, 3);
  const dy = at(s, 4) * x + at(s, 5) * y + at(s, 6) * z + at(s, 7) - at(l, 7);
  const dz = at(s, 8) * x + at(s, 9) * y + at(s, 10) * z + at(s, 11) - at(l, 11);
  for (let i = 0; i < 3; i += 1) out[i] = at(l, i) * dx + at(l, 4 + i) * dy + at(l, 8 + i) * dz;
}

/** What to do to get there. */
export type Move = 'left' | 'right' | 'up' | 'down' | 'closer' | 'back'
  | 'turn-left' | 'turn-right' | 'turn-up' | 'turn-down' | 'here';

/** A turn counts as much as a step when it is so many metres times the angle. */
const METRES_PER_RAD = 0.6;
const offset: [number, number, number] = [0, 0, 0];
const ahead: [number, number, number] = [0, 0, 0];
/** How far to the right, down, ahead, and turned right and down; metres. */
const way = new Float64Array(5);
const THERE: readonly Move[] = ['right', 'down', 'closer', 'turn-right', 'turn-down'];
const OTHER_WAY: readonly Move[] = ['left', 'up', 'back', 'turn-left', 'turn-up'];

/** The largest part of the way from the live camera to a suggested one; `here`: none is left. */
export function moveTo(live: Camera, suggested: Camera, reached: boolean): Move {
  if (reached) return 'here';
  inLive(live.worldFromCam, suggested.worldFromCam, 0, 0, 0, offset);
  inLive(live.worldFromCam, suggested.worldFromCam, 0, 0, 1, ahead);
  way.set(offset);
  way[3] = METRES_PER_RAD * Math.atan2(ahead[0] - offset[0], ahead[2] - offset[2]);
  way[4] = METRES_PER_RAD * Math.asin(Math.min(Math.max(ahead[1] - offset[1], -1), 1));
  let most = 0;
  for (let i = 1; i < way.length; i += 1) if (Math.abs(at(way, i)) > Math.abs(at(way, most))) most = i;
  return (at(way, most) < 0 ? OTHER_WAY[most] : THERE[most]) ?? 'here';
}

function at(values: ArrayLike<number>, index: number): number {
  return values[index] ?? NaN;
}
