/** What is wrong with a picture that a photographer would not want to keep. */

import { angleBetween, distanceBetween, type Cam, type Rigid, type World } from '../geometry';
import type { PictureQuality } from './picture_quality';

export type PictureFault = 'blurred' | 'too-dark' | 'too-bright';

/**
 * Less than this part of the sharpness of others from there. Of a hand-held recording 9 of 100 frames
 * have less as they are, 68 of 100 when blurred by 4 px in 640, 98 of 100 when blurred by 7 px.
 */
export const BLURRED = 0.6;
/** Others from there: so near, and turned by so little. */
export const NEAR_M = 0.3;
export const NEAR_RAD = 0.2;
/** With fewer to compare with, nothing is called blurred. */
export const AT_LEAST = 3;
/** How many are remembered. */
export const REMEMBERED = 24;
/** Mean grey value, 0…255, below which sensors show more noise than texture. */
export const DARK_GREY = 28;
/** Share of the picture that is white, and shows nothing. */
export const BURNT_OUT = 0.4;

export class PictureGate {
  readonly #sharpness = new Float64Array(REMEMBERED);
  readonly #poses: Rigid<World, Cam>[] = [];
  #next = 0;

  /** Remember a picture, and say what is wrong with it. */
  judge(quality: PictureQuality, worldFromCam: Rigid<World, Cam>): PictureFault | null {
    const fault = this.#faultOf(quality, worldFromCam);
    this.#sharpness[this.#next] = quality.sharpness;
    this.#poses[this.#next] = worldFromCam;
    this.#next = (this.#next + 1) % REMEMBERED;
    return fault;
  }

  #faultOf({ sharpness, grey, burntOut }: PictureQuality, pose: Rigid<World, Cam>): PictureFault | null {
    if (grey < DARK_GREY) return 'too-dark';
    if (burntOut > BURNT_OUT) return 'too-bright';
    const others: number[] = [];
    this.#poses.forEach((each, k) => {
      if (distanceBetween(each, pose) > NEAR_M || angleBetween(each, pose) > NEAR_RAD) return;
      others.push(this.#sharpness[k] as number);
    });
    if (others.length < AT_LEAST) return null;
    others.sort((a, b) => a - b);
    // The sharper half tells what there is to see; who always moves has few of these.
    const usual = others[Math.floor(0.75 * (others.length - 1))] as number;
    return sharpness < BLURRED * usual ? 'blurred' : null;
  }
}
