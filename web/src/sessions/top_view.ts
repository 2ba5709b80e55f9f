/** A session seen from above: where the phone was, how red it saw, and where views were taken. */

import type { Capture, PeakedSample } from '../wire';

export type Point = readonly [x_m: number, y_m: number];

export interface TopView {
  /** Where the phone went, with the peaked share there. */
  readonly path: readonly { readonly at: Point; readonly share: number }[];
  /** Where views were taken: place and the direction they look in. */
  readonly views: readonly { readonly at: Point; readonly ahead: Point; readonly number: number }[];
}

type Vector = readonly [number, number, number];

const SIGHT_M = 0.25;

/**
 * Look down along the mean "down" of all cameras: WebXR's worlds have y up, recordings any axis.
 * The plane is turned so that the first view looks to the top of the picture.
 */
export function topViewOf(captures: readonly Capture[], samples: readonly PeakedSample[]): TopView {
  const kept = captures.filter((capture) => capture.removed !== true);
  const poses = [...kept.map((c) => c.camera.world_from_cam), ...samples.map((s) => s.world_from_cam)];
  const first = poses[0];
  if (first === undefined) return { path: [], views: [] };
  const down = unit(poses.map((pose) => column(pose, 1)).reduce(plus));
  const ahead = unit(without(column(first, 2), down));
  const right = cross(down, ahead);
  const flat = (v: Vector): Point => [dot(v, right), -dot(v, ahead)];
  return {
    path: samples.map((sample) => ({
      at: flat(column(sample.world_from_cam, 3)), share: sample.peaked_share,
    })),
    views: kept.map((capture) => ({
      at: flat(column(capture.camera.world_from_cam, 3)),
      ahead: flat(column(capture.camera.world_from_cam, 2)),
      number: capture.number,
    })),
  };
}

/** As an SVG of its own size in metres; the grid is half a metre wide. */
export function drawTopView(view: TopView): string {
  const points = [...view.path.map(({ at }) => at), ...view.views.map(({ at }) => at)];
  if (points.length === 0) return '';
  const margin_m = 2 * SIGHT_M;
  const xs = points.map(([x]) => x);
  const ys = points.map(([, y]) => y);
  const left = Math.min(...xs) - margin_m;
  const top = Math.min(...ys) - margin_m;
  const width = Math.max(...xs) + margin_m - left;
  const height = Math.max(...ys) + margin_m - top;
  const thin = Math.max(width, height) / 300;
  const lines: string[] = [];
  for (let x = Math.ceil(left / 0.5) * 0.5; x < left + width; x += 0.5) {
    lines.push(`<path d="M${f(x)} ${f(top)}v${f(height)}" stroke="#2a2f38" stroke-width="${f(thin)}"/>`);
  }
  for (let y = Math.ceil(top / 0.5) * 0.5; y < top + height; y += 0.5) {
    lines.push(`<path d="M${f(left)} ${f(y)}h${f(width)}" stroke="#2a2f38" stroke-width="${f(thin)}"/>`);
  }
  view.path.slice(1).forEach(({ at, share }, i) => {
    const from = view.path[i]?.at ?? at;
    lines.push(`<path d="M${f(from[0])} ${f(from[1])}L${f(at[0])} ${f(at[1])}" `
      + `stroke="${shade(share)}" stroke-width="${f(2.5 * thin)}" stroke-linecap="round"/>`);
  });
  for (const { at, ahead, number } of view.views) {
    const side: Point = [-0.28 * ahead[1], 0.28 * ahead[0]];
    const corner = (s: number): string =>
      `${f(at[0] + SIGHT_M * (ahead[0] + s * side[0]))} ${f(at[1] + SIGHT_M * (ahead[1] + s * side[1]))}`;
    lines.push(`<path d="M${f(at[0])} ${f(at[1])}L${corner(1)}L${corner(-1)}Z" fill="#ffffff22" `
      + `stroke="#fff" stroke-width="${f(thin)}"><title>View ${number}</title></path>`);
  }
  const x = left + 0.1 * margin_m;
  const y = top + height - 0.15 * margin_m;
  lines.push(`<path d="M${f(x)} ${f(y)}h0.5" stroke="#a9b0bb" stroke-width="${f(2 * thin)}"/>`
    + `<text x="${f(x)}" y="${f(y - 4 * thin)}" font-size="${f(12 * thin)}" fill="#a9b0bb">0.5 m</text>`);
  return `<svg viewBox="${f(left)} ${f(top)} ${f(width)} ${f(height)}" role="img" `
    + `aria-label="Path and views from above">${lines.join('')}</svg>`;
}

/** From calm to red. */
function shade(share: number): string {
  const much = Math.min(share / 0.25, 1);
  return `rgb(${Math.round(110 + 145 * much)} ${Math.round(200 - 130 * much)} ${Math.round(150 - 75 * much)})`;
}

function f(value: number): string {
  return value.toFixed(4);
}

function column(pose: readonly number[], index: number): Vector {
  return [pose[index] ?? 0, pose[4 + index] ?? 0, pose[8 + index] ?? 0];
}

function plus(a: Vector, b: Vector): Vector {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}

function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function cross(a: Vector, b: Vector): Vector {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function unit(v: Vector): Vector {
  const length = Math.sqrt(dot(v, v)) || 1;
  return [v[0] / length, v[1] / length, v[2] / length];
}

/** What is left of `v` across `axis`; for a camera that looks straight down, some direction across. */
function without(v: Vector, axis: Vector): Vector {
  const along = dot(v, axis);
  const rest: Vector = [v[0] - along * axis[0], v[1] - along * axis[1], v[2] - along * axis[2]];
  if (dot(rest, rest) > 1e-6) return rest;
  return Math.abs(axis[0]) < 0.9 ? cross(axis, [1, 0, 0]) : cross(axis, [0, 1, 0]);
}
