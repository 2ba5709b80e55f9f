/** What the view of a light field is rendered into, and what of it need not be computed again. */

import type { GpuMpi } from '../mpi/mpi_store';
import { MAX_NEIGHBOURS } from '../wire';
import { blocksOf } from './hole_filling';
import { MaskedTarget, ReadBack, Target } from './target';

/** A picture of one MPI. */
export interface RenderedView {
  readonly target: Target;
  /** Null: nothing that is still worth anything. */
  mpi: GpuMpi | null;
}

export class ViewTargets implements Disposable {
  readonly views: readonly RenderedView[];
  readonly view: Target;
  /** What one of the views that fill shows where the picture is still empty. */
  readonly filling: MaskedTarget;
  /** The views that fill what the blended ones leave empty, in the order in which they go under it. */
  readonly filledFrom: (GpuMpi | null)[];
  /** Mean opacity of the blocks of what is blended, before it is filled. */
  readonly opacity: Target;
  readonly opacityBack: ReadBack;
  /** What `view` was blended from, and how much of each. */
  readonly blendedFrom: (Target | null)[];
  readonly weights: Float32Array;
  /** What is empty was asked for at least once. */
  asked = false;

  /** @param count Views that are blended. @param filling Views that fill. */
  constructor(
    gl: WebGL2RenderingContext, readonly width: number, readonly height: number, count: number,
    filling: number,
  ) {
    this.filling = new MaskedTarget(gl, width, height);
    this.filledFrom = Array.from({ length: filling }, () => null);
    const blocks = blocksOf(width, height);
    this.opacity = new Target(gl, blocks.cols, blocks.rows);
    this.opacityBack = new ReadBack(gl, this.opacity);
    this.views = Array.from({ length: count }, () => ({ target: new Target(gl, width, height), mpi: null }));
    this.view = new Target(gl, width, height);
    this.blendedFrom = Array.from({ length: MAX_NEIGHBOURS }, () => null);
    this.weights = new Float32Array(MAX_NEIGHBOURS);
  }

  [Symbol.dispose](): void {
    this.opacityBack[Symbol.dispose]();
    for (const { target } of this.views) target[Symbol.dispose]();
    for (const target of [this.view, this.filling, this.opacity]) target[Symbol.dispose]();
  }
}
