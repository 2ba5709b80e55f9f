/** What is rendered and compared for one frame, and what of it need not be computed again. */

import { GAIN_STRIDE } from './exposure';
import { Settled } from './settled';
import { ReadBack, Target } from './target';
import { ViewTargets } from './view_targets';

/** The result is counted in so many blocks, twice: two kinds of marks at a time. */
export const BLOCKS = { x: 16, y: 16 };

/** Everything of the size of the view. */
export class Targets extends ViewTargets {
  readonly live: Target;
  readonly result: Target;
  readonly counts: Target;
  readonly countsBack: ReadBack;
  readonly grid: Target;
  readonly gridBack: ReadBack;
  shown: Settled;
  shownBefore: Settled;
  /** The live picture that `live` is of. */
  pictureId: number | null = null;
  /** What `result` was compared with; not a number: something else is new. */
  threshold = NaN;
  /** `result` is newer than what was counted. */
  uncounted = false;
  /** The view or the live picture is newer than the measured exposure. */
  unmeasured = false;

  constructor(
    gl: WebGL2RenderingContext, width: number, height: number, count: number, filling: number,
  ) {
    super(gl, width, height, count, filling);
    this.live = new Target(gl, width, height);
    this.result = new Target(gl, width, height);
    this.shown = new Settled(gl, width, height);
    this.shownBefore = new Settled(gl, width, height);
    this.counts = new Target(gl, BLOCKS.x, 2 * BLOCKS.y);
    this.countsBack = new ReadBack(gl, this.counts);
    this.grid = new Target(
      gl, Math.ceil(width / GAIN_STRIDE), 2 * Math.ceil(height / GAIN_STRIDE));
    this.gridBack = new ReadBack(gl, this.grid);
  }

  /** Show what others of another size show, so that no mark flashes when the size changes. */
  goOnFrom({ shown }: Targets): void {
    this.shown.goOnFrom(shown);
  }

  swapShown(): void {
    const { shown } = this;
    this.shown = this.shownBefore;
    this.shownBefore = shown;
  }

  override [Symbol.dispose](): void {
    super[Symbol.dispose]();
    this.countsBack[Symbol.dispose]();
    this.gridBack[Symbol.dispose]();
    for (const target of [
      this.live, this.result, this.counts, this.grid, this.shown, this.shownBefore,
    ]) target[Symbol.dispose]();
  }
}
