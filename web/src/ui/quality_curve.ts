/** How good more and more views are, as SVG. */

import type { CurvePoint } from '../wire';

const WIDTH = 320;
const HEIGHT = 104;
const TOP = 22;
const BOTTOM = 24;
const SIDE = 6;
/** So wide is "40 of 63". */
const LABEL = 62;
/** Fewer points say nothing. */
const LEAST = 3;

/**
 * @param curve In rising number of views.
 * @param enough Marked, as so many of `total`.
 * @returns Markup in which there are only numbers and words of ours; empty where there is no curve.
 */
export function drawQuality(curve: readonly CurvePoint[], enough: number, total: number): string {
  const first = curve[0];
  const last = curve.at(-1);
  if (first === undefined || last === undefined || curve.length < LEAST) return '';
  const qualities = curve.map(({ psnr_db }) => psnr_db);
  const low = Math.min(...qualities);
  const range = Math.max(Math.max(...qualities) - low, 0.1);
  const x = (views: number): number => SIDE
    + ((WIDTH - 2 * SIDE) * (views - first.num_views)) / (last.num_views - first.num_views);
  const y = (psnr_db: number): number => HEIGHT - BOTTOM
    - ((HEIGHT - BOTTOM - TOP) * (psnr_db - low)) / range;
  const line = curve.map(({ num_views, psnr_db }) => `${x(num_views).toFixed(1)} ${y(psnr_db).toFixed(1)}`);
  const mark = x(enough);
  const isRight = mark + LABEL > WIDTH;
  return `<svg viewBox="0 0 ${WIDTH} ${HEIGHT}" role="img" aria-label="Predicted quality by number of views">
    <text x="${SIDE}" y="12" class="quiet">predicted quality</text>
    <path d="M${mark.toFixed(1)} ${TOP - 6}V${HEIGHT - 6}" class="mark"/>
    <path d="M${line.join('L')}" class="quality"/>
    <text x="${(isRight ? mark - 5 : mark + 5).toFixed(1)}" y="${HEIGHT - 8}" text-anchor="${isRight ? 'end' : 'start'}">${enough} of ${total}</text></svg>`;
}
