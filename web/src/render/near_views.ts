/** The views that a frame is rendered from: chosen at every frame, so nothing is made here. */

import type { Camera } from '../geometry';
import type { GpuMpi, MpiStore } from '../mpi/mpi_store';
import { ViewWeights, type Among, type ChosenViews } from '../view_weights';
import { MAX_NEIGHBOURS, type Options } from '../wire';

/** Until a view is on the card, its scene is taken to be as deep as this. */
const USUAL_DEPTH_M = 1.5;

/** Best first; of each list the first `count` count. */
export class NearViews {
  count = 0;
  /** So many are chosen at most, whatever the options say. */
  most = Infinity;
  readonly mpis: GpuMpi[] = [];
  readonly weights = new Float64Array(MAX_NEIGHBOURS);
  /** The view that was taken nearest, whether it is here or not; null: there is none. */
  closest: string | null = null;
  /** As long as `count`. */
  readonly ids: string[] = [];

  readonly #chooser = new ViewWeights(MAX_NEIGHBOURS);
  /** Of all views: 1 where the MPI is on the card. */
  #here = new Uint8Array(16);
  #sceneDepth_m = USUAL_DEPTH_M;

  constructor(readonly options: Pick<Options, 'neighbours' | 'blend_weights'>) {}

  /** The K nearest of all views; while some of them are still on their way, the best that are here. */
  choose(store: MpiStore, camera: Camera): void {
    const { views, cameras } = store;
    this.count = 0;
    this.closest = null;
    if (views.length > 0) {
      this.#chooser.measure(cameras, camera);
      const closest = views[this.#chooser.closest];
      this.closest = closest?.id ?? null;
      const depth_m = closest === undefined ? undefined : store.want(closest.id)?.medianDepth_m;
      this.#sceneDepth_m = depth_m ?? this.#sceneDepth_m;
      const wanted = this.#best(null);
      this.#take(this.#allHere(store, wanted) ? wanted : this.#best(this.#residents(store)), store);
    }
    this.ids.length = this.count;
  }

  #best(among: Among): ChosenViews {
    const { neighbours, blend_weights } = this.options;
    const count = Math.min(neighbours, this.most);
    return blend_weights === 'paper' ? this.#chooser.byDistance(count, among)
      : this.#chooser.byOverlap(this.#sceneDepth_m, count, among);
  }

  /** Asks for each; false while one is not on the card. */
  #allHere(store: MpiStore, { count, index }: ChosenViews): boolean {
    let all = true;
    for (let k = 0; k < count; k += 1) {
      const view = store.views[index[k] ?? -1];
      if (view === undefined || store.want(view.id) === null) all = false;
    }
    return all;
  }

  #residents(store: MpiStore): Uint8Array {
    const { views } = store;
    if (this.#here.length < views.length) this.#here = new Uint8Array(2 * views.length);
    for (let i = 0; i < views.length; i += 1) {
      this.#here[i] = store.resident(views[i]?.id ?? '') === null ? 0 : 1;
    }
    return this.#here;
  }

  #take({ count, index, weight }: ChosenViews, store: MpiStore): void {
    for (let k = 0; k < count; k += 1) {
      const view = store.views[index[k] ?? -1];
      const mpi = view === undefined ? null : store.resident(view.id);
      if (view === undefined || mpi === null) continue;
      this.ids[this.count] = view.id;
      this.mpis[this.count] = mpi;
      this.weights[this.count] = weight[k] ?? 0;
      this.count += 1;
    }
  }
}
