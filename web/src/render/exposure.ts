/** By how much the live picture is brighter than the view; twin of `error_map/exposure.py`. */

export const GAIN_STRIDE = 5;
const MAX_LOG_GAIN = Math.log(2);
const OPAQUE = 0.95;
const DARK = 0.04;
const CLIPPED = 0.97;
/** The fall-offs that are tried: FIRST … LAST, in steps of STEP. */
const FIRST_FALLOFF = -9;
const LAST_FALLOFF = 3;
const FALLOFF_STEP = 0.05;
const BIN = 0.02;
const HALF_WIDTH = 4;
const BINS = Math.ceil((2 * MAX_LOG_GAIN) / BIN) + 2 * HALF_WIDTH;
const FALLOFF_COST = 0.15;
const UNCHANGED = 0.3;
const AGREES = 0.09;
const STEPS = 3;
const STIFFNESS = 0.002;
const MIN_PIXELS = 30;

/** Scratch for one number of every sample; it grows to the largest grid. */
class Samples {
  logRatio = new Float64Array(0);
  radius2 = new Float64Array(0);
  channels = [new Float64Array(0), new Float64Array(0), new Float64Array(0)];
  sorted = new Float64Array(0);

  makeRoom(count: number): void {
    if (this.sorted.length >= count) return;
    this.logRatio = new Float64Array(count);
    this.radius2 = new Float64Array(count);
    this.channels = this.channels.map(() => new Float64Array(count));
    this.sorted = new Float64Array(count);
  }
}

const samples = new Samples();
const counts = new Float64Array(BINS);

/**
 * The factor per channel, and the log of the factor in the corners on top of it: what most of the
 * picture agrees with, and nothing where a good part of it says that nothing changed.
 *
 * @param pixels RGBA8: premultiplied samples of the view, every `GAIN_STRIDE`th pixel of its rows
 *   from the top left, then as many of the live picture.
 * @param width_px Of the view.
 * @param height_px Of the view.
 * @param out Red, green, blue, fall-off; written to.
 * @returns Whether any of them is another one than before.
 */
export function measureExposure(
  pixels: Uint8Array, width_px: number, height_px: number, out: Float32Array,
): boolean {
  const count = gather(pixels, width_px, height_px);
  let red = 0;
  let green = 0;
  let blue = 0;
  const agreed = count < MIN_PIXELS ? null : fit(count);
  if (agreed !== null) {
    const { logGain, falloff } = agreed;
    red = channel(0, count, logGain, falloff);
    green = channel(1, count, logGain, falloff);
    blue = channel(2, count, logGain, falloff);
  }
  const changes = [set(out, 0, Math.exp(red)), set(out, 1, Math.exp(green)),
    set(out, 2, Math.exp(blue)), set(out, 3, agreed?.falloff ?? 0)];
  return changes.some(Boolean);
}

/** Returns how many samples tell something. */
function gather(pixels: Uint8Array, width_px: number, height_px: number): number {
  const half = pixels.length / 2;
  const cols = Math.ceil(width_px / GAIN_STRIDE);
  const scale = 4 / (width_px * width_px + height_px * height_px);
  samples.makeRoom(half / 4);
  let count = 0;
  for (let at = 0; at < half; at += 4) {
    const alpha = (pixels[at + 3] ?? 0) / 255;
    if (alpha <= OPAQUE) continue;
    let ours = 0;
    let theirs = 0;
    let tells = true;
    for (let c = 0; c < 3; c += 1) {
      const own = (pixels[at + c] ?? 0) / 255 / alpha;
      const live = (pixels[half + at + c] ?? 0) / 255;
      tells &&= own > DARK && live > DARK && own < CLIPPED && live < CLIPPED;
      const into = samples.channels[c];
      if (into !== undefined) into[count] = Math.log(live / own);
      ours += own;
      theirs += live;
    }
    if (!tells) continue;
    const sample = at / 4;
    const x = (sample % cols) * GAIN_STRIDE + 0.5 - 0.5 * width_px;
    const y = Math.floor(sample / cols) * GAIN_STRIDE + 0.5 - 0.5 * height_px;
    samples.radius2[count] = (x * x + y * y) * scale;
    samples.logRatio[count] = Math.log(theirs / ours);
    count += 1;
  }
  return count;
}

/** The factor and fall-off that the samples agree with; null where too few do. */
function fit(count: number): { logGain: number; falloff: number } | null {
  const { logRatio, radius2 } = samples;
  const found = mostFrequent(count);
  let { logGain, falloff } = found;
  for (let step = 0; step < STEPS; step += 1) {
    let agreeing = 0;
    let sumX = 0;
    let sumY = 0;
    for (let i = 0; i < count; i += 1) {
      if (!agrees(i, logGain, falloff)) continue;
      agreeing += 1;
      sumX += radius2[i] ?? 0;
      sumY += logRatio[i] ?? 0;
    }
    if (agreeing < MIN_PIXELS) return null;
    let xx = STIFFNESS * agreeing;
    let xy = 0;
    for (let i = 0; i < count; i += 1) {
      if (!agrees(i, logGain, falloff)) continue;
      const x = (radius2[i] ?? 0) - sumX / agreeing;
      xx += x * x;
      xy += x * ((logRatio[i] ?? 0) - sumY / agreeing);
    }
    const slope = Math.min(Math.max(xy / xx, FIRST_FALLOFF * FALLOFF_STEP), LAST_FALLOFF * FALLOFF_STEP);
    let kept = 0;
    for (let i = 0; i < count; i += 1) {
      if (!agrees(i, logGain, falloff)) continue;
      samples.sorted[kept] = (logRatio[i] ?? 0) - slope * (radius2[i] ?? 0);
      kept += 1;
    }
    falloff = slope;
    logGain = medianOf(kept);
  }
  found.logGain = logGain;
  found.falloff = falloff;
  return agreeingCount(count, logGain, falloff) < MIN_PIXELS ? null : found;
}

const frequent = { logGain: 0, falloff: 0 };

function mostFrequent(count: number): { logGain: number; falloff: number } {
  const { logRatio, radius2 } = samples;
  frequent.logGain = 0;
  frequent.falloff = 0;
  if (agreeingCount(count, 0, 0) >= UNCHANGED * count) return frequent;
  let best = -Infinity;
  for (let step = FIRST_FALLOFF; step <= LAST_FALLOFF; step += 1) {
    const falloff = step * FALLOFF_STEP;
    counts.fill(0);
    for (let i = 0; i < count; i += 1) {
      const place = Math.floor(((logRatio[i] ?? 0) - falloff * (radius2[i] ?? 0)) / BIN) + (BINS >> 1);
      if (place >= 0 && place < BINS) counts[place] = (counts[place] ?? 0) + 1;
    }
    for (let bin = 0; bin < BINS; bin += 1) {
      let around = 0;
      for (let k = Math.max(bin - HALF_WIDTH, 0); k <= Math.min(bin + HALF_WIDTH, BINS - 1); k += 1) {
        around += counts[k] ?? 0;
      }
      const score = around - FALLOFF_COST * count * Math.abs(falloff);
      if (score <= best) continue;
      best = score;
      frequent.logGain = (bin - (BINS >> 1) + 0.5) * BIN;
      frequent.falloff = falloff;
    }
  }
  return frequent;
}

function agrees(i: number, logGain: number, falloff: number): boolean {
  const rest = (samples.logRatio[i] ?? 0) - logGain - falloff * (samples.radius2[i] ?? 0);
  return Math.abs(rest) < AGREES;
}

function agreeingCount(count: number, logGain: number, falloff: number): number {
  let agreeing = 0;
  for (let i = 0; i < count; i += 1) if (agrees(i, logGain, falloff)) agreeing += 1;
  return agreeing;
}

/** The log factor of a channel: the median over what agrees. */
function channel(c: number, count: number, logGain: number, falloff: number): number {
  let kept = 0;
  for (let i = 0; i < count; i += 1) {
    if (!agrees(i, logGain, falloff)) continue;
    samples.sorted[kept] = (samples.channels[c]?.[i] ?? 0) - falloff * (samples.radius2[i] ?? 0);
    kept += 1;
  }
  return Math.min(Math.max(medianOf(kept), -MAX_LOG_GAIN), MAX_LOG_GAIN);
}

/** Of the first numbers in `samples.sorted`. */
function medianOf(count: number): number {
  // A view of the scratch, which is all that is made here; it is sorted as numbers.
  const sorted = samples.sorted.subarray(0, count).sort();
  const middle = count >> 1;
  const upper = sorted[middle] ?? NaN;
  return count % 2 === 1 ? upper : (upper + (sorted[middle - 1] ?? NaN)) / 2;
}

function set(out: Float32Array, at: number, value: number): boolean {
  const rounded = Math.fround(value);
  if (out[at] === rounded) return false;
  out[at] = rounded;
  return true;
}
