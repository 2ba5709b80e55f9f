/** The light field, to walk in: the renderer of the capture page behind a free camera. */

import { forwardOf, type Camera, type Pinhole } from '../geometry';
import { MpiDecoder } from '../mpi/decoder';
import { MpiStore } from '../mpi/mpi_store';
import { governorOf, LEVELS } from '../render/governor';
import { LightFieldRenderer } from '../render/light_field_renderer';
import { ARROWS_LOOK, WalkControls } from '../walk_controls';
import { between, FreeCamera, type Stand } from './free_camera';
import {
  eased, FIRST_STEP_MS, FLIGHT_MS, LONGEST_STEP_MS, wantsLessMotion, type Layer, type LayerHooks,
} from './layer';
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
/** It has come to rest when nothing moved for so long. */
const REST_MS = 300;
/** What could not be fetched is tried again after so long, and after ever longer. */
const RETRY_MS = 1100;
const LONGEST_RETRY_MS = 31_000;

interface Flight { readonly from: Stand; readonly to: Stand; readonly start_ms: number }

export class LightFieldLayer implements Layer {
  readonly canvas = document.createElement('canvas');
  readonly tilt: Tilt;
  readonly #gl: WebGL2RenderingContext;
  readonly #renderer: LightFieldRenderer;
  readonly #store: MpiStore;
  readonly #decoder: MpiDecoder;
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
  #movedAt_ms = 0;
  /** Less is drawn than could be. */
  #lowered = false;
  #drawing = false;
  #retries = 0;
  #radius = 0;
  readonly #pace = {
    keys: ARROWS_LOOK, walk_m_per_s: 0, drag_rad_per_px: 0.0025, wheel_m_per_px: 0, pinch_m_per_px: 0,
  };

  /** @throws PlaceError This browser cannot show it. */
  constructor(source: PlaceSource, options: LightFieldOptions, hooks: LayerHooks, keysOf: Window | HTMLElement) {
    const gl = this.canvas.getContext('webgl2', { alpha: false, antialias: false, preserveDrawingBuffer: true });
    if (gl === null) throw new PlaceError('This browser has no WebGL 2, which the light field needs: use a current one.');
    const { place } = source;
    const start = place.views[place.start];
    if (start === undefined) throw new PlaceError('There is no view in this place yet.');
    this.#gl = gl;
    this.#decoder = new MpiDecoder();
    this.#source = source;
    this.#hooks = hooks;
    this.#seen = start.camera.pinhole;
    this.#renderer = new LightFieldRenderer(gl, options);
    this.#store = new MpiStore(gl, {
      decoder: this.#decoder, maxResident: MAX_RESIDENT,
      onProblem: (_, error) => {
        hooks.onProblem(error instanceof Error ? error.message : String(error));
        this.#tryAgain();
      },
    });
    this.#store.onResident(() => {
      this.#retries = 0;
      this.#renderer.invalidate();
      hooks.wake();
    });
    this.#walker = new FreeCamera(upOf(place), forwardOf(start.camera));
    this.#controls = new WalkControls(this.#walker, this.#pace);
    this.#controls.onInput = () => {
      this.#flight = null;
      this.#moved = true;
      hooks.wake();
    };
    this.tilt = new Tilt((right, up) => {
      this.#walker.lean(right * LEAN * this.#radius, up * LEAN * this.#radius);
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

  get active(): boolean {
    return this.#controls.enabled;
  }

  set active(active: boolean) {
    this.#controls.enabled = active;
  }

  update(place: Place): void {
    let changed = this.#known.size === 0;
    const present = new Set<string>();
    for (const { name, camera, mpi } of place.views) {
      if (mpi === null) continue;
      present.add(name);
      const load = (): Promise<ArrayBuffer> => this.#source.bytes(mpi);
      const known = this.#known.get(name);
      if (known === mpi) continue;
      changed = true;
      // Only what is near is wanted, and whoever draws says what that is.
      if (known === undefined) this.#store.add(name, camera, load, false);
      else this.#store.replace(name, load);
      this.#known.set(name, mpi);
    }
    for (const name of Array.from(this.#known.keys())) {
      if (present.has(name)) continue;
      changed = true;
      this.#known.delete(name);
      this.#store.remove(name);
    }
    if (!changed) return;
    const volume = new Volume(place.views);
    this.#walker.volume = volume;
    this.#radius = volume.radius;
    this.#pace.walk_m_per_s = WALK_RADII_PER_S * volume.radius;
    this.#pace.wheel_m_per_px = 0.001 * volume.radius;
    this.#pace.pinch_m_per_px = 0.003 * volume.radius;
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
    const step_ms = this.#drawing ? Math.min(time_ms - this.#last_ms, LONGEST_STEP_MS) : FIRST_STEP_MS;
    this.#last_ms = time_ms;
    if (this.#controls.moving) {
      this.#controls.advance(step_ms);
      this.#moved = true;
    }
    this.#fly(time_ms);
    this.#govern(this.#moved && !this.#first, time_ms);
    if (this.#moved) this.#hooks.onEdge(this.#walker.volume?.edge ?? 0);
    if (this.#moved || !this.#renderer.settled) {
      this.#moved = false;
      this.#renderer.draw(this.camera(), this.#store, this.#pixelRatio);
      if (this.#first && this.#renderer.showsNearest) {
        this.#first = false;
        this.#hooks.onFirstPicture();
      }
    }
    // Where no view has come yet, whoever waits is woken by the store.
    const coming = this.#renderer.viewIds.length > 0 && !this.#renderer.settled;
    this.#drawing = this.#controls.moving || this.#flight !== null || coming || this.#lowered;
    return this.#drawing;
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
    this.#gl.getExtension('WEBGL_lose_context')?.loseContext();
    this.canvas.remove();
  }

  /** Draw again later: whatever is wanted then is asked for again. */
  #tryAgain(): void {
    const wait_ms = Math.min(RETRY_MS * 2 ** this.#retries, LONGEST_RETRY_MS);
    this.#retries += 1;
    setTimeout(() => {
      this.#renderer.invalidate();
      if (!this.#stop.signal.aborted) this.#hooks.wake();
    }, wait_ms);
  }

  /** While it moves, the governor says how much is drawn; at rest there is time for all of it. */
  #govern(moving: boolean, time_ms: number): void {
    const governor = this.#governor;
    if (governor === null) return;
    if (moving) {
      if (!this.#moving) governor.pause();
      if (governor.frame(time_ms) || !this.#moving) this.#renderer.allow(governor.allowance);
      this.#movedAt_ms = time_ms;
      this.#lowered = governor.level > 0;
    } else if (this.#lowered && time_ms - this.#movedAt_ms > REST_MS) {
      this.#renderer.allow(LEVELS[0]);
      this.#lowered = false;
    }
    this.#moving = moving;
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
