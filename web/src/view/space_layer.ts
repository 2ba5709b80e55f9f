/** A place from outside: cameras, path and points, or 3D Gaussians, to be turned around. */

import { Matrix4, PerspectiveCamera, Quaternion, Scene, Vector3 as Vector, WebGLRenderer } from 'three';
import { copyOfCamera, forwardOf, identity, pinholeScratch, positionOf, worldFromCamOfWebXr, type Camera, type Vector3 } from '../geometry';
import { axesOf, Floor, type Axes } from './floor';
import { scaleFor } from './free_camera';
import { Frusta } from './frusta';
import {
  eased, FIRST_STEP_MS, FLIGHT_MS, LONGEST_STEP_MS, wantsLessMotion, type Layer, type LayerHooks,
} from './layer';
import { gazeOf, upOf, type Place } from './place';
import { PlaceError, type PlaceSource } from './place_source';
import { PointSets } from './point_sets';
import type { Splats } from './splats';
import { Turntable } from './turntable';

const FOV_DEG = 50;
/** A frustum is so deep, as a share of what the cameras take up; and of how far they look. */
const FRUSTUM_OF_EXTENT = 0.12;
const FRUSTUM_OF_GAZE = 0.12;
/** A touch or click moves less than this. */
const CLICK_PX = 6;
/** A view is pointed at from so near. */
const PICK_PX = 30;
/** Gaussians that could not be had are tried again so often, after so long and longer. */
const TRIES = 3;
const RETRY_MS = 3000;
/** The overview looks down so much: up, per length backwards. */
const ABOVE = 0.45;
/** … at a point so far from the middle of all towards the middle of the cameras. */
const TO_CAMERAS = 0.4;

interface Pose { readonly position: Vector; readonly turned: Quaternion; readonly fov_deg: number }
interface Flight { readonly from: Pose; readonly to: Pose; readonly start_ms: number }

export interface SpaceOptions {
  /** 3D Gaussians in place of points. */
  readonly splats: boolean;
}

export class SpaceLayer implements Layer {
  readonly canvas: HTMLCanvasElement;
  readonly #source: PlaceSource;
  readonly #hooks: LayerHooks;
  readonly #options: SpaceOptions;
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera(FOV_DEG, 1, 0.01, 1000);
  readonly #turntable: Turntable;
  readonly #stop = new AbortController();
  readonly #frusta: Frusta;
  readonly #points: PointSets;
  readonly #floor = new Floor();
  #splats: Splats | null = null;
  #splatFile: string | null = null;
  #failures = 0;
  #place: Place;
  #up: Vector3;
  /** How far the cameras look, about. */
  #reach = 1;
  #through: number | null = null;
  /** The camera from which it is looked, until somebody moves. */
  #from: Camera | null = null;
  #flight: Flight | null = null;
  #dirty = true;
  /** Someone chose where to look from: it stays so when more comes. */
  #touched = false;
  #sized = 0;
  #last_ms = 0;
  #drawing = false;
  readonly #seen = { pinhole: pinholeScratch(), worldFromCam: identity() } as Camera & {
    readonly pinhole: ReturnType<typeof pinholeScratch>;
  };

  /** @throws PlaceError This browser cannot show it. */
  constructor(source: PlaceSource, hooks: LayerHooks, options: SpaceOptions, keysOf: Window | HTMLElement) {
    this.#source = source;
    this.#hooks = hooks;
    this.#options = options;
    this.#place = source.place;
    this.#renderer = rendererOf(!options.splats);
    this.canvas = this.#renderer.domElement;
    this.#frusta = new Frusta((file) => source.url(file), this.#wake, hooks.onProblem);
    this.#points = new PointSets((file) => source.bytes(file), this.#wake, hooks.onProblem);
    this.#scene.add(this.#frusta.group, this.#points.group, this.#floor.group);
    this.#up = upOf(this.#place);
    this.#turntable = new Turntable(this.#camera, this.canvas, this.#up, {
      onTouch: () => this.#takeOver(), onMove: this.#wake,
    }, keysOf);
    this.#listenForClicks();
    const { signal } = this.#stop;
    this.canvas.addEventListener('webglcontextlost', () => {
      hooks.onProblem('The browser took the graphics away. Reload the page if they do not come back.');
    }, { signal });
    this.canvas.addEventListener('webglcontextrestored', this.#wake, { signal });
    this.update(this.#place);
  }

  get active(): boolean {
    return this.#turntable.active;
  }

  set active(active: boolean) {
    this.#turntable.active = active;
  }

  update(place: Place): void {
    this.#place = place;
    this.#turnUp(upOf(place));
    const { views } = place;
    this.#reach = this.#reachOf(place);
    const size = Math.max(FRUSTUM_OF_EXTENT * spread(place), FRUSTUM_OF_GAZE * this.#reach * (views.length > 1 ? 0.35 : 1));
    this.#frusta.update(views, place.suggested, size);
    if (this.#options.splats) {
      this.#frusta.group.visible = false;
      this.#showSplats(place.splat);
    } else {
      this.#points.update(place.points);
    }
    if (!this.#touched && views.length > 0) this.overview();
    this.#dirty = true;
    this.#hooks.wake();
  }

  resize(width_px: number, height_px: number, pixelRatio: number): void {
    this.#renderer.setPixelRatio(1);
    this.#renderer.setSize(width_px, height_px, false);
    this.#points.pixelRatio = pixelRatio;
    this.#camera.aspect = width_px / height_px;
    // What is looked at through a camera fills the screen as before.
    if (this.#from !== null && this.#flight === null) this.#camera.fov = this.#poseOf(this.#from).fov_deg;
    this.#camera.updateProjectionMatrix();
    this.#dirty = true;
  }

  /** Stand behind the cameras and above, so that they and what they look at are in the picture. */
  overview(): void {
    const { centre, radius } = this.#bounds();
    const gaze = new Vector(...gazeOf(this.#place.views, this.#reach));
    const up = new Vector(...this.#up);
    const back = new Vector(...gazeOf(this.#place.views, 0)).sub(gaze);
    back.addScaledVector(up, -back.dot(up));
    if (back.lengthSq() < 1e-9) back.set(up.y, up.z, up.x);
    back.normalize().addScaledVector(up, ABOVE).normalize();
    this.#leaveThrough();
    this.#from = null;
    this.#touched = false;
    this.#camera.fov = FOV_DEG;
    const half_rad = (FOV_DEG * Math.PI) / 360;
    const away = radius / Math.sin(Math.min(half_rad, Math.atan(Math.tan(half_rad) * this.#camera.aspect)));
    centre.lerp(new Vector(...gazeOf(this.#place.views, 0)), TO_CAMERAS);
    this.#turntable.target.copy(centre);
    this.#camera.position.copy(centre).addScaledVector(back, away);
    this.#camera.near = away / 200;
    this.#camera.far = 40 * away;
    this.#camera.updateProjectionMatrix();
    this.#turntable.update();
    this.#dirty = true;
  }

  /** A sphere around the cameras and most of the points. */
  #bounds(): { readonly centre: Vector; readonly radius: number } {
    const axes = this.#axes();
    const extent = this.#points.extent(axes);
    const centre = new Vector();
    let square = 0;
    axes.map((axis) => new Vector(...axis)).forEach((axis, i) => {
      const places = this.#place.views.map(({ camera }) => axis.dot(new Vector(...positionOf(camera))));
      const [low, high] = extent?.[i] ?? [Infinity, -Infinity];
      const least = Math.min(low, ...places);
      const most = Math.max(high, ...places);
      if (!(most >= least)) return;
      centre.addScaledVector(axis, (least + most) / 2);
      square += ((most - least) / 2) ** 2;
    });
    const known = extent === null ? 0.8 * this.#reach : 0;
    return { centre, radius: Math.max(Math.sqrt(square), known, 1e-3) };
  }

  lookFrom(camera: Camera, gradually: boolean): void {
    this.#leaveThrough();
    const index = this.#place.views.findIndex((view) => view.camera === camera);
    this.#through = index < 0 ? null : index;
    this.#from = copyOfCamera(camera);
    this.#touched = true;
    const to = this.#poseOf(camera);
    const now = this.#poseNow();
    const still = !gradually || wantsLessMotion();
    this.#flight = { from: still ? to : now, to, start_ms: performance.now() - (still ? FLIGHT_MS : 0) };
    this.#hooks.wake();
  }

  camera(): Camera {
    const { width, height } = this.canvas;
    const f = height / 2 / Math.tan((this.#camera.fov * Math.PI) / 360);
    Object.assign(this.#seen.pinhole, {
      width_px: width, height_px: height, fx_px: f, fy_px: f, cx_px: width / 2, cy_px: height / 2,
    });
    this.#camera.updateMatrixWorld();
    worldFromCamOfWebXr(this.#camera.matrixWorld.elements, this.#seen.worldFromCam);
    return this.#seen;
  }

  /** Paint points by how many views see them. */
  set byCoverage(on: boolean) {
    this.#points.byCoverage = on;
  }

  /** How large it is, along the ground and upwards; null while too few points are there. */
  size(): { readonly wide: number; readonly deep: number; readonly high: number } | null {
    const extent = this.#points.extent(this.#axes());
    if (extent === null) return null;
    const [wide = 0, deep = 0, high = 0] = extent.map(([low, top]) => top - low);
    return { wide, deep, high };
  }

  /** Gaussians, or points, that are shown. */
  get count(): number {
    return this.#options.splats ? this.#splats?.count ?? 0 : this.#points.count;
  }

  draw(time_ms: number): boolean {
    const step_ms = this.#drawing ? Math.min(time_ms - this.#last_ms, LONGEST_STEP_MS) : FIRST_STEP_MS;
    this.#last_ms = time_ms;
    this.#fly(time_ms);
    if (this.#turntable.moving) {
      this.#turntable.advance(step_ms);
      this.#dirty = true;
    }
    const turning = this.#flight === null && this.#through === null && this.#turntable.update();
    this.#drawing = turning || this.#flight !== null || this.#turntable.moving;
    if (!this.#dirty && !turning) return this.#drawing;
    this.#dirty = false;
    this.#fitSize();
    this.#renderer.render(this.#scene, this.#camera);
    if (!this.#options.splats || this.count > 0) this.#hooks.onFirstPicture();
    return this.#drawing;
  }

  [Symbol.dispose](): void {
    this.#stop.abort();
    this.#turntable[Symbol.dispose]();
    this.#frusta[Symbol.dispose]();
    this.#points[Symbol.dispose]();
    this.#splats?.[Symbol.dispose]();
    this.#floor[Symbol.dispose]();
    this.#renderer.dispose();
    this.#renderer.forceContextLoss();
    this.canvas.remove();
  }

  #axes(): Axes {
    const first = this.#place.views[0];
    return axesOf(this.#up, first === undefined ? [1, 0, 0] : forwardOf(first.camera));
  }

  /** What depends on how large it is, again when more of it has come. */
  #fitSize(): void {
    if (this.#options.splats || this.#points.count === this.#sized) return;
    this.#sized = this.#points.count;
    this.#reach = this.#reachOf(this.#place);
    if (!this.#touched) this.overview();
    const axes = this.#axes();
    const extent = this.#points.extent(axes);
    if (extent !== null) this.#floor.fit(axes, extent);
  }

  #showSplats(file: string | null): void {
    if (file === null || file === this.#splatFile) return;
    this.#splatFile = file;
    this.#loadSplats(file).then(() => { this.#failures = 0; }, (error: unknown) => {
      if (this.#splatFile !== file || this.#stop.signal.aborted) return;
      const why = error instanceof PlaceError ? error.message : `These 3D Gaussians cannot be shown: ${String(error)}`;
      this.#hooks.onProblem(why);
      this.#failures += 1;
      if (this.#failures > TRIES) return;
      setTimeout(() => {
        this.#splatFile = null;
        if (!this.#stop.signal.aborted) this.#showSplats(this.#place.splat);
      }, this.#failures * RETRY_MS);
    });
  }

  async #loadSplats(file: string): Promise<void> {
    const [{ Splats: Drawn }, bytes] = await Promise.all([import('./splats'), this.#source.bytes(file)]);
    // There may be newer ones by now, which came sooner.
    if (this.#stop.signal.aborted || this.#splatFile !== file) return;
    this.#splats ??= new Drawn(this.#renderer, this.#wake);
    this.#scene.add(this.#splats.group);
    await this.#splats.show(bytes, file.replace(/[?#].*$/, ''));
    this.#fitToSplats();
  }

  /** See all of the Gaussians, also where these are far larger than what the cameras say. */
  #fitToSplats(): void {
    const reach = this.#splats?.reachFrom(this.#camera.position) ?? null;
    if (reach === null) return;
    this.#reach = reach.median;
    this.#camera.near = Math.min(this.#camera.near, reach.median / 100);
    this.#camera.far = Math.max(this.#camera.far, 10 * reach.most);
    this.#camera.updateProjectionMatrix();
    if (!this.#touched || this.#from !== null) this.#aim();
    this.#dirty = true;
  }

  /** Another way is up: it is turned around that from now on, if nobody has turned it yet. */
  #turnUp(up: Vector3): void {
    const same = up.every((value, axis) => Math.abs(value - (this.#up[axis] ?? 0)) < 1e-6);
    if (same || this.#touched) return;
    this.#up = up;
    this.#turntable.setUp(up);
  }

  readonly #wake = (): void => {
    this.#dirty = true;
    this.#hooks.wake();
  };

  /** How far the cameras look: the median depth of MPIs is not known here, the places are. */
  #reachOf(place: Place): number {
    const size = this.#points.extent(this.#axes());
    if (size !== null) return 0.5 * Math.hypot(...size.map(([low, high]) => high - low)) || 1;
    return Math.max(2 * spread(place), place.metric ? 1 : 0.5);
  }

  #listenForClicks(): void {
    let down: { readonly x: number; readonly y: number } | null = null;
    const options = { signal: this.#stop.signal };
    this.canvas.addEventListener('pointerdown', ({ clientX, clientY }) => { down = { x: clientX, y: clientY }; }, options);
    this.canvas.addEventListener('pointerup', ({ clientX, clientY }) => {
      if (down === null || Math.hypot(clientX - down.x, clientY - down.y) > CLICK_PX) return;
      const view = this.#viewAt(clientX, clientY);
      if (view !== null) this.#hooks.onPick(view);
    }, options);
  }

  #viewAt(x: number, y: number): number | null {
    if (!this.#frusta.group.visible) return null;
    const box = this.canvas.getBoundingClientRect();
    let best: number | null = null;
    let least = PICK_PX;
    const at = new Vector();
    this.#place.views.forEach(({ camera }, i) => {
      at.set(...positionOf(camera)).project(this.#camera);
      if (at.z > 1) return;
      const away = Math.hypot(
        box.left + ((at.x + 1) / 2) * box.width - x, box.top + ((1 - at.y) / 2) * box.height - y);
      if (away >= least) return;
      least = away;
      best = i;
    });
    return best;
  }

  #poseNow(): Pose {
    const { position, quaternion, fov } = this.#camera;
    return { position: position.clone(), turned: quaternion.clone(), fov_deg: fov };
  }

  #poseOf({ worldFromCam: { rows: m }, pinhole: k }: Camera): Pose {
    const at = (r: number, c: number): number => m[4 * r + c] ?? 0;
    const turned = new Quaternion().setFromRotationMatrix(new Matrix4().makeBasis(
      new Vector(at(0, 0), at(1, 0), at(2, 0)), new Vector(-at(0, 1), -at(1, 1), -at(2, 1)),
      new Vector(-at(0, 2), -at(1, 2), -at(2, 2))));
    const { width, height } = this.canvas;
    // Who looks through a camera sees all of its photo; Gaussians fill the screen.
    const scale = scaleFor(width, height, k, this.#options.splats);
    return {
      position: new Vector(at(0, 3), at(1, 3), at(2, 3)), turned,
      fov_deg: (360 / Math.PI) * Math.atan(height / 2 / (scale * k.fy_px)),
    };
  }

  #fly(time_ms: number): void {
    const flight = this.#flight;
    if (flight === null) return;
    const share = eased((time_ms - flight.start_ms) / FLIGHT_MS);
    const { from, to } = flight;
    this.#camera.position.lerpVectors(from.position, to.position, share);
    this.#camera.quaternion.slerpQuaternions(from.turned, to.turned, share);
    this.#camera.fov = from.fov_deg + share * (to.fov_deg - from.fov_deg);
    this.#camera.updateProjectionMatrix();
    this.#dirty = true;
    if (share < 1) return;
    this.#flight = null;
    if (this.#options.splats) return this.#aim();
    this.#frusta.lookThrough(this.#through);
    if (this.#frusta.through !== null) this.#scene.add(this.#frusta.through);
  }

  /** Turn around what lies ahead from now on. */
  #aim(): void {
    this.#through = null;
    this.#turntable.aim(this.#reach);
  }

  /** Someone moves the camera: whatever moved it lets go. */
  #takeOver(): void {
    this.#flight = null;
    this.#from = null;
    this.#touched = true;
    if (this.#through === null) return;
    this.#aim();
    this.#leaveThrough();
  }

  #leaveThrough(): void {
    this.#through = null;
    this.#frusta.lookThrough(null);
    this.#frusta.group.visible = !this.#options.splats;
    this.#dirty = true;
  }
}

function rendererOf(antialias: boolean): WebGLRenderer {
  try {
    return new WebGLRenderer({ antialias, alpha: true, preserveDrawingBuffer: true });
  } catch {
    throw new PlaceError('This browser has no WebGL 2, which 3D needs: use a current one.');
  }
}

/** How far the cameras are from each other, at most. */
function spread({ views }: Place): number {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const { camera } of views) {
    positionOf(camera).forEach((value, axis) => {
      low[axis] = Math.min(low[axis] ?? 0, value);
      high[axis] = Math.max(high[axis] ?? 0, value);
    });
  }
  return views.length === 0 ? 1 : Math.hypot(...high.map((value, axis) => value - (low[axis] ?? 0)));
}
