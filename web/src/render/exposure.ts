/** By how much the live picture is brighter than the view; twin of `exposure_gain` in Python. */

export const GAIN_STRIDE = 5;
const GAIN_RANGE = 2;
const MIN_SAMPLES = 50;

/** Ratios of one channel; grows to the largest grid. */
let ratios = new Float64Array(0);

/**
 * The factor per channel: the median over pixels that are well covered and neither dark nor clipped in
 * either picture.
 *
 * @param pixels RGBA8: premultiplied samples of the view, then as many of the live picture.
 * @param out Red, green, blue; written to.
 * @returns Whether any of them is another one than before.
 */
export function exposureGain(pixels: Uint8Array, out: Float32Array): boolean {
  if (ratios.length < pixels.length / 8) ratios = new Float64Array(pixels.length / 8);
  let changed = false;
  for (let channel = 0; channel < 3; channel += 1) {
    const gain = Math.fround(gainOf(pixels, channel));
    if (gain === out[channel]) continue;
    out[channel] = gain;
    changed = true;
  }
  return changed;
}

function gainOf(pixels: Uint8Array, channel: number): number {
  const half = pixels.length / 2;
  let count = 0;
  for (let at = 0; at < half; at += 4) {
    const ours = (pixels[at + channel] ?? 0) / 255;
    const theirs = (pixels[half + at + channel] ?? 0) / 255;
    if ((pixels[at + 3] ?? 0) / 255 <= 0.95) continue;
    if (ours <= 0.08 || theirs <= 0.08 || ours >= 0.97 || theirs >= 0.97) continue;
    ratios[count] = theirs / ours;
    count += 1;
  }
  if (count < MIN_SAMPLES) return 1;
  // A view of the scratch, which is all that is made here; it is sorted as numbers.
  const sorted = ratios.subarray(0, count).sort();
  const middle = count >> 1;
  const upper = sorted[middle] ?? NaN;
  const median = count % 2 === 1 ? upper : (upper + (sorted[middle - 1] ?? NaN)) / 2;
  return Math.min(Math.max(median, 1 / GAIN_RANGE), GAIN_RANGE);
}
