/**
 * MPIs on the graphics card. Of a long session only the nearest are there; the files of the others
 * wait elsewhere (`load`), and are decoded when they are wanted again.
 */

import type { Camera } from '../geometry';
import { rigid } from '../geometry';
import { FILL_DEPTHS } from '../render/hole_filling';
import type { DecodedMpi } from './decode';
import { TEXTURE_COLS } from './decode';
import { CELL_PX, TILE_PX } from './mpi_file';

/** Turns a file into texels; `MpiDecoder` does, in a worker. */
export interface Decoder {
  decode(bytes: ArrayBuffer): Promise<DecodedMpi>;
}

export interface MpiStoreOptions {
  readonly decoder: Decoder;
  /** MPIs on the graphics card at the same time. */
  readonly maxResident: number;
  /** Hears of an MPI that cannot be fetched or decoded; it is tried again, ever more rarely. */
  readonly onProblem?: (id: string, error: unknown) => void;
}

/** One MPI, ready to be drawn. */
export interface GpuMpi {
  readonly camera: Camera;
  /** Median of its planes: a typical depth of what it shows. */
  readonly medianDepth_m: number;
  /** How deep what it leaves empty may be, as `FILL_DEPTHS` says. */
  readonly fillDepths_m: Float64Array;
  readonly numTiles: number;
  readonly texture: WebGLTexture;
  readonly vertexArray: WebGLVertexArrayObject;
  readonly bytes: number;
}

interface Entry {
  readonly id: string;
  readonly camera: Camera;
  load: () => Promise<ArrayBuffer>;
  /** What is on the card is of an older version; it is shown until the newer one is there. */
  stale: boolean;
  gpu: (GpuMpi & { readonly buffer: WebGLBuffer }) | null;
  loading: boolean;
  lastWanted: number;
  /** Of `performance.now()`'s clock. */
  notBefore_ms: number;
  pause_ms: number;
}

/** So many are fetched and decoded at the same time; the one wanted last comes first. */
const AT_ONCE = 2;
/** An MPI that could not be read is tried again after this, then after twice as long, and so on. */
const FIRST_PAUSE_MS = 1000;
const LONGEST_PAUSE_MS = 30_000;

/** Floats per tile: x and y of its first texel's centre, depth of its plane. */
const INSTANCE_FLOATS = 3;

export class MpiStore implements Disposable {
  readonly #gl: WebGL2RenderingContext;
  readonly #options: MpiStoreOptions;
  readonly #entries = new Map<string, Entry>();
  readonly #listeners = new Set<(id: string) => void>();
  #views: readonly { readonly id: string; readonly camera: Camera }[] = [];
  #cameras: readonly Camera[] = [];
  #clock = 0;
  #numLoading = 0;

  constructor(gl: WebGL2RenderingContext, options: MpiStoreOptions) {
    this.#gl = gl;
    this.#options = options;
  }

  /**
   * Make a view known. `load` is called whenever its MPI is wanted and is not on the card.
   *
   * @param isWanted It is wanted at once: just taken, it will be looked at.
   */
  add(id: string, camera: Camera, load: () => Promise<ArrayBuffer>, isWanted = true): void {
    if (this.#entries.has(id)) return;
    this.#entries.set(id, {
      id, camera, load, stale: false, gpu: null, loading: false, lastWanted: 0, notBefore_ms: 0,
      pause_ms: FIRST_PAUSE_MS,
    });
    this.#list();
    if (isWanted) this.want(id);
  }

  /** A better MPI of a view is there: the old one stays in the picture until the new one is here. */
  replace(id: string, load: () => Promise<ArrayBuffer>): void {
    const entry = this.#entries.get(id);
    if (entry === undefined) return;
    entry.load = load;
    entry.stale = entry.gpu !== null || entry.loading;
    entry.notBefore_ms = 0;
    entry.pause_ms = FIRST_PAUSE_MS;
    this.want(id);
  }

  remove(id: string): void {
    const entry = this.#entries.get(id);
    if (entry === undefined) return;
    this.#free(entry);
    this.#entries.delete(id);
    this.#list();
  }

  has(id: string): boolean {
    return this.#entries.has(id);
  }

  /** All views, in the order they were added. */
  get views(): readonly { readonly id: string; readonly camera: Camera }[] {
    return this.#views;
  }

  /** Their cameras, in the same order; the same array as long as nothing changes. */
  get cameras(): readonly Camera[] {
    return this.#cameras;
  }

  /** The MPI if it is on the card; else it is fetched, and null is returned meanwhile. */
  want(id: string): GpuMpi | null {
    const entry = this.#entries.get(id);
    if (entry === undefined) return null;
    this.#clock += 1;
    entry.lastWanted = this.#clock;
    if (entry.gpu === null || entry.stale) this.#fetchNext();
    return entry.gpu;
  }

  /** The MPI if it is on the card; nothing is fetched. */
  resident(id: string): GpuMpi | null {
    return this.#entries.get(id)?.gpu ?? null;
  }

  get residentCount(): number {
    let count = 0;
    for (const entry of this.#entries.values()) if (entry.gpu !== null) count += 1;
    return count;
  }

  /** Bytes of textures and buffers on the card. */
  get residentBytes(): number {
    let bytes = 0;
    for (const entry of this.#entries.values()) bytes += entry.gpu?.bytes ?? 0;
    return bytes;
  }

  /** Be told when an MPI has come to the card. */
  onResident(listener: (id: string) => void): void {
    this.#listeners.add(listener);
  }

  /** After the browser took the graphics context away: everything is fetched again when wanted. */
  forgetResident(): void {
    for (const entry of this.#entries.values()) entry.gpu = null;
  }

  [Symbol.dispose](): void {
    for (const id of Array.from(this.#entries.keys())) this.remove(id);
  }

  /**
   * Begin to fetch what was wanted last, as far as there is room on the card: of a long session that
   * is opened again, all are known at once, and few are ever seen.
   */
  #fetchNext(): void {
    while (this.#numLoading < AT_ONCE) {
      const now_ms = performance.now();
      const oldest = this.#clock - this.#options.maxResident;
      let next: Entry | null = null;
      for (const entry of this.#entries.values()) {
        if ((entry.gpu !== null && !entry.stale) || entry.loading) continue;
        if (entry.notBefore_ms > now_ms) continue;
        if (entry.lastWanted <= oldest || entry.lastWanted <= (next?.lastWanted ?? 0)) continue;
        next = entry;
      }
      if (next === null) return;
      void this.#fetch(next);
    }
  }

  async #fetch(entry: Entry): Promise<void> {
    entry.loading = true;
    entry.stale = false;
    this.#numLoading += 1;
    const { load } = entry;
    try {
      const decoded = await this.#options.decoder.decode(await load());
      // It may have been undone, or replaced by a better one, while it was on its way.
      if (this.#entries.get(entry.id) !== entry || (entry.load !== load && entry.gpu !== null)) return;
      const better = this.#upload(decoded);
      if (entry.gpu !== null) this.#free(entry);
      else this.#makeRoom();
      entry.gpu = better;
      entry.pause_ms = FIRST_PAUSE_MS;
      for (const listener of this.#listeners) listener(entry.id);
    } catch (error) {
      entry.stale = entry.gpu !== null;
      entry.notBefore_ms = performance.now() + entry.pause_ms;
      entry.pause_ms = Math.min(2 * entry.pause_ms, LONGEST_PAUSE_MS);
      if (this.#entries.get(entry.id) === entry) this.#options.onProblem?.(entry.id, error);
    } finally {
      entry.loading = false;
      this.#numLoading -= 1;
      this.#fetchNext();
    }
  }

  /** Let the ones go that were not wanted for the longest time. */
  #makeRoom(): void {
    const resident = Array.from(this.#entries.values()).filter((entry) => entry.gpu !== null);
    resident.sort((a, b) => a.lastWanted - b.lastWanted);
    const surplus = resident.length + 1 - this.#options.maxResident;
    for (const entry of resident.slice(0, Math.max(surplus, 0))) this.#free(entry);
  }

  #upload(mpi: DecodedMpi): GpuMpi & { readonly buffer: WebGLBuffer } {
    const gl = this.#gl;
    const width = TEXTURE_COLS * TILE_PX;
    const height = mpi.textureRows * TILE_PX;
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
    if (Math.max(width, height) > most) {
      throw new RangeError(`an MPI needs a texture of ${width}x${height}; this device has ${most}`);
    }
    const texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, mpi.texels);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ] as const) gl.texParameteri(gl.TEXTURE_2D, name, value);

    const instances = instancesOf(mpi);
    const buffer = gl.createBuffer();
    const vertexArray = gl.createVertexArray();
    gl.bindVertexArray(vertexArray);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, instances, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, INSTANCE_FLOATS, gl.FLOAT, false, 0, 0);
    gl.vertexAttribDivisor(0, 1);
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
    return {
      camera: { pinhole: mpi.pinhole, worldFromCam: rigid(mpi.worldFromCam) },
      medianDepth_m: quantileOf(mpi.planeDepths_m, 0.5),
      fillDepths_m: Float64Array.from(FILL_DEPTHS, (part) => quantileOf(mpi.planeDepths_m, part)),
      numTiles: mpi.numTiles,
      texture,
      vertexArray,
      buffer,
      bytes: 4 * width * height + instances.byteLength,
    };
  }

  #free(entry: Entry): void {
    const { gpu } = entry;
    if (gpu === null) return;
    entry.gpu = null;
    this.#gl.deleteTexture(gpu.texture);
    this.#gl.deleteVertexArray(gpu.vertexArray);
    this.#gl.deleteBuffer(gpu.buffer);
  }

  #list(): void {
    this.#views = Array.from(this.#entries.values(), ({ id, camera }) => ({ id, camera }));
    this.#cameras = this.#views.map(({ camera }) => camera);
  }
}

function instancesOf(mpi: DecodedMpi): Float32Array<ArrayBuffer> {
  const instances = new Float32Array(INSTANCE_FLOATS * mpi.numTiles);
  for (let tile = 0; tile < mpi.numTiles; tile += 1) {
    const [plane = 0, row = 0, column = 0] = mpi.places.subarray(3 * tile, 3 * tile + 3);
    // A tile begins one texel up and left of its cell, at that texel's centre.
    instances[INSTANCE_FLOATS * tile] = CELL_PX * column - 0.5;
    instances[INSTANCE_FLOATS * tile + 1] = CELL_PX * row - 0.5;
    instances[INSTANCE_FLOATS * tile + 2] = mpi.planeDepths_m[plane] ?? NaN;
  }
  return instances;
}

/** Between the two values around it where it falls between them. */
function quantileOf(values: Float64Array<ArrayBufferLike>, part: number): number {
  const sorted = Float64Array.from(values).sort();
  const place = part * (sorted.length - 1);
  const below = Math.floor(place);
  const lower = sorted[below] ?? NaN;
  const upper = sorted[Math.min(below + 1, sorted.length - 1)] ?? NaN;
  return lower + (place - below) * (upper - lower);
}
