/**
 * The phone's camera: a WebXR session with camera access and depth. The session is our own, with an
 * `XRWebGLLayer`; docs/capture.md says which browsers have it.
 */

import {
  identity, pinholeOfProjection, pinholeScratch, worldFromCamOfWebXr, type Cam, type Camera,
  type World,
} from '../geometry';
import { depthMapOf, known, type DepthFormat, type RawDepth } from './depth';
import {
  SourceError, type DepthMap, type FrameSource, type LiveFrame, type SourceKind, type Viewport,
  type WorldResets,
} from './frame_source';
import { GpuDepthReader, type DepthTexture } from './gpu_depth';
import { sessionInit } from './session_init';
import { WorldOrigin } from './world_origin';

/** Raw camera access, which the types do not know yet. */
interface CameraView extends XRView {
  readonly camera?: { readonly width: number; readonly height: number } | null;
}

interface CameraBinding {
  getCameraImage(camera: { readonly width: number; readonly height: number }): WebGLTexture | null;
  /** Depth as a texture. */
  getDepthInformation(view: XRView): DepthTexture | null;
}

interface DepthFrame {
  /** Depth in memory. */
  getDepthInformation(view: XRView): RawDepth | null;
}

/** Depth sensing, which the types do not know yet; all is undefined where it was not granted. */
interface DepthSession {
  readonly depthUsage?: 'cpu-optimized' | 'gpu-optimized';
  readonly depthDataFormat?: DepthFormat;
}

export interface WebXrOptions {
  readonly kind?: SourceKind;
  readonly label?: string;
  /** What stays visible over the camera's picture: the page's own controls. */
  readonly overlay: Element | null;
  /** Of an emulated camera: a number that changes when its picture does. */
  readonly pictureId?: () => number;
}

/** `run` must be called from a click or tap: browsers begin augmented reality only then. */
export function webXrSource(options: WebXrOptions): FrameSource {
  return {
    kind: options.kind ?? 'webxr',
    label: options.label ?? 'camera of this device',
    run: (gl, onFrame, signal) => run(options, gl, onFrame, signal),
  };
}

async function run(
  options: WebXrOptions, gl: WebGL2RenderingContext, onFrame: (frame: LiveFrame) => void,
  signal: AbortSignal,
): Promise<void> {
  const session = await requestSession(options.overlay);
  try {
    await gl.makeXRCompatible();
    const layer = new XRWebGLLayer(session, gl, { alpha: false, antialias: false, depth: false });
    await session.updateRenderState({ baseLayer: layer });
    const space = await session.requestReferenceSpace('local');
    using frame = new XrLiveFrame(session, layer, gl, options.pictureId ?? null);
    space.addEventListener('reset', (event) => frame.reset(event.transform?.matrix ?? null));
    await new Promise<void>((resolve, reject) => {
      session.addEventListener('end', () => resolve());
      signal.addEventListener('abort', () => void session.end().catch(() => resolve()));
      const next = (time_ms: number, xrFrame: XRFrame): void => {
        if (signal.aborted) return;
        session.requestAnimationFrame(next);
        try {
          frame.update(time_ms, xrFrame, space);
          onFrame(frame);
        } catch (error) {
          reject(error instanceof Error ? error : new Error(String(error)));
          void session.end();
        }
      };
      session.requestAnimationFrame(next);
    });
  } finally {
    await session.end().catch(() => undefined); // it may have ended by itself
  }
}

async function requestSession(overlay: Element | null): Promise<XRSession> {
  if (!globalThis.isSecureContext) {
    throw new SourceError('Browsers allow camera access only over https or on localhost. Open the '
      + 'https link that the server printed.');
  }
  if (navigator.xr === undefined) {
    throw new SourceError('This browser does not support WebXR. Use Chrome on an Android phone, or '
      + 'try the virtual phone.');
  }
  try {
    return await navigator.xr.requestSession('immersive-ar', sessionInit(overlay));
  } catch (error) {
    const name = error instanceof DOMException ? error.name : '';
    throw new SourceError(sentenceOf(name), { cause: error });
  }
}

function sentenceOf(name: string): string {
  switch (name) {
    case 'NotSupportedError':
      return 'This device does not support augmented reality with camera access. Install "Google '
        + 'Play Services for AR" and use Chrome for Android. The page /check has details.';
    case 'SecurityError':
    case 'NotAllowedError':
      return 'Camera access was denied. Allow it in the settings of this page (the icon next to the '
        + 'address), then start again.';
    case 'InvalidStateError':
      return 'Another page is using augmented reality. Close it, then start again.';
    default:
      return 'The camera could not be started. The page /check shows what this browser supports.';
  }
}

/** Null while the position is a guess: the device turns with the phone, but does not know where. */
function viewWithCamera(pose: XRViewerPose | undefined): CameraView | null {
  if (pose?.emulatedPosition === true) return null;
  const views = pose?.views as readonly CameraView[] | undefined;
  for (let i = 0; i < (views?.length ?? 0); i += 1) {
    const view = views?.[i];
    if (view?.camera != null) return view;
  }
  return null;
}

class XrLiveFrame implements LiveFrame, Disposable {
  time_ms = 0;
  camera: Camera | null = null;
  image: WebGLTexture | null = null;
  framebuffer: WebGLFramebuffer | null = null;
  viewport: Viewport = { x: 0, y: 0, width: 1, height: 1 };

  readonly told = {
    worldFromView: null as Float32Array | null,
    projection: null as Float32Array | null,
    resets: [] as (Float32Array | null)[],
    depth: (): { readonly raw: RawDepth; readonly format: DepthFormat } | null => {
      const raw = this.#rawDepth();
      const format = (this.session as DepthSession).depthDataFormat;
      return raw !== null && format !== undefined && 'data' in raw ? { raw, format } : null;
    },
  };

  readonly #origin = new WorldOrigin();
  /** Resets that came since the last frame. */
  readonly #came: (Float32Array | null)[] = [];
  readonly #binding: CameraBinding;
  /** Of every frame; written anew each time. */
  readonly #pinhole = pinholeScratch();
  readonly #worldFromCam = identity<World, Cam>();
  readonly #camera: Camera = { pinhole: this.#pinhole, worldFromCam: this.#worldFromCam };
  #gpuDepth: GpuDepthReader | null = null;
  #xrFrame: XRFrame | null = null;
  #view: XRView | null = null;

  constructor(
    private readonly session: XRSession,
    private readonly layer: XRWebGLLayer,
    private readonly gl: WebGL2RenderingContext,
    private readonly idOfPicture: (() => number) | null,
  ) {
    this.#binding = new XRWebGLBinding(session, gl) as unknown as CameraBinding;
  }

  get resets(): WorldResets {
    return this.#origin.resets;
  }

  get pictureId(): number | null {
    return this.idOfPicture?.() ?? null;
  }

  reset(matrix: Float32Array | null): void {
    this.#origin.reset(matrix);
    this.#came.push(matrix);
  }

  update(time_ms: number, xrFrame: XRFrame, space: XRReferenceSpace): void {
    this.time_ms = time_ms;
    this.#xrFrame = xrFrame;
    this.framebuffer = this.layer.framebuffer;
    const view = viewWithCamera(xrFrame.getViewerPose(space));
    this.#view = view;
    this.told.resets.length = 0;
    this.told.resets.push(...this.#came.splice(0));
    this.told.worldFromView = view?.transform.matrix ?? null;
    this.told.projection = view?.projectionMatrix ?? null;
    if (view?.camera == null) {
      this.camera = null;
      this.image = null;
      return;
    }
    this.viewport = this.layer.getViewport(view) ?? this.viewport;
    const { width, height } = view.camera;
    pinholeOfProjection(view.projectionMatrix, width, height, this.#pinhole);
    worldFromCamOfWebXr(view.transform.matrix, this.#worldFromCam);
    this.#origin.follow(this.#worldFromCam);
    this.camera = this.#camera;
    this.image = this.#binding.getCameraImage(view.camera);
  }

  hasDepth(): boolean {
    return this.#rawDepth() !== null;
  }

  depth(): DepthMap | null {
    const raw = this.#rawDepth();
    const format = (this.session as DepthSession).depthDataFormat;
    if (raw === null || format === undefined || this.camera === null) return null;
    const { width_px, height_px } = this.camera.pinhole;
    if ('data' in raw) return known(depthMapOf(raw, format, width_px / height_px));
    this.#gpuDepth ??= new GpuDepthReader(this.gl);
    return known(this.#gpuDepth.read(raw, format, width_px / height_px));
  }

  [Symbol.dispose](): void {
    this.#gpuDepth?.[Symbol.dispose]();
  }

  #rawDepth(): RawDepth | DepthTexture | null {
    if (this.#xrFrame === null || this.#view === null) return null;
    try {
      return (this.session as DepthSession).depthUsage === 'gpu-optimized'
        ? this.#binding.getDepthInformation(this.#view)
        : (this.#xrFrame as unknown as DepthFrame).getDepthInformation(this.#view);
    } catch {
      // Not granted, or not for this frame: there is no depth, which is a state and not a fault.
      return null;
    }
  }
}
