/** How sharp a picture is, and how it is exposed: the measures of src/peaking/selection/blur.py. */

export interface PictureQuality {
  /** Fine gradients over coarse ones, in the direction where that is least; compare pictures of the same place. */
  readonly sharpness: number;
  /** Mean grey value, 0…255. */
  readonly grey: number;
  /** Share of pixels in which all channels are at their limit, 0…1. */
  readonly burntOut: number;
}

/** Standard deviation of the Gaussian that parts fine structure from coarse. */
const FINE_PX = 1.5;
const RADIUS_PX = 6;
const DIRECTIONS = 4;
const BURNT_OUT = 250;

/** Measures pictures; what it needs to work in is made once for each size. */
export class PictureMeter {
  readonly #kernel = gaussian();
  #grey = new Float32Array(0);
  #rows = new Float32Array(0);
  #coarse = new Float32Array(0);

  /** @param rgba Alpha is ignored; which row comes first does not matter. */
  measure(rgba: Uint8Array, width: number, height: number): PictureQuality {
    const pixels = width * height;
    if (this.#grey.length !== pixels) {
      this.#grey = new Float32Array(pixels);
      this.#rows = new Float32Array(pixels);
      this.#coarse = new Float32Array(pixels);
    }
    const grey = this.#grey;
    let sum = 0;
    let burntOut = 0;
    for (let k = 0, c = 0; k < pixels; k += 1, c += 4) {
      const r = rgba[c] as number;
      const g = rgba[c + 1] as number;
      const b = rgba[c + 2] as number;
      grey[k] = 0.299 * r + 0.587 * g + 0.114 * b;
      sum += grey[k] as number;
      if (r >= BURNT_OUT && g >= BURNT_OUT && b >= BURNT_OUT) burntOut += 1;
    }
    blurred(grey, this.#rows, width, height, 1, width, this.#kernel);
    blurred(this.#rows, this.#coarse, height, width, width, 1, this.#kernel);
    const coarse = energies(this.#coarse, width, height);
    for (let k = 0; k < pixels; k += 1) grey[k] = (grey[k] as number) - (this.#coarse[k] as number);
    const fine = energies(grey, width, height);
    let sharpness = Infinity;
    for (let d = 0; d < DIRECTIONS; d += 1) {
      const ratio = Math.sqrt(fine[d] as number) / (Math.sqrt(coarse[d] as number) + 1);
      sharpness = Math.min(sharpness, ratio);
    }
    return { sharpness, grey: sum / pixels, burntOut: burntOut / pixels };
  }
}

function gaussian(): Float32Array {
  const kernel = new Float32Array(2 * RADIUS_PX + 1);
  let sum = 0;
  for (let k = -RADIUS_PX; k <= RADIUS_PX; k += 1) {
    const value = Math.exp(-(k * k) / (2 * FINE_PX * FINE_PX));
    kernel[k + RADIUS_PX] = value;
    sum += value;
  }
  return kernel.map((value) => value / sum);
}

/** Blur `lines` lines of `length` pixels, mirrored at their ends. */
function blurred(
  from: Float32Array, to: Float32Array, length: number, lines: number, step: number, lineStep: number,
  kernel: Float32Array,
): void {
  for (let line = 0; line < lines; line += 1) {
    const start = line * lineStep;
    for (let i = 0; i < length; i += 1) {
      let sum = 0;
      for (let k = -RADIUS_PX; k <= RADIUS_PX; k += 1) {
        sum += (kernel[k + RADIUS_PX] as number) * (from[start + step * mirrored(i + k, length)] as number);
      }
      to[start + step * i] = sum;
    }
  }
}

function mirrored(i: number, length: number): number {
  if (length === 1) return 0;
  const period = 2 * (length - 1);
  const within = ((i % period) + period) % period;
  return within < length ? within : period - within;
}

/** Mean squared derivatives along some directions. */
function energies(picture: Float32Array, width: number, height: number): Float64Array {
  let xx = 0;
  let xy = 0;
  let yy = 0;
  for (let y = 0; y < height; y += 1) {
    const above = width * mirrored(y - 1, height);
    const here = width * y;
    const below = width * mirrored(y + 1, height);
    for (let x = 0; x < width; x += 1) {
      const left = mirrored(x - 1, width);
      const right = mirrored(x + 1, width);
      const at = (row: number, column: number): number => picture[row + column] as number;
      const dx = at(above, right) - at(above, left) + at(below, right) - at(below, left)
        + 2 * (at(here, right) - at(here, left));
      const dy = at(below, left) - at(above, left) + at(below, right) - at(above, right)
        + 2 * (at(below, x) - at(above, x));
      xx += dx * dx;
      xy += dx * dy;
      yy += dy * dy;
    }
  }
  const pixels = width * height;
  return Float64Array.from({ length: DIRECTIONS }, (_, d) => {
    const c = Math.cos((Math.PI * d) / DIRECTIONS);
    const s = Math.sin((Math.PI * d) / DIRECTIONS);
    return Math.max((c * c * xx + 2 * c * s * xy + s * s * yy) / pixels, 0);
  });
}
