/** What is rendered for one view, and what of it need not be computed again. */

import type { GpuMpi } from '../mpi/mpi_store';
import { MAX_NEIGHBOURS } from '../wire';
import { GAIN_STRIDE } from './exposure';
import { blocksOf } from './hole_filling';
import { Settled } from './settled';
import { MaskedTarget, ReadBack, Target } from './target';

/** The result is counted in so many blocks, twice: two kinds of marks at a time. */
export const BLOCKS = { x: 16, y: 16 };

/** A picture of one MPI. */
export interface RenderedView {
  readonly target: Target;
  /** Null: nothing that is still worth anything. */
  mpi: GpuMpi | null;
}

/** Everything of the size of the view. */
export class Targets implements Disposable {
  readonly live: Target;
  readonly views: readonly RenderedView[];
  readonly view: Target;
  /** What one of the views that fill shows where the picture is still empty. */
  readonly filling: MaskedTarget;
  /** The views that fill what the blended ones leave empty, in the order in which they go under it. */
  readonly filledFrom: (GpuMpi | null)[];
  /** Mean opacity of the blocks of what is blended, before it is filled. */
  readonly opacity: Target;
  readonly opacityBack: ReadBack;
  readonly result: Target;
  readonly counts: Target;
  readonly countsBack: ReadBack;
  readonly grid: Target;
  readonly gridBack: ReadBack;
  shown: Settled;
  shownBefore: Settled;
  /** The live picture that `live` is of. */
  pictureId: number | null = null;
  /** What `view` was blended from, and how much of each. */
  readonly blendedFrom: (Target | null)[];
  readonly weights: Float32Array;
  /** What `result` was compared with; not a number: something else is new. */
  threshold = NaN;
  /** `result` is newer than what was counted. */
  uncounted = false;
  /** The view or the live picture is newer than the measured exposure. */
  unmeasured = false;
  /** What is empty was asked for at least once. */
  asked = false;

  constructor(
    gl: WebGL2RenderingContext, width: number, height: number, count: number, filling: number,
  ) {
    const ofView = (): Target => new Target(gl, width, height);
    this.filling = new MaskedTarget(gl, width, height);
    this.filledFrom = Array.from({ length: filling }, () => null);
    const blocks = blocksOf(width, height);
    this.opacity = new Target(gl, blocks.cols, blocks.rows);
    this.opacityBack = new ReadBack(gl, this.opacity);
    this.live = ofView();
    this.views = Array.from({ length: count }, () => ({ target: ofView(), mpi: null }));
    this.view = ofView();
    this.result = ofView();
    this.shown = new Settled(gl, width, height);
    this.shownBefore = new Settled(gl, width, height);
    this.blendedFrom = Array.from({ length: MAX_NEIGHBOURS }, () => null);
    this.weights = new Float32Array(MAX_NEIGHBOURS);
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

  [Symbol.dispose](): void {
    this.countsBack[Symbol.dispose]();
    this.opacityBack[Symbol.dispose]();
    this.gridBack[Symbol.dispose]();
    for (const { target } of this.views) target[Symbol.dispose]();
    for (const target of [
      this.live, this.view, this.filling, this.opacity, this.result, this.counts, this.grid, this.shown, this.shownBefore,
    ]) target[Symbol.dispose]();
  }
}
