/**
 * What the views have seen of what the device measures now: which surface no view has seen, and which
 * stands where views looked through, so that no view will help. The client's part of
 * src/peaking/memory/; in place of its cells the client has what it renders.
 *
 *     MPI ── store ──► depth maps ──┐
 *     live depth ───────────────────┴ ask ── tell ──► never seen, no view will help
 *                             result of the frame before ┘    └─ places ──► where else it is wrong
 */

import { rigid, type Camera, type Vector3 } from '../geometry';
import type { MpiStore } from '../mpi/mpi_store';
import { AlignPictures } from '../render/align_pictures';
import { LEVELS } from '../render/governor';
import { Program } from '../render/program';
import screenVertex from '../render/screen.vert.glsl?raw';
import { ReadBack, Target } from '../render/target';
import type { Targets } from '../render/targets';
import type { Remembered } from '../render/view_renderer';
import type { DepthMap, LiveFrame } from '../sources/frame_source';
import { ViewWeights } from '../view_weights';
import askFragment from './ask.frag.glsl?raw';
import { DepthMaps, MAX_ASKED, writeInner } from './depth_maps';
import placesFragment from './places.frag.glsl?raw';
import tellFragment from './tell.frag.glsl?raw';
import { WrongPlaces, type LookedAt } from './wrong_places';

/** Pictures are so many times smaller than what is rendered, per axis. */
const COARSER = 2;
/** What is told depends on what was compared when it was told before. */
const ROUNDS = 2;
/** A picture's long and short side are cut into so many parts to remember where it is wrong. */
const PARTS = { long: 32, short: 18 } as const;
/** Before depth has a median. */
const USUAL_DEPTH_M = 1.5;

/** How wrong the parts of the picture are. */
interface Parts extends LookedAt {
  readonly target: Target;
  readonly back: ReadBack;
}

export class Memory implements Disposable {
  /** Reading depth costs a copy, and what was never seen does not flicker: asked after so many frames. */
  everyFrames = LEVELS[0].rememberEvery;
  readonly #gl: WebGL2RenderingContext;
  readonly #maps: DepthMaps;
  readonly #ask: Program;
  readonly #tell: Program;
  readonly #screen: WebGLVertexArrayObject;
  readonly #sampler: WebGLSampler;
  readonly #live: WebGLTexture;
  readonly #places: Program;
  readonly #wrong = new WrongPlaces();
  readonly #chooser = new ViewWeights(MAX_ASKED);
  readonly #inner = new Float32Array(4);
  #remembered: { texture: WebGLTexture; number: number } | null = null;
  #answers: Target | null = null;
  #said: Target | null = null;
  #parts: Parts | null = null;
  /** Where what is on its way back was looked from. */
  #lookedFrom: Camera | null = null;
  #held = new Uint8Array(16);
  #views: MpiStore['views'] = [];
  #depth_m = USUAL_DEPTH_M;
  #hasDepth = false;
  #frame = 0;
  #worldsLost = 0;
  #pictureId: number | null = null;
  /** How often something is still to be told of what is known now. */
  #due = 0;
  #number = 0;

  /** @throws RangeError The card cannot do it; see `supportedBy`. */
  constructor(gl: WebGL2RenderingContext, private readonly store: MpiStore) {
    if (!Memory.supportedBy(gl)) throw new RangeError('need a card that draws into half floats');
    this.#gl = gl;
    this.#maps = new DepthMaps(gl);
    this.#ask = new Program(gl, screenVertex, askFragment);
    this.#tell = new Program(gl, screenVertex, tellFragment);
    this.#places = new Program(gl, screenVertex, placesFragment);
    this.#screen = gl.createVertexArray();
    this.#sampler = gl.createSampler();
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.samplerParameteri(this.#sampler, name, gl.NEAREST);
    }
    this.#live = gl.createTexture();
  }

  /** Whether the card can add up depths, as alignment needs it as well. */
  static supportedBy(gl: WebGL2RenderingContext): boolean {
    return AlignPictures.supportedBy(gl);
  }

  /** To be called for every frame, before it is drawn. */
  observe(frame: LiveFrame): void {
    this.#frame += 1;
    this.#follow();
    const lost = frame.resets?.lost ?? 0;
    if (lost !== this.#worldsLost) this.#wrong.clear();
    this.#worldsLost = lost;
    const isNew = frame.pictureId === null || frame.pictureId !== this.#pictureId;
    if (!isNew || this.#frame % this.everyFrames !== 0) return;
    this.#pictureId = frame.pictureId;
    const map = frame.camera === null ? null : frame.depth();
    this.#hasDepth = map !== null && this.#upload(map);
    this.#due = ROUNDS;
  }

  /** What is told of a camera and of what is rendered for it; null while there is no depth. */
  readonly tell = (camera: Camera, targets: Targets): Remembered | null => {
    if (!this.#hasDepth || this.#views.length === 0) return null;
    this.#takePlaces();
    if (this.#due > 0 || this.#remembered === null) {
      this.#due -= 1;
      this.#choose(camera);
      this.#draw(camera, targets);
      if (this.#due === 0) this.#askWhere(camera, targets);
    }
    return this.#remembered;
  };

  /** Towards the largest wrong area outside the picture, in axes of the camera, or null. */
  elsewhere(camera: Camera): Vector3 | null {
    return this.#wrong.direction(camera);
  }

  [Symbol.dispose](): void {
    this.#maps[Symbol.dispose]();
    this.#ask[Symbol.dispose]();
    this.#tell[Symbol.dispose]();
    this.#places[Symbol.dispose]();
    this.#parts?.back[Symbol.dispose]();
    this.#parts?.target[Symbol.dispose]();
    this.#answers?.[Symbol.dispose]();
    this.#said?.[Symbol.dispose]();
    this.#gl.deleteTexture(this.#live);
    this.#gl.deleteSampler(this.#sampler);
    this.#gl.deleteVertexArray(this.#screen);
  }

  /** Remember the views that came to the card, one at a frame, and forget those that were undone. */
  #follow(): void {
    const { store } = this;
    if (store.views !== this.#views) {
      this.#views = store.views;
      if (this.#maps.keep(new Set(store.views.map(({ id }) => id)))) this.#due = ROUNDS;
    }
    for (const { id } of this.#views) {
      const mpi = store.resident(id);
      if (mpi === null || !this.#maps.remember(id, mpi)) continue;
      this.#due = ROUNDS;
      return;
    }
  }

  /** Returns whether anything in it is known. */
  #upload({ width_px, height_px, depth_mm }: DepthMap): boolean {
    const median_mm = medianOf(depth_mm);
    if (median_mm === 0) return false;
    this.#depth_m = 0.001 * median_mm;
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#live);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
    gl.texImage2D(
      gl.TEXTURE_2D, 0, gl.R16UI, width_px, height_px, 0, gl.RED_INTEGER, gl.UNSIGNED_SHORT, depth_mm);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    return true;
  }

  /** Ask those that see most of what is seen now, of all that are remembered. */
  #choose(camera: Camera): void {
    const { views, cameras } = this.store;
    if (this.#held.length < views.length) this.#held = new Uint8Array(2 * views.length);
    let held = 0;
    for (let i = 0; i < views.length; i += 1) {
      this.#held[i] = this.#maps.has(views[i]?.id ?? '') ? 1 : 0;
      held += this.#held[i] ?? 0;
    }
    this.#maps.begin();
    if (held === 0) return;
    this.#chooser.measure(cameras, camera);
    const { count, index } = this.#chooser.byOverlap(this.#depth_m, MAX_ASKED, this.#held);
    for (let k = 0; k < count; k += 1) this.#maps.ask(views[index[k] ?? -1]?.id ?? '', camera);
  }

  #draw(camera: Camera, targets: Targets): void {
    const { answers, said } = this.#targetsFor(targets);
    const gl = this.#gl;
    const { asked } = this.#maps;
    for (const test of [gl.DEPTH_TEST, gl.SCISSOR_TEST, gl.CULL_FACE, gl.BLEND]) gl.disable(test);
    answers.begin();
    this.#ask.use();
    this.#bind(0, gl.TEXTURE_2D, this.#live);
    this.#bind(1, gl.TEXTURE_2D_ARRAY, this.#maps.texture);
    gl.uniform1i(this.#ask.uniform('live'), 0);
    gl.uniform1i(this.#ask.uniform('maps'), 1);
    gl.uniform1i(this.#ask.uniform('count'), asked.count);
    gl.uniform1iv(this.#ask.uniform('layers'), asked.layers);
    gl.uniform4fv(this.#ask.uniform('rows'), asked.rows);
    gl.uniform4fv(this.#ask.uniform('inner'), asked.inner);
    writeInner(camera, this.#inner, 0);
    gl.uniform4fv(this.#ask.uniform('inner_here'), this.#inner);
    this.#cover();
    gl.bindSampler(0, null);
    gl.bindSampler(1, null);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, null);

    said.begin();
    this.#tell.use();
    const units = [answers.texture, targets.view.texture, targets.result.texture];
    units.forEach((texture, unit) => this.#bind(unit, gl.TEXTURE_2D, texture));
    gl.uniform1i(this.#tell.uniform('answers'), 0);
    gl.uniform1i(this.#tell.uniform('view'), 1);
    gl.uniform1i(this.#tell.uniform('result'), 2);
    this.#cover();
    for (let unit = 0; unit < units.length; unit += 1) gl.bindSampler(unit, null);
    this.#number += 1;
    this.#remembered = { texture: said.texture, number: this.#number };
  }

  /** Ask how wrong the parts of the picture are. */
  #askWhere(camera: Camera, { result }: Targets): void {
    const gl = this.#gl;
    const upright = result.height >= result.width;
    const cols = upright ? PARTS.short : PARTS.long;
    const rows = upright ? PARTS.long : PARTS.short;
    if (this.#parts?.target.width !== cols) {
      this.#parts?.back[Symbol.dispose]();
      this.#parts?.target[Symbol.dispose]();
      const target = new Target(gl, cols, rows);
      this.#parts = {
        target, back: new ReadBack(gl, target), cols, rows,
        share: new Float32Array(cols * rows), depth_m: new Float32Array(cols * rows),
      };
    }
    const { target, back } = this.#parts;
    if (back.pending) return;
    target.begin();
    this.#places.use();
    this.#bind(0, gl.TEXTURE_2D, result.texture);
    this.#bind(1, gl.TEXTURE_2D, this.#live);
    gl.uniform1i(this.#places.uniform('result'), 0);
    gl.uniform1i(this.#places.uniform('live'), 1);
    gl.uniform2i(this.#places.uniform('parts'), cols, rows);
    this.#cover();
    gl.bindSampler(0, null);
    gl.bindSampler(1, null);
    back.request();
    this.#lookedFrom = {
      pinhole: { ...camera.pinhole }, worldFromCam: rigid(camera.worldFromCam.rows),
    };
  }

  #takePlaces(): void {
    if (this.#parts === null || this.#lookedFrom === null) return;
    const { share, depth_m, back } = this.#parts;
    const pixels = back.take();
    if (pixels === null) return;
    for (let i = 0; i < share.length; i += 1) {
      share[i] = (pixels[4 * i] ?? 0) / 255;
      depth_m[i] = 0.001 * ((pixels[4 * i + 1] ?? 0) + 256 * (pixels[4 * i + 2] ?? 0));
    }
    this.#wrong.remember(this.#lookedFrom, this.#parts);
  }

  #targetsFor({ view }: Targets): { readonly answers: Target; readonly said: Target } {
    const width = Math.max(1, Math.floor(view.width / COARSER));
    const height = Math.max(1, Math.floor(view.height / COARSER));
    let answers = this.#answers;
    let said = this.#said;
    if (answers === null || said === null || answers.width !== width || answers.height !== height) {
      answers?.[Symbol.dispose]();
      said?.[Symbol.dispose]();
      answers = this.#answers = new Target(this.#gl, width, height);
      said = this.#said = new Target(this.#gl, width, height);
    }
    return { answers, said };
  }

  #bind(unit: number, kind: GLenum, texture: WebGLTexture): void {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(kind, texture);
    gl.bindSampler(unit, this.#sampler);
  }

  #cover(): void {
    this.#gl.bindVertexArray(this.#screen);
    this.#gl.drawArrays(this.#gl.TRIANGLES, 0, 3);
    this.#gl.bindVertexArray(null);
  }
}

const sample = new Uint16Array(1024);

/** Median of what is known, 0 when nothing is; of some thousand numbers, which is enough. */
function medianOf(depth_mm: Uint16Array): number {
  const step = Math.max(1, Math.ceil(depth_mm.length / sample.length));
  let known = 0;
  for (let i = 0; i < depth_mm.length; i += step) {
    const mm = depth_mm[i] ?? 0;
    if (mm > 0) sample[known++] = mm;
  }
  return sample.subarray(0, known).sort()[known >> 1] ?? 0;
}
