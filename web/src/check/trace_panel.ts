/** The part of /check that records a trace for a bug report. Nothing is sent. */

import type { FrameSource, LiveFrame } from '../sources/frame_source';
import { webXrSource } from '../sources/webxr';
import { make } from '../ui/dom';
import { reportOf, type Facts } from './findings';
import { TraceRecorder } from './trace_recorder';

const SECONDS = 20;
const CONTENTS = [
  'pictures of what the camera sees, some ten a second: the room, and people in it;',
  'where the phone was, and how far away things were;',
  'when each frame came, and how long it took;',
  'what this browser says of itself (below).',
];

/** `?source=virtual` records the virtual phone in the place of this device, `?seconds=` less than 20. */
export function tracePanel(facts: Facts, query: URLSearchParams): HTMLElement {
  const seconds = Math.min(Math.max(Number(query.get('seconds') ?? SECONDS) || SECONDS, 1), SECONDS);
  const isVirtual = query.get('source') === 'virtual';
  const told = make('pre', {}, 'Asking the browser…');
  const says = tellingOf(facts);
  void says.then((all) => {
    told.textContent = Object.entries(all).map(([name, value]) => `${name}: ${value}`).join('\n');
  });
  const status = make('p', { role: 'status', className: 'quiet' });
  const saved = make('p');
  const record = make('button', { type: 'button', className: 'primary' }, `Record ${seconds} seconds`);
  const canvas = make('canvas');
  const recording = recordingOf(canvas, isVirtual);
  record.onclick = async () => {
    record.disabled = true;
    saved.replaceChildren();
    status.textContent = '';
    try {
      const { blob, text } = await recording(seconds, says);
      status.textContent = text;
      const name = `peaking-trace-${new Date().toISOString().slice(0, 16).replace(/[:T]/g, '-')}.zip`;
      const link = make('a', { className: 'button primary', href: URL.createObjectURL(blob), download: name },
        `Save the trace (${(blob.size / 1e6).toFixed(1)} MB)`);
      saved.replaceChildren(link);
      link.focus();
    } catch (error) {
      status.textContent = error instanceof Error ? error.message : String(error);
    } finally {
      record.disabled = false;
    }
  };
  return make('section', { className: 'trace' },
    make('h2', {}, 'A trace for a bug report'),
    make('p', {}, `Records ${seconds} seconds of this device's camera into one file, in which are:`),
    make('ul', {}, ...CONTENTS.map((line) => make('li', {}, line))),
    make('p', {}, make('b', {}, 'Pictures of the room are in it. '), 'The file is made and stays on this '
      + 'device: nothing is sent. It is a zip: look into it before you attach it to a bug report, where '
      + 'everybody can see it. Play it with: peaking demo FILE.'),
    make('details', {}, make('summary', {}, 'What this browser says of itself'), told),
    make('div', { className: 'row' }, record), status, saved);
}

/** Run a source for a while, with what it sees on the screen. */
function recordingOf(canvas: HTMLCanvasElement, isVirtual: boolean): (
  seconds: number, says: Promise<Readonly<Record<string, string>>>,
) => Promise<{ readonly blob: Blob; readonly text: string }> {
  const stage = make('div', { className: 'stage' });
  const left = make('b');
  const stop = make('button', { type: 'button' }, 'Stop');
  const screen = make('div', { className: 'recording' }, stage, make('div', { className: 'bar' }, left, stop));
  const gl = canvas.getContext('webgl2', { alpha: false, antialias: false, depth: false, xrCompatible: true });
  let source: FrameSource | null = null;
  return async (seconds, says) => {
    if (gl === null) throw new Error('This browser does not support WebGL 2.');
    if (isVirtual) stage.append(canvas);
    document.body.append(screen);
    source ??= isVirtual ? await virtualPhone(stage) : webXrSource({ overlay: screen });
    const end = new AbortController();
    stop.onclick = () => end.abort();
    using recorder = new TraceRecorder(gl, 1000 * seconds);
    using shown = new ShownPicture(gl);
    let until_ms: number | null = null;
    try {
      await source.run(gl, (frame) => {
        const now_ms = performance.now();
        until_ms ??= now_ms + 1000 * seconds;
        left.textContent = `Recording: ${Math.max(0, Math.ceil((until_ms - now_ms) / 1000))} s`;
        recorder.add(frame);
        shown.show(frame);
        if (now_ms >= until_ms) end.abort();
      }, end.signal);
      left.textContent = 'Writing the file…';
      const blob = await recorder.finish(await says);
      if (recorder.pictures === 0) {
        throw new Error(`There is no trace: no picture came. ${recorder.problem ?? ''}`);
      }
      const problem = recorder.problem === null ? '' : ` ${recorder.problem}`;
      return {
        blob, text: `${recorder.frames} frames, ${recorder.pictures} with a picture, `
          + `${recorder.withDepth} of these with depth.${problem}`,
      };
    } finally {
      screen.remove();
    }
  };
}

async function virtualPhone(stage: HTMLElement): Promise<FrameSource> {
  const { installVirtualPhone } = await import('../sources/virtual/phone');
  return installVirtualPhone({ stage, overlay: null }).source;
}

/** What the camera sees, drawn where the device shows it. */
class ShownPicture implements Disposable {
  readonly #framebuffer: WebGLFramebuffer;

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.#framebuffer = gl.createFramebuffer();
  }

  show({ image, camera, framebuffer, viewport: { x, y, width, height } }: LiveFrame): void {
    if (image === null || camera === null) return;
    const { gl } = this;
    const { width_px, height_px } = camera.pinhole;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#framebuffer);
    gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, image, 0);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, framebuffer);
    gl.disable(gl.SCISSOR_TEST);
    gl.blitFramebuffer(0, 0, width_px, height_px, x, y, x + width, y + height, gl.COLOR_BUFFER_BIT, gl.LINEAR);
    gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, null, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  }

  [Symbol.dispose](): void {
    this.gl.deleteFramebuffer(this.#framebuffer);
  }
}

/** User agent client hints, which the types do not know yet. */
interface Hints {
  getHighEntropyValues(names: readonly string[]): Promise<Readonly<Record<string, unknown>>>;
}

async function tellingOf(facts: Facts): Promise<Record<string, string>> {
  const { userAgentData, deviceMemory } = navigator as Navigator & {
    readonly userAgentData?: Hints; readonly deviceMemory?: number;
  };
  const gl = document.createElement('canvas').getContext('webgl2');
  const info = gl?.getExtension('WEBGL_debug_renderer_info');
  const hints = await userAgentData?.getHighEntropyValues(['model', 'platformVersion', 'uaFullVersion'])
    .catch(() => null);
  const said: Record<string, unknown> = {
    browser: navigator.userAgent,
    model: hints?.['model'],
    system: hints?.['platformVersion'],
    version: hints?.['uaFullVersion'],
    screen: `${screen.width} x ${screen.height}, ${devicePixelRatio} pixels each, ${screen.orientation?.type}`,
    processors: navigator.hardwareConcurrency,
    memory_gb: deviceMemory,
    graphics: gl?.getParameter(info?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER),
    check: reportOf(facts).split('\n').slice(0, -1).join('; '),
  };
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  return Object.fromEntries(Object.entries(said).flatMap(([name, value]) =>
    (value == null || value === '' ? [] : [[name, String(value)]])));
}
