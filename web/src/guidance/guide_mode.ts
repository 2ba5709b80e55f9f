/** The guided capture on the capture page: session, marks and panel together. */

import type { CaptureSession } from '../capture/capture_session';
import { cameraOfWire } from '../geometry';
import type { LiveView } from '../live_view';
import type { Look } from '../render/view_renderer';
import type { LiveFrame } from '../sources/frame_source';
import { GuidePanel } from '../ui/guide_panel';
import { GuideSession, type GuideMemory, type GuideState } from './guide_session';
import type { GuideOptions } from './guide_options';
import { GuideMarks } from './marks';

export class GuideMode {
  readonly #session: GuideSession;
  readonly #marks: GuideMarks;
  readonly #panel: GuidePanel;
  #problem: string | null = null;
  /** Views that the automatic shutter has asked for and that are not listed yet. */
  #asked = false;
  #views: CaptureSession['views'] | null = null;
  #cameras: { readonly camera: ReturnType<typeof cameraOfWire> }[] = [];

  /**
   * @param shoot Take a view.
   * @param remembers Whether the room is still the same after a reload.
   */
  constructor(
    gl: WebGL2RenderingContext, overlay: HTMLElement, options: GuideOptions,
    private readonly live: LiveView, private readonly shoot: () => void, remembers: boolean,
  ) {
    document.body.classList.add('guided');
    this.#session = new GuideSession(
      options, live.options, remembers ? memoryOf(live.session.id) : NO_MEMORY);
    this.#marks = new GuideMarks(gl, options.kind);
    this.#panel = new GuidePanel(overlay, options.kind, {
      place: () => this.press(),
      scanAgain: () => this.#session.scanAgain(),
      setAutoShutter: (on) => { this.#session.autoShutter = on; },
    });
    live.look = this.look(live.look);
  }

  get state(): GuideState {
    return this.#session.state;
  }

  /** The live picture alone: no double and no red. */
  look(look: Look): Look {
    return { ...look, overlay: 'video', peakOpacity: 0 };
  }

  /** Whether the shutter does anything now. */
  get canPress(): boolean {
    return this.state.phase !== 'scan' || this.state.zMin_m !== null;
  }

  /** The shutter: ends the scan, and takes views after it. */
  press(): void {
    if (this.state.phase === 'scan') {
      this.#problem = this.#session.place(this.live.state.camera);
    } else this.shoot();
  }

  /** To be called for every frame, after the live picture was drawn. */
  draw(frame: LiveFrame): void {
    const { views } = this.live.session;
    if (views !== this.#views) {
      if (views.length !== this.#cameras.length) this.#asked = false;
      this.#views = views;
      this.#cameras = views.map((view) => ({ camera: cameraOfWire(view.camera) }));
    }
    const state = this.#session.update(frame.time_ms, frame.camera, frame, this.#cameras);
    if (frame.camera !== null) this.#marks.draw(frame, frame.camera, state);
    if (state.phase !== 'scan') this.#problem = null;
    this.#panel.show(frame.time_ms, state, this.#session.autoShutter, this.#problem);
    const { hindrance } = this.live.state;
    if (hindrance === null && !this.#asked && this.#session.held(frame.time_ms)) {
      this.#asked = true;
      this.shoot();
    } else if (state.reach === null) this.#asked = false;
  }
}

const NO_MEMORY: GuideMemory = { load: () => null, save: () => undefined };

/** Of one session, in this browser. */
function memoryOf(sessionId: string): GuideMemory {
  const key = `peaking.guide.${sessionId}`;
  return {
    load: () => {
      try {
        return localStorage.getItem(key);
      } catch {
        return null; // storage is switched off: a reload begins with the scan
      }
    },
    save: (text) => {
      try {
        if (text === null) localStorage.removeItem(key);
        else localStorage.setItem(key, text);
      } catch {
        // As above.
      }
    },
  };
}
