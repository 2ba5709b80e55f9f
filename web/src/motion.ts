/** How fast the camera moves; pictures taken in haste are blurred, and their poses lag. */

import { angleBetween, distanceBetween, identity, type Cam, type Camera, type World } from './geometry';

/** At 1 m and a focal length of 1000 px this is 0.8 px for every millisecond of exposure. */
export const TOO_FAST_M_PER_S = 0.8;
export const TOO_FAST_RAD_PER_S = 1.2;

/** A third of it: what is taken without a finger on the button can wait for a steadier moment. */
export const STEADY_M_PER_S = 0.27;
export const STEADY_RAD_PER_S = 0.4;

/** Speeds are smoothed over about this long, so that one jump of the tracking is no alarm. */
const SMOOTHING_MS = 150;

export class Motion {
  /** Of the frame before. */
  readonly #last = identity<World, Cam>();
  #last_ms: number | null = null;
  #speed_m_per_s = 0;
  #turn_rad_per_s = 0;

  /** Tell where the camera is; null when nobody knows. */
  update(time_ms: number, camera: Camera | null): void {
    if (camera === null) {
      this.#last_ms = null;
      this.#speed_m_per_s = 0;
      this.#turn_rad_per_s = 0;
      return;
    }
    const { worldFromCam } = camera;
    if (this.#last_ms !== null && time_ms > this.#last_ms) {
      const step_ms = time_ms - this.#last_ms;
      const keep = Math.exp(-step_ms / SMOOTHING_MS);
      const speed = (distanceBetween(this.#last, worldFromCam) / step_ms) * 1000;
      const turn = (angleBetween(this.#last, worldFromCam) / step_ms) * 1000;
      this.#speed_m_per_s = keep * this.#speed_m_per_s + (1 - keep) * speed;
      this.#turn_rad_per_s = keep * this.#turn_rad_per_s + (1 - keep) * turn;
    }
    this.#last.rows.set(worldFromCam.rows);
    this.#last_ms = time_ms;
  }

  get steady(): boolean {
    return this.#last_ms !== null
      && this.#speed_m_per_s <= STEADY_M_PER_S && this.#turn_rad_per_s <= STEADY_RAD_PER_S;
  }

  get tooFast(): boolean {
    return this.#speed_m_per_s > TOO_FAST_M_PER_S || this.#turn_rad_per_s > TOO_FAST_RAD_PER_S;
  }
}
