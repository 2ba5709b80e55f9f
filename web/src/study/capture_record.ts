/** What is recorded of a capture: an observer of the capture page, which changes nothing there. */

import type { CapturedView } from '../capture/capture_session';
import type { Camera } from '../geometry';
import type { MilestoneTimes } from '../timeline';
import type { Told } from './wire';

const SAMPLE_EVERY_S = 1;
/** Tracking that is lost for less is not felt, and is not counted. */
const LOST_AFTER_S = 0.25;

/** One frame. The object may be used again for the next. */
export interface Moment {
  /** Seconds since 1970. */
  now_s: number;
  canShoot: boolean;
  camera: Camera | null;
  peakedShare: number | null;
  wrongShare: number | null;
  unseenShare: number | null;
  unfixableShare: number | null;
  views: number;
}

export interface CaptureRecordOptions {
  readonly step: string;
  /** Id of the capture session. */
  readonly session: string;
  readonly put: (event: Told) => void;
  /** Views that were there when the page was opened: an earlier page recorded them. */
  readonly before: readonly string[];
  /** When an earlier page of the same step was last alive; null when there was none. */
  readonly gone_s: number | null;
  readonly newId?: () => string;
}

/**
 * One capture step, on one page. What happens once has an id that follows from it, so that it is
 * kept once when it is told again after a reload.
 */
export class CaptureRecord {
  readonly #options: CaptureRecordOptions;
  readonly #taken: Set<string>;
  readonly #joined = new Set<string>();
  #begun = false;
  #ended = false;
  #lostSince_s: number | null = null;
  #lostTold = false;
  #sampled_s = -Infinity;

  constructor(options: CaptureRecordOptions) {
    this.#options = options;
    this.#taken = new Set(options.before);
  }

  get running(): boolean {
    return this.#begun && !this.#ended;
  }

  /** For every frame. */
  see(moment: Readonly<Moment>): void {
    if (this.#ended) return;
    if (!this.#begun) {
      if (!moment.canShoot) return;
      this.#begun = true;
      const { gone_s, session } = this.#options;
      if (gone_s === null) this.#put('CaptureBegun', `${session}-begun`, moment.now_s);
      else this.#tell('PageGone', gone_s, { until_s: moment.now_s });
    }
    this.#tracking(moment);
    if (moment.peakedShare === null || moment.camera === null) return;
    const since_s = moment.now_s - this.#sampled_s;
    if (since_s >= 0 && since_s < SAMPLE_EVERY_S) return;
    this.#sampled_s = moment.now_s;
    this.#tell('PeakedTold', moment.now_s, {
      peaked_share: moment.peakedShare,
      wrong_share: moment.wrongShare,
      unseen_share: moment.unseenShare,
      unfixable_share: moment.unfixableShare,
      views: moment.views,
      world_from_cam: Array.from(moment.camera.worldFromCam.rows),
    });
  }

  /** For every change of the views. */
  follow(views: readonly CapturedView[], now_s: number): void {
    if (this.#ended) return;
    const present = new Set(views.map((view) => view.id));
    for (const view of views) {
      if (this.#taken.has(view.id)) continue;
      this.#taken.add(view.id);
      this.#put('ViewTaken', `${view.id}-taken`, view.time_s, {
        capture: view.id, world_from_cam: view.camera.world_from_cam,
      });
    }
    for (const id of this.#taken) {
      if (present.has(id)) continue;
      this.#taken.delete(id);
      this.#put('ViewUndone', `${id}-undone`, now_s, { capture: id });
    }
  }

  /** When views joined the picture. @param origin_s Seconds since 1970 at which `times` are 0. */
  joined(
    captures: readonly { readonly id: string; readonly times: MilestoneTimes }[], origin_s: number,
  ): void {
    const at = (ms: number | undefined): number | null =>
      ms === undefined ? null : origin_s + ms / 1000;
    for (const { id, times } of captures) {
      const drawn_s = at(times.drawn);
      if (drawn_s === null || this.#joined.has(id) || this.#ended) continue;
      this.#joined.add(id);
      this.#put('ViewJoined', `${id}-joined`, drawn_s, {
        capture: id, acknowledged_s: at(times.acknowledged), generated_s: at(times.ready),
      });
    }
  }

  end(now_s: number): void {
    if (this.#ended) return;
    this.#ended = true;
    this.#put('CaptureEnded', `${this.#options.session}-ended`, now_s);
  }

  #tracking(moment: Readonly<Moment>): void {
    if (moment.camera !== null) {
      if (this.#lostTold) this.#tell('TrackingFound', moment.now_s);
      this.#lostSince_s = null;
      this.#lostTold = false;
      return;
    }
    this.#lostSince_s ??= moment.now_s;
    if (!this.#lostTold && moment.now_s - this.#lostSince_s >= LOST_AFTER_S) {
      this.#lostTold = true;
      this.#tell('TrackingLost', this.#lostSince_s);
    }
  }

  #tell(kind: Told['kind'], time_s: number, more: Partial<Told> = {}): void {
    this.#put(kind, this.#options.newId?.() ?? crypto.randomUUID(), time_s, more);
  }

  #put(kind: Told['kind'], id: string, time_s: number, more: Partial<Told> = {}): void {
    this.#options.put({ kind, id, step: this.#options.step, time_s, ...more });
  }
}
