/**
 * Where the device's world lies in the session's. A device that finds itself again may give its world
 * another origin (WebXR's `reset`); what was captured before stays where it was, and poses follow.
 */

import { composeInto, identity, type Cam, type Rigid, type World } from '../geometry';
import type { WorldResets } from './frame_source';

export class WorldOrigin {
  readonly resets: { -readonly [K in keyof WorldResets]: WorldResets[K] } = { followed: 0, lost: 0 };

  /** The session's world from the device's. */
  readonly #sessionFromDevice = identity<World, World>();
  readonly #before = identity<World, World>();
  readonly #given = identity<World, World>();
  readonly #pose = identity<World, Cam>();

  /**
   * @param matrix Of the event, column-major: the pose of the new origin in the world as it was before;
   *   null where the device does not know.
   */
  reset(matrix: ArrayLike<number> | null): void {
    if (matrix === null) {
      this.resets.lost += 1;
      return;
    }
    this.resets.followed += 1;
    this.#before.rows.set(this.#sessionFromDevice.rows);
    for (let r = 0; r < 3; r += 1) {
      for (let c = 0; c < 4; c += 1) this.#given.rows[4 * r + c] = matrix[4 * c + r] ?? NaN;
    }
    composeInto(this.#before, this.#given, this.#sessionFromDevice);
  }

  /** Takes a pose of the device to the session's world, in place. */
  follow(worldFromCam: Rigid<World, Cam>): void {
    if (this.resets.followed === 0) return;
    this.#pose.rows.set(worldFromCam.rows);
    composeInto(this.#sessionFromDevice, this.#pose, worldFromCam);
  }
}
