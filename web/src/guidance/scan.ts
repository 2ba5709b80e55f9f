/** The scan before the first view: the least depth of the scene; twin of guidance/scan.py. */

import type { DepthMap } from '../sources/frame_source';

const NEAR_SHARE = 0.01;
export const CONFIRMATIONS = 3;
const MIN_KNOWN_SHARE = 0.05;

/** Finds z_min: the third smallest of the maps' near depths. Two maps may be entirely wrong. */
export class DepthScan {
  /** Maps that said something. */
  frames = 0;
  #nearest_m: number[] = [];

  constructor(readonly confirmations = CONFIRMATIONS) {}

  add(depth: DepthMap): void {
    const near_m = nearDepth(depth);
    if (near_m === null) return;
    this.frames += 1;
    this.#nearest_m = [...this.#nearest_m, near_m].sort((a, b) => a - b)
      .slice(0, this.confirmations);
  }

  /** The least depth so far; null until enough maps have confirmed one. */
  get zMin_m(): number | null {
    return this.#nearest_m[this.confirmations - 1] ?? null;
  }
}

/** The near depth of a map, in metres: of its n known ones that of rank floor(n / 100). */
export function nearDepth(depth: DepthMap): number | null {
  const known_mm = depth.depth_mm.filter((mm) => mm > 0).sort();
  if (known_mm.length === 0 || known_mm.length < MIN_KNOWN_SHARE * depth.depth_mm.length) {
    return null;
  }
  const near_mm = known_mm[Math.floor(known_mm.length * NEAR_SHARE)];
  return near_mm === undefined ? null : near_mm / 1000;
}

/** How far what the camera looks at is: the median of the middle ninth of a map. */
export function middleDepth(depth: DepthMap): number | null {
  const { width_px, height_px, depth_mm } = depth;
  const left = Math.floor(width_px / 3);
  const top = Math.floor(height_px / 3);
  const known_mm: number[] = [];
  for (let y = top; y < height_px - top; y += 1) {
    for (let x = left; x < width_px - left; x += 1) {
      const mm = depth_mm[y * width_px + x] ?? 0;
      if (mm > 0) known_mm.push(mm);
    }
  }
  known_mm.sort((a, b) => a - b);
  const middle_mm = known_mm[Math.floor(known_mm.length / 2)];
  return middle_mm === undefined ? null : middle_mm / 1000;
}
