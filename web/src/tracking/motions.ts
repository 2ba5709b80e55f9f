/** Motions as they are searched for: R row by row, t, gain, offset; and small matrices. */

import { PRIOR_MOVE_M, PRIOR_TURN_RAD } from './align_constants';

export function startMotion(motion: Float64Array): void {
  motion.fill(0);
  motion[0] = 1;
  motion[4] = 1;
  motion[8] = 1;
  motion[12] = 1;
}

export function priorSd(axis: number): number {
  return axis < 3 ? PRIOR_MOVE_M : PRIOR_TURN_RAD;
}

export function addPrior(matrix: Float64Array, size: number): void {
  for (let a = 0; a < 6; a += 1) {
    matrix[(size + 1) * a] = (matrix[(size + 1) * a] as number) + 1 / priorSd(a) ** 2;
  }
}

/** Nothing is known but what the device says. */
export function onlyPrior(information: Float64Array): void {
  information.fill(0);
  addPrior(information, 6);
}

export function lengthOf(values: Float64Array, start: number): number {
  return Math.hypot(values[start] as number, values[start + 1] as number, values[start + 2] as number);
}

/** The angle of the rotation, by the sine of its half, which is exact for small ones too. */
export function turnOf(motion: Float64Array): number {
  let sum = 0;
  for (let k = 0; k < 9; k += 1) sum += ((motion[k] as number) - (k % 4 === 0 ? 1 : 0)) ** 2;
  return 2 * Math.asin(Math.min(Math.sqrt(sum / 8), 1));
}

/** Cholesky, in place. */
export function solvePositive(matrix: Float64Array, rhs: Float64Array, out: Float64Array, n: number): void {
  for (let i = 0; i < n; i += 1) {
    for (let j = 0; j <= i; j += 1) {
      let left = matrix[n * i + j] as number;
      for (let k = 0; k < j; k += 1) left -= (matrix[n * i + k] as number) * (matrix[n * j + k] as number);
      matrix[n * i + j] = i === j ? Math.sqrt(Math.max(left, 1e-300)) : left / (matrix[n * j + j] as number);
    }
  }
  for (let i = 0; i < n; i += 1) {
    let left = rhs[i] as number;
    for (let k = 0; k < i; k += 1) left -= (matrix[n * i + k] as number) * (out[k] as number);
    out[i] = left / (matrix[n * i + i] as number);
  }
  for (let i = n - 1; i >= 0; i -= 1) {
    let left = out[i] as number;
    for (let k = i + 1; k < n; k += 1) left -= (matrix[n * k + i] as number) * (out[k] as number);
    out[i] = left / (matrix[n * i + i] as number);
  }
}
