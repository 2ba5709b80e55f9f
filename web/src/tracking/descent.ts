/** Moves the camera until the rendering looks as the live picture does: Gauss-Newton, robust. */

import {
  AGREES, CAUCHY, CORRELATED, GAIN_SD, ITERATIONS, MAX_AGREEING_SIGMA, MAX_GAIN, MIN_GAIN, MIN_PIXELS, MIN_SIGMA,
  OFFSET_SD, PRIOR_MOVE_M, PRIOR_TURN_RAD, SMALL_MOVE_M, SMALL_TURN_RAD,
} from './align_constants';
import { addPrior, lengthOf, onlyPrior, solvePositive, startMotion } from './motions';
import { NUMBERS, Pyramid, type AlignInput, type AlignLens } from './pyramid';

/** Residuals are sorted into bins, of which the median is read. */
const BINS = 1024;
const BINS_PER_UNIT = 2048;
/** In place of the residual of a pixel that is not seen in the live picture. */
const OUTSIDE = 1e9;

interface Level {
  readonly lens: AlignLens;
  readonly scale: number;
  readonly start: number;
  readonly width: number;
  readonly height: number;
  readonly count: number;
}

/** Of R row by row: the turn about x, y, z is half of these less those. */
const TURN_PLUS = [7, 2, 3] as const;
const TURN_MINUS = [5, 6, 1] as const;

export class Descent {
  /** R row by row, t, gain, offset. */
  readonly motion = new Float64Array(14);
  /** Inverse of the covariance of the motion. */
  readonly information = new Float64Array(36);
  /** The last one: along x, y, z in metres, about x, y, z in radians, gain, offset. */
  readonly step = new Float64Array(8);
  agreeing = 0;
  /** Of the brightness of both, weighted as in the search. */
  correlation = 0;
  errorBefore = 0;
  errorAfter = 0;

  #pyramid = new Pyramid(1, 1);
  readonly #level = { lens: { fx_px: 1, fy_px: 1, cx_px: 0, cy_px: 0 } as AlignLens, scale: 1, start: 0, width: 0, height: 0, count: 0 };
  #there = new Float32Array(0);
  #here = new Float32Array(0);
  readonly #histogram = new Int32Array(BINS + 1);
  readonly #given = new Float64Array(14);
  readonly #hessian = new Float64Array(64);
  readonly #rhs = new Float64Array(8);
  readonly #back = new Float64Array(9);
  readonly #sums = new Float64Array(44);

  /** From coarse to fine; returns how many pixels were compared in the end. */
  search(input: AlignInput): number {
    startMotion(this.motion);
    onlyPrior(this.information);
    this.step.fill(0);
    this.agreeing = 0;
    this.correlation = 0;
    this.#takeRoom(input.width, input.height);
    this.#pyramid.fill(input);
    const { finest, coarsest } = this.#pyramid;
    const at = this.#level;
    at.lens = input.lens;
    let first = true;
    for (let level = coarsest; ; level -= 1) {
      at.scale = 1 / (1 << level);
      at.start = this.#pyramid.startOf(level);
      at.width = input.width >> level;
      at.height = input.height >> level;
      at.count = this.#pyramid.choose(input.lens, level);
      const seen = this.#residuals(at, this.motion, this.#there);
      if (seen >= MIN_PIXELS) {
        if (first) this.#matchBrightness(at.count);
        first = false;
        this.#descend(at);
      }
      if (level === finest) return seen < MIN_PIXELS ? seen : this.#measure(at);
    }
  }

  #takeRoom(width: number, height: number): void {
    if (this.#pyramid.width === width && this.#pyramid.height === height) return;
    this.#pyramid = new Pyramid(width, height);
    this.#there = new Float32Array(this.#pyramid.mostChosen);
    this.#here = new Float32Array(this.#pyramid.mostChosen);
  }

  /** Writes by how much the live picture is brighter; returns how many of the pixels are in it. */
  #residuals(at: Level, motion: Float64Array, into: Float32Array): number {
    const { lens, scale, start, width, height, count } = at;
    const fx = lens.fx_px * scale;
    const fy = lens.fy_px * scale;
    const cx = lens.cx_px * scale - 0.5;
    const cy = lens.cy_px * scale - 0.5;
    const r00 = motion[0] as number, r01 = motion[1] as number, r02 = motion[2] as number;
    const r10 = motion[3] as number, r11 = motion[4] as number, r12 = motion[5] as number;
    const r20 = motion[6] as number, r21 = motion[7] as number, r22 = motion[8] as number;
    const t0 = motion[9] as number, t1 = motion[10] as number, t2 = motion[11] as number;
    const gain = motion[12] as number, offset = motion[13] as number;
    const right = width - 1;
    const bottom = height - 1;
    const chosen = this.#pyramid.chosen;
    const live = this.#pyramid.live;
    const histogram = this.#histogram.fill(0);
    let seen = 0;
    for (let k = 0, c = 0; k < count; k += 1, c += NUMBERS) {
      const x = chosen[c] as number;
      const y = chosen[c + 1] as number;
      const z = chosen[c + 2] as number;
      const ahead = r20 * x + r21 * y + r22 * z + t2;
      into[k] = OUTSIDE;
      if (!(ahead > 1e-3)) continue;
      const inverse = 1 / ahead;
      const u = fx * (r00 * x + r01 * y + r02 * z + t0) * inverse + cx;
      const v = fy * (r10 * x + r11 * y + r12 * z + t1) * inverse + cy;
      if (!(u >= 0 && v >= 0 && u < right && v < bottom)) continue;
      const col = u | 0;
      const row = v | 0;
      const fu = u - col;
      const p = start + row * width + col;
      const left = live[p] as number;
      const below = live[p + width] as number;
      const above = left + fu * ((live[p + 1] as number) - left);
      const under = below + fu * ((live[p + width + 1] as number) - below);
      const residual = above + (v - row) * (under - above) - (gain * (chosen[c + 3] as number) + offset);
      into[k] = residual;
      const bin = Math.abs(residual) * BINS_PER_UNIT;
      const place = bin < BINS ? bin | 0 : BINS;
      histogram[place] = (histogram[place] as number) + 1;
      seen += 1;
    }
    return seen;
  }

  /** The standard deviation by the median, which half of the pixels cannot spoil. */
  #sigma(seen: number): number {
    const half = 0.5 * seen;
    let below = 0;
    let median = BINS / BINS_PER_UNIT;
    for (let k = 0; k < BINS; k += 1) {
      const here = this.#histogram[k] as number;
      if (below + here >= half) {
        median = (k + (half - below) / here) / BINS_PER_UNIT;
        break;
      }
      below += here;
    }
    return Math.max(1.4826 * median, MIN_SIGMA);
  }

  /** Gain and offset that make mean and spread of both pictures equal, to begin with. */
  #matchBrightness(count: number): void {
    const motion = this.motion;
    let n = 0;
    let sumT = 0;
    let sumTT = 0;
    let sumI = 0;
    let sumII = 0;
    for (let k = 0; k < count; k += 1) {
      const residual = this.#there[k] as number;
      if (residual >= OUTSIDE) continue;
      const t = this.#pyramid.chosen[NUMBERS * k + 3] as number;
      const i = residual + (motion[12] as number) * t + (motion[13] as number);
      n += 1;
      sumT += t;
      sumTT += t * t;
      sumI += i;
      sumII += i * i;
    }
    const meanT = sumT / n;
    const meanI = sumI / n;
    const spread = Math.max(Math.sqrt(Math.max(sumTT / n - meanT * meanT, 0)), 1e-3);
    const gain = clampGain(Math.sqrt(Math.max(sumII / n - meanI * meanI, 0)) / spread);
    motion[12] = gain;
    motion[13] = meanI - gain * meanT;
  }

  /** Gauss-Newton steps until they are small. */
  #descend(at: Level): void {
    const motion = this.motion;
    const hessian = this.#hessian;
    const rhs = this.#rhs;
    const step = this.step;
    for (let iteration = 0; iteration < ITERATIONS; iteration += 1) {
      const seen = this.#residuals(at, motion, this.#there);
      if (seen < MIN_PIXELS) {
        onlyPrior(this.information);
        step.fill(Infinity);
        return;
      }
      const gain = motion[12] as number;
      this.#normalEquations(at.count, this.#sigma(seen), gain);
      addPrior(hessian, 8);
      for (let a = 0; a < 3; a += 1) {
        rhs[a] = (rhs[a] as number) + (motion[9 + a] as number) / PRIOR_MOVE_M ** 2;
        const turn = 0.5 * ((motion[TURN_PLUS[a] as number] as number) - (motion[TURN_MINUS[a] as number] as number));
        rhs[3 + a] = (rhs[3 + a] as number) + turn / PRIOR_TURN_RAD ** 2;
      }
      hessian[54] = (hessian[54] as number) + 1 / GAIN_SD ** 2;
      hessian[63] = (hessian[63] as number) + 1 / OFFSET_SD ** 2;
      rhs[6] = (rhs[6] as number) + (1 - gain) / GAIN_SD ** 2;
      rhs[7] = (rhs[7] as number) - (motion[13] as number) / OFFSET_SD ** 2;
      this.#withoutBrightness();
      solvePositive(hessian, rhs, step, 8);
      this.#goBack();
      if (lengthOf(step, 0) < SMALL_MOVE_M && lengthOf(step, 3) < SMALL_TURN_RAD) return;
    }
  }

  /** Sums over the pixels; the last two rows are those of gain and offset. */
  #normalEquations(count: number, sigma: number, gain: number): void {
    const chosen = this.#pyramid.chosen;
    const residuals = this.#there;
    const perUnit = 1 / (CAUCHY * sigma);
    const scale = 1 / (CORRELATED * sigma * sigma);
    let h00 = 0, h10 = 0, h11 = 0, h20 = 0, h21 = 0, h22 = 0, h30 = 0, h31 = 0, h32 = 0, h33 = 0;
    let h40 = 0, h41 = 0, h42 = 0, h43 = 0, h44 = 0, h50 = 0, h51 = 0, h52 = 0, h53 = 0, h54 = 0, h55 = 0;
    let h60 = 0, h61 = 0, h62 = 0, h63 = 0, h64 = 0, h65 = 0, h66 = 0;
    let h70 = 0, h71 = 0, h72 = 0, h73 = 0, h74 = 0, h75 = 0, h76 = 0, h77 = 0;
    let b0 = 0, b1 = 0, b2 = 0, b3 = 0, b4 = 0, b5 = 0, b6 = 0, b7 = 0;
    for (let k = 0, c = 0; k < count; k += 1, c += NUMBERS) {
      const r = residuals[k] as number;
      if (r >= OUTSIDE) continue;
      const x = r * perUnit;
      const w = scale / (1 + x * x);
      const j0 = gain * (chosen[c + 4] as number);
      const j1 = gain * (chosen[c + 5] as number);
      const j2 = gain * (chosen[c + 6] as number);
      const j3 = gain * (chosen[c + 7] as number);
      const j4 = gain * (chosen[c + 8] as number);
      const j5 = gain * (chosen[c + 9] as number);
      const j6 = chosen[c + 3] as number;
      const w0 = w * j0, w1 = w * j1, w2 = w * j2, w3 = w * j3, w4 = w * j4, w5 = w * j5, w6 = w * j6;
      h00 += w0 * j0;
      h10 += w1 * j0; h11 += w1 * j1;
      h20 += w2 * j0; h21 += w2 * j1; h22 += w2 * j2;
      h30 += w3 * j0; h31 += w3 * j1; h32 += w3 * j2; h33 += w3 * j3;
      h40 += w4 * j0; h41 += w4 * j1; h42 += w4 * j2; h43 += w4 * j3; h44 += w4 * j4;
      h50 += w5 * j0; h51 += w5 * j1; h52 += w5 * j2; h53 += w5 * j3; h54 += w5 * j4; h55 += w5 * j5;
      h60 += w6 * j0; h61 += w6 * j1; h62 += w6 * j2; h63 += w6 * j3; h64 += w6 * j4; h65 += w6 * j5; h66 += w6 * j6;
      h70 += w0; h71 += w1; h72 += w2; h73 += w3; h74 += w4; h75 += w5; h76 += w6; h77 += w;
      b0 += w0 * r; b1 += w1 * r; b2 += w2 * r; b3 += w3 * r;
      b4 += w4 * r; b5 += w5 * r; b6 += w6 * r; b7 += w * r;
    }
    const sums = this.#sums;
    sums[0] = h00;
    sums[1] = h10; sums[2] = h11;
    sums[3] = h20; sums[4] = h21; sums[5] = h22;
    sums[6] = h30; sums[7] = h31; sums[8] = h32; sums[9] = h33;
    sums[10] = h40; sums[11] = h41; sums[12] = h42; sums[13] = h43; sums[14] = h44;
    sums[15] = h50; sums[16] = h51; sums[17] = h52; sums[18] = h53; sums[19] = h54; sums[20] = h55;
    sums[21] = h60; sums[22] = h61; sums[23] = h62; sums[24] = h63; sums[25] = h64; sums[26] = h65; sums[27] = h66;
    sums[28] = h70; sums[29] = h71; sums[30] = h72; sums[31] = h73;
    sums[32] = h74; sums[33] = h75; sums[34] = h76; sums[35] = h77;
    sums[36] = b0; sums[37] = b1; sums[38] = b2; sums[39] = b3;
    sums[40] = b4; sums[41] = b5; sums[42] = b6; sums[43] = b7;
    for (let a = 0, n = 0; a < 8; a += 1) {
      this.#rhs[a] = sums[36 + a] as number;
      for (let b = 0; b <= a; b += 1, n += 1) {
        this.#hessian[8 * a + b] = sums[n] as number;
        this.#hessian[8 * b + a] = sums[n] as number;
      }
    }
  }

  /** What is left when gain and offset are free: the Schur complement. */
  #withoutBrightness(): void {
    const h = this.#hessian;
    const a = h[54] as number;
    const b = h[55] as number;
    const c = h[63] as number;
    const det = a * c - b * b;
    for (let i = 0; i < 6; i += 1) {
      for (let j = 0; j < 6; j += 1) {
        const p = h[8 * i + 6] as number;
        const q = h[8 * i + 7] as number;
        const s = h[48 + j] as number;
        const t = h[56 + j] as number;
        this.information[6 * i + j] = (h[8 * i + j] as number)
          - (p * (c * s - b * t) + q * (a * t - b * s)) / det;
      }
    }
  }

  /** Takes the rendering's step back: `R ← R Eᵀ`, `t ← t - R Eᵀ step`, E of the turn. */
  #goBack(): void {
    const motion = this.motion;
    const step = this.step;
    const back = this.#back;
    const x = step[3] as number;
    const y = step[4] as number;
    const z = step[5] as number;
    const angle2 = x * x + y * y + z * z;
    const angle = Math.sqrt(angle2);
    const sine = angle > 1e-9 ? Math.sin(angle) / angle : 1;
    const cosine = angle > 1e-9 ? (1 - Math.cos(angle)) / angle2 : 0.5;
    back[0] = 1 - cosine * (y * y + z * z);
    back[1] = cosine * x * y + sine * z;
    back[2] = cosine * x * z - sine * y;
    back[3] = cosine * x * y - sine * z;
    back[4] = 1 - cosine * (x * x + z * z);
    back[5] = cosine * y * z + sine * x;
    back[6] = cosine * x * z + sine * y;
    back[7] = cosine * y * z - sine * x;
    back[8] = 1 - cosine * (x * x + y * y);
    for (let i = 0; i < 3; i += 1) {
      const a = motion[3 * i] as number;
      const b = motion[3 * i + 1] as number;
      const c = motion[3 * i + 2] as number;
      for (let j = 0; j < 3; j += 1) {
        const turned = a * (back[j] as number) + b * (back[3 + j] as number) + c * (back[6 + j] as number);
        motion[3 * i + j] = turned;
        motion[9 + i] = (motion[9 + i] as number) - turned * (step[j] as number);
      }
    }
    motion[12] = clampGain((motion[12] as number) + (step[6] as number));
    motion[13] = (motion[13] as number) + (step[7] as number);
  }

  /** The share that agrees, and the robust errors before and after; returns how many were compared. */
  #measure(at: Level): number {
    const there = this.#there;
    const here = this.#here;
    const seen = this.#residuals(at, this.motion, there);
    if (seen < MIN_PIXELS) return seen;
    const sigma = this.#sigma(seen);
    const given = this.#given;
    startMotion(given);
    given[12] = this.motion[12] as number;
    given[13] = this.motion[13] as number;
    for (let k = 0; k < 3; k += 1) {
      const before = this.#residuals(at, given, here);
      if (before < MIN_PIXELS) return before;
      this.#suitBrightness(at.count, this.#sigma(before));
    }
    this.#residuals(at, given, here);
    const allowed = AGREES * Math.min(sigma, MAX_AGREEING_SIGMA);
    const perUnit = 1 / (CAUCHY * sigma);
    let agreeing = 0;
    let both = 0;
    let sumW = 0, sumT = 0, sumI = 0, sumTT = 0, sumTI = 0, sumII = 0;
    let errorHere = 0;
    let errorThere = 0;
    for (let k = 0; k < at.count; k += 1) {
      const a = here[k] as number;
      const b = there[k] as number;
      if (b >= OUTSIDE) continue;
      if (Math.abs(b) <= allowed) agreeing += 1;
      const t = this.#pyramid.chosen[NUMBERS * k + 3] as number;
      const i = b + (this.motion[12] as number) * t + (this.motion[13] as number);
      const w = 1 / (1 + (b * perUnit) ** 2);
      sumW += w;
      sumT += w * t;
      sumI += w * i;
      sumTT += w * t * t;
      sumTI += w * t * i;
      sumII += w * i * i;
      if (a >= OUTSIDE) continue;
      both += 1;
      errorHere += Math.log1p((a * perUnit) ** 2);
      errorThere += Math.log1p((b * perUnit) ** 2);
    }
    if (both < MIN_PIXELS) return both;
    this.agreeing = agreeing / seen;
    const spread = (sumTT / sumW - (sumT / sumW) ** 2) * (sumII / sumW - (sumI / sumW) ** 2);
    const together = sumTI / sumW - (sumT / sumW) * (sumI / sumW);
    this.correlation = spread > 1e-12 ? together / Math.sqrt(spread) : 0;
    this.errorBefore = errorHere / both;
    this.errorAfter = errorThere / both;
    return seen;
  }

  /** One step to the gain and offset that suit the given pose best. */
  #suitBrightness(count: number, sigma: number): void {
    const given = this.#given;
    const perUnit = 1 / (CAUCHY * sigma);
    const scale = 1 / (CORRELATED * sigma * sigma);
    let a = 1 / GAIN_SD ** 2;
    let b = 0;
    let c = 1 / OFFSET_SD ** 2;
    let p = (1 - (given[12] as number)) * a;
    let q = -(given[13] as number) * c;
    for (let k = 0; k < count; k += 1) {
      const r = this.#here[k] as number;
      if (r >= OUTSIDE) continue;
      const x = r * perUnit;
      const w = scale / (1 + x * x);
      const t = this.#pyramid.chosen[NUMBERS * k + 3] as number;
      a += w * t * t;
      b += w * t;
      c += w;
      p += w * t * r;
      q += w * r;
    }
    const det = a * c - b * b;
    given[12] = clampGain((given[12] as number) + (c * p - b * q) / det);
    given[13] = (given[13] as number) + (a * q - b * p) / det;
  }
}

function clampGain(gain: number): number {
  return Math.min(Math.max(gain, MIN_GAIN), MAX_GAIN);
}
