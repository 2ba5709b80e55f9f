/**
 * A phone in a drawn room: an emulated WebXR device (IWER) with a camera picture, camera access and
 * depth, so that the very same client code runs without a phone.
 *
 * IWER knows headsets: two views, no camera access, and depth as headsets have it. What phones do
 * differently is put over it here.
 */

import { Euler, LinearToneMapping, PerspectiveCamera, Quaternion, WebGLRenderer } from 'three';
import { XRDevice, type XRDeviceConfig } from 'iwer';
import type { FrameSource, LiveFrame } from '../frame_source';
import type { RawDepth } from '../depth';
import { webXrSource } from '../webxr';
import { ArcoreDepth } from './arcore_depth';
import { PhoneControls, type PhonePose } from './controls';
import { buildRoom, START } from './room';

/** The picture has the paper's aspect, 294:639; phones give more pixels than is worked with. */
export const PICTURE_SIZE = { width_px: 441, height_px: 958 } as const;
const FOV_Y_DEG = 64;

export interface VirtualPhoneOptions {
  /** Holds the canvas, and takes mouse and touch. */
  readonly stage: HTMLElement;
  readonly overlay: Element | null;
  /** Depth without noise and holes, for tests. */
  readonly exactDepth?: boolean;
}

/** For tests and demonstrations: moves the phone by hand. */
export interface VirtualPhone {
  readonly source: FrameSource;
  readonly pose: PhonePose;
  /** world_from_cam of the room, `[R | t]` with OpenCV axes; a rotation without roll. */
  setPose(worldFromCam: readonly number[]): void;
  /** Let the room be so many times as bright. */
  setLight(times: number): void;
  /** Pretend that tracking is lost. */
  setTracked(tracked: boolean): void;
  /** Let the device find itself again: its world gets an origin that is moved by so much, and it says so. */
  moveOrigin(x_m: number, y_m: number, z_m: number): void;
  /** Let the device err: it says that it is so far from where it is, and turned about the vertical. */
  setDrift(x_m: number, y_m: number, z_m: number, yaw_rad: number): void;
}

type Patch = Record<string, unknown>;

/** Take over `navigator.xr` of this page. To be called once. */
export function installVirtualPhone(options: VirtualPhoneOptions): VirtualPhone {
  const pose: PhonePose = {
    x_m: START.x_m, y_m: START.y_m, z_m: START.z_m, yaw_rad: 0, pitch_rad: START.pitch_rad,
  };
  const controls = new PhoneControls(pose);
  const camera = new DrawnCamera(options.exactDepth ?? false);
  const style = options.stage.getAttribute('style') ?? '';
  const device = new XRDevice(CONFIG, {
    ipd: 0,
    stereoEnabled: false,
    fovy: (FOV_Y_DEG * Math.PI) / 180,
    canvasContainer: options.stage as HTMLDivElement,
  });
  options.stage.setAttribute('style', style); // IWER fills the window with it
  device.installRuntime({ forceInstall: true, polyfillLayers: false } as Parameters<
    typeof device.installRuntime>[0]);
  const phone: Phone = { tracked: true, space: null };
  const drift = { x_m: 0, y_m: 0, z_m: 0, yaw_rad: 0 };
  let last_ms = 0;

  /** IWER asks its environment to be drawn at the beginning of every frame. */
  class DrawnEnvironment {
    readonly version = '0';
    readonly trackedPlanes = new Set();
    readonly trackedMeshes = new Set();
    readonly environmentCanvas = camera.canvas;

    render(now_ms: number): void {
      controls.advance(Math.min(now_ms - last_ms, 100));
      last_ms = now_ms;
      device.position.set(pose.x_m + drift.x_m, pose.y_m + drift.y_m, pose.z_m + drift.z_m);
      camera.moveTo(pose);
      const turned = camera.turned(pose.pitch_rad, pose.yaw_rad + drift.yaw_rad);
      device.quaternion.set(turned.x, turned.y, turned.z, turned.w);
      const app = device.appCanvas ?? canvasIn(options.stage);
      if (app !== null && (app.width !== PICTURE_SIZE.width_px || app.height !== PICTURE_SIZE.height_px)) {
        app.width = PICTURE_SIZE.width_px;
        app.height = PICTURE_SIZE.height_px;
      }
      camera.draw();
    }

    computeDepthBuffer(): null { return null; }

    computeHitTestResults(): [] { return []; }

    loadEnvironment(): void { /* there is only one */ }

    loadDefaultEnvironment(): void { /* there is only one */ }

    deleteAll(): void { /* nothing is tracked */ }
  }
  device.installSEM(DrawnEnvironment as unknown as Parameters<typeof device.installSEM>[0]);
  device.position.set(pose.x_m, pose.y_m, pose.z_m);
  behaveLikeAPhone(camera, phone);
  const source = webXrSource({
    kind: 'virtual', label: 'virtual phone', overlay: options.overlay,
    pictureId: () => camera.drawn,
  });
  return {
    source: {
      ...source,
      run(gl, onFrame, signal) {
        const stop = new AbortController();
        signal.addEventListener('abort', () => stop.abort());
        controls.attach(options.stage, stop.signal);
        keepIwerFromWaiting(gl);
        const pace = new Pace(gl);
        const paced = (frame: LiveFrame): void => {
          if (!pace.mayDraw()) return;
          onFrame(frame);
          pace.drawn();
        };
        return source.run(gl, paced, signal).finally(() => stop.abort());
      },
    },
    pose,
    setPose: (worldFromCam) => setPose(pose, worldFromCam),
    setLight: (times) => camera.setLight(times),
    setTracked: (tracked) => { phone.tracked = tracked; },
    moveOrigin: (x_m, y_m, z_m) => {
      drift.x_m -= x_m;
      drift.y_m -= y_m;
      drift.z_m -= z_m;
      const matrix = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x_m, y_m, z_m, 1);
      phone.space?.dispatchEvent(Object.assign(new Event('reset'), { transform: { matrix } }));
    },
    setDrift: (x_m, y_m, z_m, yaw_rad) => { Object.assign(drift, { x_m, y_m, z_m, yaw_rad }); },
  };
}

/**
 * At every frame IWER asks the context for its clear values, which waits until the card has done
 * all it was told to, and clears the picture, which would flicker where a frame is left out.
 */
function keepIwerFromWaiting(gl: WebGL2RenderingContext): void {
  const getParameter = gl.getParameter.bind(gl) as (name: GLenum) => unknown;
  const known = new Map<GLenum, unknown>([
    [gl.COLOR_CLEAR_VALUE, new Float32Array(4)], [gl.DEPTH_CLEAR_VALUE, 1],
    [gl.STENCIL_CLEAR_VALUE, 0],
  ]);
  gl.getParameter = (name: GLenum) => (known.has(name) ? known.get(name) : getParameter(name));
  const clear = gl.clear.bind(gl);
  gl.clear = (mask: GLbitfield) => {
    if ((mask & gl.STENCIL_BUFFER_BIT) === 0) clear(mask); // only IWER clears a stencil buffer
  };
}

/**
 * Leaves a frame out while the card still works on the one before. Phones' own frame loops wait for
 * the card; a page's does not, and without a graphics card everything else would wait in its queue.
 */
class Pace {
  #fence: WebGLSync | null = null;

  constructor(private readonly gl: WebGL2RenderingContext) {}

  mayDraw(): boolean {
    if (this.#fence === null) return true;
    const { gl } = this;
    const status = gl.clientWaitSync(this.#fence, 0, 0);
    if (status === gl.TIMEOUT_EXPIRED) return false;
    gl.deleteSync(this.#fence);
    this.#fence = null;
    return true;
  }

  drawn(): void {
    this.#fence = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush();
  }
}

/** The camera of the phone: draws the room for a pose. */
class DrawnCamera {
  readonly #renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  readonly #room = buildRoom();
  readonly #camera = new PerspectiveCamera(
    FOV_Y_DEG, PICTURE_SIZE.width_px / PICTURE_SIZE.height_px, 0.05, 20);
  readonly #euler = new Euler(0, 0, 0, 'YXZ');
  readonly #turned = new Quaternion();
  readonly #depth: ArcoreDepth;
  /** Where the picture was drawn from: position and quaternion. */
  readonly #drawnAt = new Float64Array(7).fill(NaN);

  constructor(exactDepth: boolean) {
    this.#renderer.setPixelRatio(1);
    this.#renderer.setSize(PICTURE_SIZE.width_px, PICTURE_SIZE.height_px, false);
    this.#depth = new ArcoreDepth(this.#renderer, this.#room, exactDepth);
  }

  get canvas(): HTMLCanvasElement {
    return this.#renderer.domElement;
  }

  moveTo(pose: PhonePose): void {
    this.#camera.position.set(pose.x_m, pose.y_m, pose.z_m);
    this.#camera.quaternion.setFromEuler(this.#euler.set(pose.pitch_rad, pose.yaw_rad, 0));
    this.#camera.updateMatrixWorld(true);
  }

  /** The turn of a phone; written anew by the next call. */
  turned(pitch_rad: number, yaw_rad: number): { x: number; y: number; z: number; w: number } {
    return this.#turned.setFromEuler(this.#euler.set(pitch_rad, yaw_rad, 0));
  }

  /** So many times as bright as the room is. */
  setLight(times: number): void {
    this.#renderer.toneMapping = LinearToneMapping;
    this.#renderer.toneMappingExposure = times;
    this.#drawnAt.fill(NaN);
  }

  /** Goes up when the picture is drawn anew, which it only is when the phone has moved. */
  drawn = 0;

  draw(): void {
    this.#depth.tick();
    if (!this.#hasMoved()) return;
    this.drawn += 1;
    this.#renderer.render(this.#room.scene, this.#camera);
  }

  depth(): RawDepth | null {
    return this.#depth.of(this.#camera);
  }

  #hasMoved(): boolean {
    const { position: p, quaternion: q } = this.#camera;
    const before = this.#drawnAt;
    if (before[0] === p.x && before[1] === p.y && before[2] === p.z && before[3] === q.x
      && before[4] === q.y && before[5] === q.z && before[6] === q.w) return false;
    p.toArray(before);
    q.toArray(before, 3);
    return true;
  }
}

interface Phone {
  tracked: boolean;
  /** That poses are told in. */
  space: EventTarget | null;
}

/** One view, a camera picture behind it, and ARCore's depth. */
function behaveLikeAPhone(camera: DrawnCamera, phone: Phone): void {
  const picture = { width: PICTURE_SIZE.width_px, height: PICTURE_SIZE.height_px };
  const patched = globalThis as unknown as Record<'XRView' | 'XRFrame' | 'XRSession', {
    prototype: Patch;
  }> & { XRWebGLBinding: unknown };
  Object.defineProperty(patched.XRView.prototype, 'camera', {
    configurable: true, get: () => picture,
  });
  Object.defineProperty(patched.XRSession.prototype, 'depthDataFormat', {
    configurable: true, get: () => 'luminance-alpha',
  });
  const requestReferenceSpace = patched.XRSession.prototype['requestReferenceSpace'] as (
    this: XRSession, type: string) => Promise<EventTarget>;
  patched.XRSession.prototype['requestReferenceSpace'] = async function kept(this: XRSession, type: string) {
    const space = await requestReferenceSpace.call(this, type);
    if (type === 'local') phone.space = space;
    return space;
  };
  patched.XRFrame.prototype['getDepthInformation'] = () => camera.depth();
  const getViewerPose = patched.XRFrame.prototype['getViewerPose'] as (
    this: XRFrame, space: XRReferenceSpace) => XRViewerPose | null;
  patched.XRFrame.prototype['getViewerPose'] = function one(
    this: XRFrame, space: XRReferenceSpace,
  ): XRViewerPose | null {
    const pose = phone.tracked ? getViewerPose.call(this, space) : null;
    const view = pose?.views[0];
    if (pose == null || view === undefined) return null;
    Object.defineProperty(view, 'eye', { value: 'none', configurable: true });
    Object.defineProperty(pose, 'views', { value: Object.freeze([view]), configurable: true });
    return pose;
  };
  patched.XRWebGLBinding = class {
    #texture: WebGLTexture | null = null;
    #drawn = -1;

    constructor(_session: XRSession, private readonly gl: WebGL2RenderingContext) {}

    getCameraImage(): WebGLTexture {
      const { gl } = this;
      this.#texture ??= gl.createTexture();
      if (this.#drawn === camera.drawn) return this.#texture;
      this.#drawn = camera.drawn;
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, this.#texture);
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true); // bottom row first, as phones give it
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, camera.canvas);
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
      return this.#texture;
    }
  };
}

function setPose(pose: PhonePose, worldFromCam: readonly number[]): void {
  const at = (i: number): number => worldFromCam[i] ?? NaN;
  pose.x_m = at(3);
  pose.y_m = at(7);
  pose.z_m = at(11);
  const ahead = { x: at(2), y: at(6), z: at(10) };
  pose.yaw_rad = Math.atan2(-ahead.x, -ahead.z);
  pose.pitch_rad = Math.asin(Math.min(Math.max(ahead.y, -1), 1));
}

function canvasIn(stage: HTMLElement): HTMLCanvasElement | null {
  return stage.querySelector('canvas');
}

const CONFIG = {
  name: 'Virtual phone',
  controllerConfig: undefined,
  supportedSessionModes: ['inline', 'immersive-ar'],
  supportedFeatures: ['viewer', 'local', 'local-floor', 'unbounded', 'depth-sensing', 'dom-overlay',
    'camera-access'],
  supportedFrameRates: [30],
  isSystemKeyboardSupported: true,
  internalNominalFrameRate: 30,
  environmentBlendModes: { 'immersive-ar': 'alpha-blend' },
  interactionMode: 'screen-space',
  userAgent: globalThis.navigator?.userAgent ?? '',
} as unknown as XRDeviceConfig;
