/** The light field, to walk in: the renderer of the capture page behind a free camera. */

import { forwardOf, type Camera, type Pinhole } from '../geometry';
import { MpiDecoder } from '../mpi/decoder';
import { MpiStore } from '../mpi/mpi_store';
import { governorOf } from '../render/governor';
import { LightFieldRenderer } from '../render/light_field_renderer';
import { ARROWS_LOOK, WalkControls } from '../walk_controls';
import { between, FreeCamera, type Stand } from './free_camera';
import { eased, FLIGHT_MS, wantsLessMotion, type Layer, type LayerHooks } from './layer';
import { upOf, type LightFieldOptions, type Place } from './place';
import { PlaceError, type PlaceSource } from './place_source';
import { Tilt } from './tilt';
import { Volume } from './volume';

/** MPIs on the graphics card at the same time. */
const MAX_RESIDENT = 16;
/** A tilted phone leans so far, as a share of the volume's radius. */
const LEAN = 0.8;
/** A second of walking, as a share of the volume's radius. */
const WALK_RADII_PER_S = 1.2;
/** A moment between two frames may be as long as this. */
const LONGEST_STEP_MS = 250;

interface Flight { readonly from: Stand; readonly to: Stand; readonly start_ms: number }

export class LightFieldLayer implements Layer {
  readonly canvas = document.createElement('canvas');
  readonly tilt: Tilt;
  readonly #gl: WebGL2RenderingContext;
  readonly #renderer: LightFieldRenderer;
  readonly #store: MpiStore;
  readonly #decoder = new MpiDecoder();
  readonly #source: PlaceSource;
  readonly #hooks: LayerHooks;
  readonly #stop = new AbortController();
  readonly #walker: FreeCamera;
  readonly #controls: WalkControls;
  readonly #governor = governorOf(new URLSearchParams(location.search), { marks: 'apart' });
  /** The file of each view that the store knows. */
  readonly #known = new Map<string, string>();
  #seen: Pinhole;
  #pixelRatio = 1;
  #last_ms = 0;
  #flight: Flight | null = null;
  #moved = true;
  #first = true;
  #moving = false;

  /** @throws PlaceError This browser cannot show it. */
  constructor(source: PlaceSource, options: LightFieldOptions, hooks: LayerHooks, keysOf: Window | HTMLElement) {
    const gl = this.canvas.getContext('webgl2', { alpha: false, antialias: false, preserveDrawingBuffer: true });
    if (gl === null) throw new PlaceError('This browser has no WebGL 2, which the light field needs: use a current one.');
    const { place } = source;
    const start = place.views[place.start];
    if (start === undefined) throw new PlaceError('There is no view in this place yet.');
    this.#gl = gl;
    this.#source = source;
    this.#hooks = hooks;
    this.#seen = start.camera.pinhole;
    this.#renderer = new LightFieldRenderer(gl, options);
    this.#store = new MpiStore(gl, {
      decoder: this.#decoder, maxResident: MAX_RESIDENT,
      onProblem: (_, error) => hooks.onProblem(error instanceof Error ? error.message : String(error)),
    });
    this.#store.onResident(() => {
      this.#renderer.invalidate();
      hooks.wake();
    });
    this.#walker = new FreeCamera(upOf(place), forwardOf(start.camera));
    const volume = new Volume(place.views);
    const m = volume.radius;
    this.#controls = new WalkControls(this.#walker, {
      keys: ARROWS_LOOK, walk_m_per_s: WALK_RADII_PER_S * m, drag_rad_per_px: 0.0025,
      wheel_m_per_px: 0.001 * m, pinch_m_per_px: 0.003 * m,
    });
    this.#controls.onInput = () => {
      this.#flight = null;
      this.#moved = true;
      hooks.wake();
    };
    this.tilt = new Tilt((right, up) => {
      this.#walker.lean(right * LEAN * m, up * LEAN * m);
      this.#moved = true;
      hooks.wake();
    });
    this.update(place);
    this.#walker.stand = this.#walker.standOf(start.camera);
    this.#controls.attach(this.canvas, this.#stop.signal, keysOf);
    this.canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      hooks.onProblem('The browser took the graphics away. Reload the page.');
    });
  }

  update(place: Place): void {
    const present = new Set<string>();
    for (const { name, camera, mpi } of place.views) {
      if (mpi === null) continue;
      present.add(name);
      const load = (): Promise<ArrayBuffer> => this.#source.bytes(mpi);
      const known = this.#known.get(name);
      if (known === undefined) this.#store.add(name, camera, load);
      else if (known !== mpi) this.#store.replace(name, load);
      this.#known.set(name, mpi);
    }
    for (const name of Array.from(this.#known.keys())) {
      if (present.has(name)) continue;
      this.#known.delete(name);
      this.#store.remove(name);
    }
    this.#walker.volume = new Volume(place.views);
    this.#renderer.invalidate();
    this.#moved = true;
  }

  resize(width_px: number, height_px: number, pixelRatio: number): void {
    this.canvas.width = width_px;
    this.canvas.height = height_px;
    this.#pixelRatio = pixelRatio;
    this.#renderer.invalidate();
    this.#moved = true;
  }

  lookFrom(camera: Camera, gradually: boolean): void {
    this.#seen = camera.pinhole;
    const to = this.#walker.standOf(camera);
    if (gradually && !wantsLessMotion()) {
      this.#flight = { from: this.#walker.stand, to, start_ms: performance.now() };
    } else {
      this.#flight = null;
      this.#walker.stand = to;
    }
    this.#moved = true;
    this.#hooks.wake();
  }

  camera(): Camera {
    return this.#walker.update(this.canvas.width, this.canvas.height, this.#seen);
  }

  draw(time_ms: number): boolean {
    const step_ms = Math.min(time_ms - this.#last_ms, LONGEST_STEP_MS);
    this.#last_ms = time_ms;
    const moving = this.#controls.moving || this.#flight !== null;
    const governor = moving && this.#moving ? this.#governor : null;
    if (governor?.frame(time_ms) === true) this.#renderer.allow(governor.allowance);
    this.#moving = moving;
    if (this.#controls.moving) {
      this.#controls.advance(step_ms);
      this.#moved = true;
    }
    this.#fly(time_ms);
    if (this.#moved) this.#hooks.onEdge(this.#walker.volume?.edge ?? 0);
    if (this.#moved || !this.#renderer.settled) {
      this.#moved = false;
      this.#renderer.draw(this.camera(), this.#store, this.#pixelRatio);
      if (this.#first && this.#renderer.viewIds.length > 0) {
        this.#first = false;
        this.#hooks.onFirstPicture();
      }
    }
    // Where no view has come yet, whoever waits is woken by the store.
    const coming = this.#renderer.viewIds.length > 0 && !this.#renderer.settled;
    return this.#controls.moving || this.#flight !== null || coming;
  }

  /** For tests: what was rendered, as RGBA8 of the view's own size, bottom row first. */
  inspect(): { readonly width: number; readonly height: number; readonly rgba: Uint8Array; readonly viewIds: readonly string[]; readonly settled: boolean } | null {
    const { targets } = this.#renderer;
    if (targets === null) return null;
    const { width, height, view } = targets;
    const rgba = new Uint8Array(4 * width * height);
    this.#gl.bindFramebuffer(this.#gl.FRAMEBUFFER, view.framebuffer);
    this.#gl.readPixels(0, 0, width, height, this.#gl.RGBA, this.#gl.UNSIGNED_BYTE, rgba);
    return { width, height, rgba, viewIds: Array.from(this.#renderer.viewIds), settled: this.#renderer.settled };
  }

  /** What lies on the graphics card. */
  get resident(): { readonly views: number; readonly bytes: number } {
    return { views: this.#store.residentCount, bytes: this.#store.residentBytes };
  }

  [Symbol.dispose](): void {
    this.#stop.abort();
    this.tilt[Symbol.dispose]();
    this.#renderer[Symbol.dispose]();
    this.#store[Symbol.dispose]();
    this.#decoder[Symbol.dispose]();
    this.canvas.remove();
  }

  #fly(time_ms: number): void {
    const flight = this.#flight;
    if (flight === null) return;
    const share = (time_ms - flight.start_ms) / FLIGHT_MS;
    this.#walker.stand = between(flight.from, flight.to, eased(share));
    this.#moved = true;
    if (share >= 1) this.#flight = null;
  }
}
