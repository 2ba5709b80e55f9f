import { afterEach, expect, test, vi } from 'vitest';
import type { LiveFrame } from '../../src/sources/frame_source';
import { webXrSource } from '../../src/sources/webxr';

const IDENTITY = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1);

interface Shown {
  readonly emulatedPosition: boolean;
  readonly depth: readonly number[];
  /** An event `reset` that comes before it. */
  readonly reset?: { readonly transform: { readonly matrix: Float32Array } | null };
}

/** A session that shows some frames, one after the other. */
class Session extends EventTarget {
  readonly depthUsage = 'cpu-optimized';
  readonly depthDataFormat = 'unsigned-short';
  readonly #frames: Shown[];
  readonly #space = new EventTarget();

  constructor(frames: readonly Shown[]) {
    super();
    this.#frames = [...frames];
  }

  async updateRenderState(): Promise<void> { /* nothing to draw on */ }

  async requestReferenceSpace(): Promise<object> { return this.#space; }

  requestAnimationFrame(next: (time_ms: number, frame: object) => void): void {
    const shown = this.#frames.shift();
    if (shown === undefined) return;
    const { reset } = shown;
    if (reset !== undefined) {
      setTimeout(() => this.#space.dispatchEvent(Object.assign(new Event('reset'), reset)));
    }
    setTimeout(next, 0, 0, {
      getViewerPose: () => ({
        emulatedPosition: shown.emulatedPosition,
        views: [{
          camera: { width: 200, height: 100 }, projectionMatrix: IDENTITY,
          transform: { matrix: IDENTITY },
        }],
      }),
      getDepthInformation: () => ({
        width: 2, height: 1, rawValueToMeters: 0.001, data: Uint16Array.from(shown.depth).buffer,
        normDepthBufferFromNormView: { matrix: IDENTITY },
      }),
    });
  }

  async end(): Promise<void> { this.dispatchEvent(new Event('end')); }
}

async function seen<T>(frames: readonly Shown[], look: (frame: LiveFrame) => T): Promise<T[]> {
  const session = new Session(frames);
  vi.stubGlobal('isSecureContext', true);
  vi.stubGlobal('navigator', { xr: { requestSession: async () => session } });
  vi.stubGlobal('XRWebGLLayer', class { framebuffer = null; getViewport(): null { return null; } });
  vi.stubGlobal('XRWebGLBinding', class { getCameraImage(): object { return {}; } });
  const gl = { makeXRCompatible: async () => undefined } as unknown as WebGL2RenderingContext;
  const stop = new AbortController();
  const found: T[] = [];
  await webXrSource({ overlay: null }).run(gl, (frame) => {
    found.push(look(frame));
    if (found.length === frames.length) stop.abort();
  }, stop.signal);
  return found;
}

afterEach(() => vi.unstubAllGlobals());

const depth = [700, 800];

test('while the position is emulated, tracking is lost', async () => {
  const frames = [false, true, true, false].map((emulatedPosition) => ({ emulatedPosition, depth }));
  expect(await seen(frames, ({ camera, image }) => [camera !== null, image !== null]))
    .toEqual([[true, true], [false, false], [false, false], [true, true]]);
});

test('a buffer in which nothing is known is no depth', async () => {
  const frames = [depth, [0, 0], [65535, 0]].map((values) => (
    { emulatedPosition: false, depth: values }));
  expect(await seen(frames, (frame) => frame.depth() !== null)).toEqual([true, false, false]);
});

test('a trace hears what the device said, and each reset once', async () => {
  const moved = Float32Array.from(IDENTITY, (value, i) => (i === 12 ? 3 : value));
  const frames: Shown[] = [
    { emulatedPosition: false, depth },
    { emulatedPosition: true, depth, reset: { transform: { matrix: moved } } },
    { emulatedPosition: false, depth, reset: { transform: null } },
    { emulatedPosition: false, depth },
  ];
  const told = await seen(frames, (frame) => ({
    x: frame.told?.worldFromView?.[12], projection: frame.told?.projection,
    resets: [...frame.told?.resets ?? []], depth: frame.told?.depth(),
  }));
  expect(told.map(({ x }) => x)).toEqual([0, undefined, 0, 0]);
  expect(told.map(({ resets }) => resets)).toEqual([[], [moved], [null], []]);
  expect(told[0]?.projection).toEqual(IDENTITY);
  expect(told[0]?.depth).toMatchObject({ format: 'unsigned-short', raw: { width: 2, height: 1 } });
});
