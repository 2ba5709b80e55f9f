/** The pictures that are aligned, at several sizes, and the pixels of each that are compared. */

import {
  DEPTH_EDGE, FINEST_PIXELS, LUMA, MAX_CHOSEN, MAX_LEVELS, MIN_ALPHA, MIN_GRADIENT, SHORTEST_SIDE_PX,
} from './align_constants';

/** Numbers per chosen pixel: its point (3), brightness, how that changes with the motion (6). */
export const NUMBERS = 10;

/** Pixels, corner origin. */
export interface AlignLens {
  readonly fx_px: number;
  readonly fy_px: number;
  readonly cx_px: number;
  readonly cy_px: number;
}

export interface AlignInput {
  readonly width: number;
  readonly height: number;
  readonly lens: AlignLens;
  /** RGBA8, premultiplied. */
  readonly rendered: Uint8Array;
  /** Metres along +z; 0 = unknown. */
  readonly depth_m: Float32Array;
  /** RGBA8; its alpha is not looked at. */
  readonly live: Uint8Array;
}

/** Of pictures of one size; level k is 2^k times smaller. */
export class Pyramid {
  readonly finest: number;
  readonly coarsest: number;
  readonly mostChosen: number;
  /** Brightness of the live picture: all levels, one after another. */
  readonly live: Float32Array;
  readonly chosen: Float32Array;
  readonly #rendered: Float32Array;
  readonly #depth_m: Float32Array;
  readonly #places: Uint8Array;

  constructor(readonly width: number, readonly height: number) {
    let finest = 0;
    while ((width >> finest) * (height >> finest) > FINEST_PIXELS) finest += 1;
    let coarsest = finest;
    while (coarsest - finest + 1 < MAX_LEVELS
      && Math.min(width, height) >> (coarsest + 1) >= SHORTEST_SIDE_PX) coarsest += 1;
    this.finest = finest;
    this.coarsest = coarsest;
    let pixels = 0;
    for (let k = 0; k <= coarsest; k += 1) pixels += (width >> k) * (height >> k);
    this.mostChosen = (width >> finest) * (height >> finest);
    this.#rendered = new Float32Array(pixels);
    this.#depth_m = new Float32Array(pixels);
    this.live = new Float32Array(pixels);
    this.chosen = new Float32Array(NUMBERS * this.mostChosen);
    this.#places = new Uint8Array(this.mostChosen);
  }

  /** Where a level begins. */
  startOf(level: number): number {
    let start = 0;
    for (let k = 0; k < level; k += 1) start += (this.width >> k) * (this.height >> k);
    return start;
  }

  fill(input: AlignInput): void {
    this.#fillFirst(input);
    for (let level = 0; level < this.coarsest; level += 1) {
      this.#halve(this.startOf(level), this.width >> level, this.height >> level);
    }
  }

  #fillFirst({ rendered, depth_m, live }: AlignInput): void {
    const [red, green, blue] = LUMA;
    const opaque = 255 * MIN_ALPHA;
    const count = this.width * this.height;
    for (let k = 0, c = 0; k < count; k += 1, c += 4) {
      const alpha = rendered[c + 3] as number;
      const luma = red * (rendered[c] as number) + green * (rendered[c + 1] as number)
        + blue * (rendered[c + 2] as number);
      this.#rendered[k] = alpha > 0 ? luma / alpha : 0;
      this.#depth_m[k] = alpha >= opaque ? depth_m[k] as number : 0;
      this.live[k] = (red * (live[c] as number) + green * (live[c + 1] as number)
        + blue * (live[c + 2] as number)) / 255;
    }
  }

  #halve(start: number, width: number, height: number): void {
    const rendered = this.#rendered;
    const depth = this.#depth_m;
    const live = this.live;
    let into = start + width * height;
    for (let y = 0; y < height >> 1; y += 1) {
      for (let x = 0; x < width >> 1; x += 1, into += 1) {
        const a = start + 2 * y * width + 2 * x;
        const b = a + width;
        rendered[into] = 0.25 * ((rendered[a] as number) + (rendered[a + 1] as number)
          + (rendered[b] as number) + (rendered[b + 1] as number));
        live[into] = 0.25 * ((live[a] as number) + (live[a + 1] as number)
          + (live[b] as number) + (live[b + 1] as number));
        const z0 = depth[a] as number;
        const z1 = depth[a + 1] as number;
        const z2 = depth[b] as number;
        const z3 = depth[b + 1] as number;
        const low = Math.min(z0, z1, z2, z3);
        const smooth = low > 0 && Math.max(z0, z1, z2, z3) < DEPTH_EDGE * low;
        depth[into] = smooth ? 0.25 * (z0 + z1 + z2 + z3) : 0;
      }
    }
  }

  /** Writes the pixels that are compared; returns how many there are. */
  choose({ fx_px, fy_px, cx_px, cy_px }: AlignLens, level: number): number {
    const scale = 1 / (1 << level);
    const start = this.startOf(level);
    const width = this.width >> level;
    const height = this.height >> level;
    const t = this.#rendered;
    const z = this.#depth_m;
    const chosen = this.chosen;
    const places = this.#places;
    const fx = fx_px * scale;
    const fy = fy_px * scale;
    const cx = cx_px * scale;
    const cy = cy_px * scale;
    let count = 0;
    for (let row = 1; row < height - 1; row += 1) {
      for (let col = 1; col < width - 1; col += 1) {
        const m = start + row * width + col;
        const depth = z[m] as number;
        if (depth <= 0) continue;
        const a = m - width;
        const b = m + width;
        const t00 = t[a - 1] as number;
        const t02 = t[a + 1] as number;
        const t20 = t[b - 1] as number;
        const t22 = t[b + 1] as number;
        const gx = 0.125 * (t02 - t00 + 2 * ((t[m + 1] as number) - (t[m - 1] as number)) + t22 - t20);
        const gy = 0.125 * (t20 - t00 + 2 * ((t[b] as number) - (t[a] as number)) + t22 - t02);
        if (Math.abs(gx) + Math.abs(gy) <= MIN_GRADIENT) continue;
        let low = depth;
        let high = depth;
        for (let k = a; k <= b; k += width) {
          for (let n = k - 1; n <= k + 1; n += 1) {
            const d = z[n] as number;
            if (d < low) low = d;
            if (d > high) high = d;
          }
        }
        if (low <= 0 || high >= DEPTH_EDGE * low) continue;
        const x = ((col + 0.5 - cx) / fx) * depth;
        const y = ((row + 0.5 - cy) / fy) * depth;
        const alongX = (fx * gx) / depth;
        const alongY = (fy * gy) / depth;
        const alongZ = -(alongX * x + alongY * y) / depth;
        const c = NUMBERS * count;
        chosen[c] = x;
        chosen[c + 1] = y;
        chosen[c + 2] = depth;
        chosen[c + 3] = t[m] as number;
        chosen[c + 4] = alongX;
        chosen[c + 5] = alongY;
        chosen[c + 6] = alongZ;
        chosen[c + 7] = y * alongZ - depth * alongY;
        chosen[c + 8] = depth * alongX - x * alongZ;
        chosen[c + 9] = x * alongY - y * alongX;
        places[count] = (row * 151 + col * 97) & 255;
        count += 1;
      }
    }
    return count <= MAX_CHOSEN ? count : this.#thin(count);
  }

  /** Keeps an even part of the chosen pixels. */
  #thin(count: number): number {
    const keep = Math.floor((256 * MAX_CHOSEN) / count);
    let kept = 0;
    for (let k = 0; k < count; k += 1) {
      if ((this.#places[k] as number) >= keep) continue;
      this.chosen.copyWithin(NUMBERS * kept, NUMBERS * k, NUMBERS * (k + 1));
      kept += 1;
    }
    return kept;
  }
}
