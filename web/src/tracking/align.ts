/**
 * Where a live picture was taken from, by what the rendering for about there shows: the twin of
 * `src/peaking/tracking/`, whose `solution.py` explains the constants. Runs in a worker.
 *
 * Rows may go up or down: where the first row is the bottom one, `fy` is negative and `cy` counted
 * from the bottom.
 */

import {
  MAX_LAST_MOVE_M, MAX_LAST_TURN_RAD, MAX_MOVE_M, MAX_TURN_RAD, MIN_AGREEING, MIN_CORRELATION, MIN_LEARNED, MIN_PIXELS, SAME_ERROR,
} from './align_constants';
import { Descent } from './descent';
import { lengthOf, onlyPrior, priorSd, solvePositive, startMotion, turnOf } from './motions';
import type { AlignInput } from './pyramid';

export type { AlignInput, AlignLens } from './pyramid';

/** Why a pose was not corrected; Python's `Failure` explains them. */
export type AlignFailure =
  'too-few-pixels' | 'too-far' | 'not-converged' | 'too-different' | 'undetermined' | 'no-better';

/** Written anew by each alignment. */
export interface Alignment {
  /** Null: the camera was corrected. */
  failure: AlignFailure | null;
  /** `[R | t]` row by row: from the rendering's camera into the live picture's. */
  readonly liveFromCam: Float64Array;
  /** Standard deviations along the camera's axes. */
  readonly moveSd_m: Float64Array;
  /** About them. */
  readonly turnSd_rad: Float64Array;
  /** Share of the compared pixels whose brightness agrees, 0…1. */
  agreeing: number;
  numPixels: number;
  moved_m: number;
  turned_rad: number;
}

export class Aligner {
  readonly result: Alignment = {
    failure: null,
    liveFromCam: Float64Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0),
    moveSd_m: new Float64Array(3),
    turnSd_rad: new Float64Array(3),
    agreeing: 0, numPixels: 0, moved_m: 0, turned_rad: 0,
  };

  readonly #descent = new Descent();
  readonly #column = new Float64Array(6);
  readonly #factor = new Float64Array(36);
  readonly #known = new Float64Array(6);

  /** @returns The same object every time. */
  align(input: AlignInput): Alignment {
    return this.#judge(this.#descent.search(input));
  }

  /** Believe what was found, or say why not. */
  #judge(numPixels: number): Alignment {
    const { result } = this;
    const motion = this.#descent.motion;
    result.numPixels = numPixels;
    result.agreeing = this.#descent.agreeing;
    result.moved_m = lengthOf(motion, 9);
    result.turned_rad = turnOf(motion);
    result.failure = this.#failure(numPixels);
    if (result.failure !== null) {
      startMotion(motion);
      onlyPrior(this.#descent.information);
      result.moved_m = 0;
      result.turned_rad = 0;
    }
    for (let r = 0; r < 3; r += 1) {
      for (let c = 0; c < 3; c += 1) result.liveFromCam[4 * r + c] = motion[3 * r + c] as number;
      result.liveFromCam[4 * r + 3] = motion[9 + r] as number;
    }
    for (let k = 0; k < 6; k += 1) {
      this.#column.fill(0);
      this.#column[k] = 1;
      this.#factor.set(this.#descent.information);
      solvePositive(this.#factor, this.#column, this.#known, 6);
      (k < 3 ? result.moveSd_m : result.turnSd_rad)[k % 3] = Math.sqrt(this.#known[k] as number);
    }
    return result;
  }

  #failure(numPixels: number): AlignFailure | null {
    const { moved_m, turned_rad, agreeing } = this.result;
    if (numPixels < MIN_PIXELS) return 'too-few-pixels';
    if (!(moved_m <= MAX_MOVE_M && turned_rad <= MAX_TURN_RAD)) return 'too-far';
    const still = lengthOf(this.#descent.step, 0) <= MAX_LAST_MOVE_M
      && lengthOf(this.#descent.step, 3) <= MAX_LAST_TURN_RAD;
    if (!still) return 'not-converged';
    if (agreeing < MIN_AGREEING || this.#descent.correlation < MIN_CORRELATION) return 'too-different';
    if (this.#leastKnown() > MIN_LEARNED) return 'undetermined';
    return this.#descent.errorAfter <= SAME_ERROR * this.#descent.errorBefore + 1e-9 ? null : 'no-better';
  }

  /** How well the best known direction is known, over the prior: by the largest eigenvalue. */
  #leastKnown(): number {
    const v = this.#column.fill(1);
    const next = this.#known;
    let largest = 0;
    for (let round = 0; round < 40; round += 1) {
      for (let i = 0; i < 6; i += 1) {
        let sum = 0;
        for (let j = 0; j < 6; j += 1) {
          sum += (this.#descent.information[6 * i + j] as number) * priorSd(i) * priorSd(j) * (v[j] as number);
        }
        next[i] = sum;
      }
      let length = 0;
      for (let i = 0; i < 6; i += 1) length += (next[i] as number) ** 2;
      largest = Math.sqrt(length);
      for (let i = 0; i < 6; i += 1) v[i] = (next[i] as number) / largest;
    }
    return Math.sqrt(1 / largest);
  }
}
