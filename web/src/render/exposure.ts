/** By how much the live picture is brighter than the view; twin of `exposure_gain` in Python. */

export const GAIN_STRIDE = 5;
const GAIN_RANGE = 2;
const LEAST_SAMPLES = 50;

/**
 * The factor per channel: the median over pixels that are well covered and neither dark nor clipped in
 * either picture.
 *
 * @param pixels RGBA8: premultiplied samples of the view, then as many of the live picture.
 */
export function exposureGain(pixels: Uint8Array): [number, number, number] {
  const half = pixels.length / 2;
  const gainOf = (channel: number): number => {
    const ratios: number[] = [];
    for (let at = 0; at < half; at += 4) {
      const ours = (pixels[at + channel] ?? 0) / 255;
      const theirs = (pixels[half + at + channel] ?? 0) / 255;
      if ((pixels[at + 3] ?? 0) / 255 <= 0.95) continue;
      if (ours <= 0.08 || theirs <= 0.08 || ours >= 0.97 || theirs >= 0.97) continue;
      ratios.push(theirs / ours);
    }
    if (ratios.length < LEAST_SAMPLES) return 1;
    return Math.min(Math.max(median(ratios), 1 / GAIN_RANGE), GAIN_RANGE);
  };
  return [gainOf(0), gainOf(1), gainOf(2)];
}

function median(values: number[]): number {
  values.sort((a, b) => a - b);
  const middle = values.length >> 1;
  const upper = values[middle] ?? NaN;
  return values.length % 2 === 1 ? upper : (upper + (values[middle - 1] ?? NaN)) / 2;
}
