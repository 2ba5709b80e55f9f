/**
 * What is drawn of a guide: 3D axes at every open target, and a sight that goes with the camera.
 *
 * A target is where the lens is to be, which nobody sees through that lens. So each is drawn a little
 * ahead of itself, and so is the sight: they meet when the camera is at the target. The ring of the
 * sight is as wide as the tolerance (up to a limit), and the axis that points to the photographer shrinks to a point
 * when the direction is right.
 */

import type { Cam, Camera, Rigid, World } from '../geometry';
import { LineRenderer, Lines, type Paint } from '../render/lines';
import type { LiveFrame } from '../sources/frame_source';
import type { GuideKind } from './guide_options';
import type { GuideState } from './guide_session';

type Point = readonly [number, number, number];

/** Marks stand so far ahead, as a part of z_min: before everything, but not at the lens. */
const AHEAD_SHARE = 0.6;
const AHEAD_M = { least: 0.12, most: 0.35 } as const;
/** Of the distance between neighbours. */
const AXIS_SHARE = 0.36;
const TILE_SHARE = 0.45;
/** Of how far the mark is ahead: wide steps and tolerances must not fill the picture. */
const MAX_AXIS_SHARE = 0.15;
const MAX_RING_SHARE = 0.12;
/** Of how far the mark is ahead. */
const POINTER_SHARE = 0.3;
const RING_PIECES = 32;

/** Not red, which means an error elsewhere in this program. */
const COLOURS = {
  right: [1, 0.66, 0.1], up: [0.36, 0.9, 0.45], towards: [0.3, 0.66, 1], sight: [1, 1, 1],
  reach: [0.36, 0.95, 0.5],
} as const;
const DIM = 0.6;

export class GuideMarks implements Disposable {
  readonly #renderer: LineRenderer;
  readonly #inRoom: Lines;
  readonly #onCamera: Lines;
  #drawn: Pick<GuideState, 'guide' | 'takenBy' | 'next' | 'reach'> | null = null;

  constructor(gl: WebGL2RenderingContext, readonly kind: GuideKind) {
    this.#renderer = new LineRenderer(gl);
    this.#inRoom = new Lines(gl);
    this.#onCamera = new Lines(gl);
  }

  /** Draw over what the frame shows. */
  draw(frame: LiveFrame, camera: Camera, state: GuideState): void {
    if (state.guide === null || state.phase === 'done') return;
    this.#follow(state);
    this.#renderer.draw(frame, camera, this.#inRoom, this.#onCamera);
  }

  [Symbol.dispose](): void {
    this.#renderer[Symbol.dispose]();
    this.#inRoom[Symbol.dispose]();
    this.#onCamera[Symbol.dispose]();
  }

  /** Make the lines anew when what they show has changed. */
  #follow(state: GuideState): void {
    const { guide, takenBy, next, reach } = state;
    const before = this.#drawn;
    if (guide === null || (before?.guide === guide && before.takenBy === takenBy
      && before.next === next && before.reach === reach)) return;
    this.#drawn = { guide, takenBy, next, reach };
    const ahead_m = aheadOf(state);
    const apart_m = apartOf(state);
    const ring_m = Math.min(guide.nearEnough.position_m, MAX_RING_SHARE * ahead_m);
    guide.targets.forEach((target, i) => {
      if (takenBy[i] !== null) return;
      this.#mark(target, ahead_m, apart_m, i === next);
      if (i !== next) return;
      ring(this.#inRoom, inRoom(target, ahead_m), ring_m, [...COLOURS.towards, 1], 1);
    });
    this.#inRoom.upload();
    const sight = reach === null ? COLOURS.sight : COLOURS.reach;
    const onCamera = (x: number, y: number): Point => [x, y, ahead_m];
    ring(this.#onCamera, onCamera, ring_m, [...sight, 0.95], reach === null ? 1.2 : 2.2);
    const cross_m = 0.35 * ring_m;
    this.#onCamera.add(onCamera(-cross_m, 0), onCamera(cross_m, 0), [...sight, 0.95]);
    this.#onCamera.add(onCamera(0, -cross_m), onCamera(0, cross_m), [...sight, 0.95]);
    this.#onCamera.upload();
  }

  #mark(target: Rigid<World, Cam>, ahead_m: number, apart_m: number, isNext: boolean): void {
    const point = inRoom(target, ahead_m);
    const opacity = isNext ? 1 : DIM;
    const width = isNext ? 1.8 : 1.1;
    const line = (begin: Point, end: Point, colour: readonly [number, number, number]): void =>
      this.#inRoom.add(begin, end, [...colour, opacity], width);
    const pointer = inRoom(target, ahead_m * (1 - POINTER_SHARE));
    line(point(0, 0), pointer(0, 0), COLOURS.towards);
    if (this.kind === 'planes') {
      const half_m = TILE_SHARE * apart_m;
      const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]] as const;
      corners.forEach(([x, y], i) => {
        const [nextX, nextY] = corners[(i + 1) % 4] ?? [x, y];
        line(point(half_m * x, half_m * y), point(half_m * nextX, half_m * nextY),
          COLOURS.towards);
      });
      return;
    }
    const axis_m = Math.min(AXIS_SHARE * apart_m, MAX_AXIS_SHARE * ahead_m);
    line(point(0, 0), point(axis_m, 0), COLOURS.right);
    line(point(0, 0), point(0, -axis_m), COLOURS.up);
  }
}

/** The distance between neighbours, as far as marks must not touch. */
function apartOf({ guide, bound }: GuideState): number {
  const [first, second] = guide?.targets ?? [];
  if (first === undefined || second === undefined) return bound?.pitch_m ?? 0.05;
  return Math.hypot(...[3, 7, 11].map((i) => (first.rows[i] ?? NaN) - (second.rows[i] ?? NaN)));
}

function aheadOf({ zMin_m }: GuideState): number {
  return Math.min(Math.max(AHEAD_SHARE * (zMin_m ?? 0), AHEAD_M.least), AHEAD_M.most);
}

/** Points of the plane that stands `ahead_m` before a pose. */
function inRoom(pose: Rigid<World, Cam>, ahead_m: number): (x: number, y: number) => Point {
  const m = pose.rows;
  const row = (r: number, x: number, y: number): number => (m[4 * r] ?? NaN) * x
    + (m[4 * r + 1] ?? NaN) * y + (m[4 * r + 2] ?? NaN) * ahead_m + (m[4 * r + 3] ?? NaN);
  return (x, y) => [row(0, x, y), row(1, x, y), row(2, x, y)];
}

function ring(
  lines: Lines, point: (x: number, y: number) => Point, radius_m: number, paint: Paint,
  width: number,
): void {
  const at = (i: number): Point => {
    const angle = (2 * Math.PI * i) / RING_PIECES;
    return point(radius_m * Math.cos(angle), radius_m * Math.sin(angle));
  };
  for (let i = 0; i < RING_PIECES; i += 1) lines.add(at(i), at(i + 1), paint, width);
}
