/**
 * Depth as ARCore gives it: 160 × 90, landscape though the phone is upright, so turned and cropped
 * against the picture; 16-bit millimetres; noisy, with holes at edges, and late after the start.
 */

import {
  FloatType, NearestFilter, PerspectiveCamera, RedFormat, ShaderMaterial, DoubleSide, WebGLRenderTarget,
  type WebGLRenderer,
} from 'three';
import type { RawDepth } from '../depth';
import type { Room } from './room';
import { randomOf } from './textures';

const WIDTH = 160;
const HEIGHT = 90;
/** ARCore needs movement before it has depth. */
const LATE_FRAMES = 6;
/** Standard deviation at 1 m; it grows with the square of the distance. */
const NOISE_M = 0.004;
/** A step in depth by more than this factor is an edge. */
const EDGE = 1.12;

export class ArcoreDepth {
  readonly #target = new WebGLRenderTarget(HEIGHT, WIDTH, {
    type: FloatType, format: RedFormat, minFilter: NearestFilter, magFilter: NearestFilter,
  });
  readonly #camera = new PerspectiveCamera();
  readonly #material = new ShaderMaterial({
    vertexShader: 'varying float z; void main() { vec4 p = modelViewMatrix * vec4(position, 1.0);'
      + ' z = -p.z; gl_Position = projectionMatrix * p; }',
    fragmentShader: 'varying float z; void main() { gl_FragColor = vec4(z, 0.0, 0.0, 1.0); }',
    side: DoubleSide,
  });
  readonly #random = randomOf(2026);
  readonly #upright = new Float32Array(WIDTH * HEIGHT);
  #frames = 0;

  constructor(
    private readonly renderer: WebGLRenderer, private readonly room: Room,
    private readonly exact: boolean,
  ) {}

  /** To be called once per frame. */
  tick(): void {
    this.#frames += 1;
  }

  /** Depth for a camera that shows the picture; null in the first frames. */
  of(picture: PerspectiveCamera): RawDepth | null {
    if (this.#frames <= LATE_FRAMES) return null;
    this.#render(picture);
    const data = new Uint16Array(WIDTH * HEIGHT);
    for (let down = 0; down < WIDTH; down += 1) {
      for (let right = 0; right < HEIGHT; right += 1) {
        // The sensor lies on its side: its x runs down the upright picture, its y to the left.
        data[(HEIGHT - 1 - right) * WIDTH + down] = this.#sensed_mm(right, down);
      }
    }
    const shown = picture.aspect / (HEIGHT / WIDTH);
    const matrix = new Float32Array(16);
    matrix[1] = -shown; // y of the buffer = 0.5 - (u - 0.5) · shown
    matrix[13] = 0.5 + 0.5 * shown;
    matrix[4] = 1; // x of the buffer = v
    matrix[10] = 1;
    matrix[15] = 1;
    return {
      width: WIDTH, height: HEIGHT, data: data.buffer, rawValueToMeters: 0.001,
      normDepthBufferFromNormView: { matrix },
    };
  }

  /** The sensor sees as high as the picture and wider than it. */
  #render(picture: PerspectiveCamera): void {
    const { scene, mirror } = this.room;
    this.#camera.position.copy(picture.position);
    this.#camera.quaternion.copy(picture.quaternion);
    this.#camera.fov = picture.fov;
    this.#camera.aspect = HEIGHT / WIDTH;
    this.#camera.near = 0.05;
    this.#camera.far = 20;
    this.#camera.updateProjectionMatrix();
    this.#camera.updateMatrixWorld(true);
    const { background } = scene;
    const { onBeforeRender } = mirror;
    scene.background = null;
    scene.overrideMaterial = this.#material;
    mirror.onBeforeRender = () => undefined;
    scene.traverse((object) => { if (object.userData['noDepth'] === true) object.visible = false; });
    this.renderer.setRenderTarget(this.#target);
    this.renderer.render(scene, this.#camera);
    this.renderer.readRenderTargetPixels(this.#target, 0, 0, HEIGHT, WIDTH, this.#upright);
    this.renderer.setRenderTarget(null);
    scene.traverse((object) => { if (object.userData['noDepth'] === true) object.visible = true; });
    scene.overrideMaterial = null;
    scene.background = background;
    mirror.onBeforeRender = onBeforeRender;
  }

  #sensed_mm(right: number, down: number): number {
    const at = (x: number, y: number): number => this.#upright[(WIDTH - 1 - y) * HEIGHT + x] ?? 0;
    const z_m = at(right, down);
    if (this.exact || z_m === 0) return Math.min(Math.round(1000 * z_m), 65535);
    const beside = [
      at(Math.min(right + 1, HEIGHT - 1), down), at(right, Math.min(down + 1, WIDTH - 1)),
    ];
    const edge = beside.some((other) => other > EDGE * z_m || z_m > EDGE * other);
    if (edge && this.#random() < 0.5) return 0;
    // The sum of three uniform numbers is near enough to a normal one.
    const noise = 2 * (this.#random() + this.#random() + this.#random() - 1.5);
    return Math.min(Math.max(Math.round(1000 * (z_m + NOISE_M * z_m * z_m * noise)), 1), 65535);
  }
}
