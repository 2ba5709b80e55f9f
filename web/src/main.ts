/** The capture page: the only file that knows all the others. */

import { AUTO_WAITS, AutoShutter, type AutoHindrance, type AutoMoment } from './capture/auto_shutter';
import { CaptureDb } from './capture/capture_db';
import { CaptureSession, type CapturedView } from './capture/capture_session';
import type { PictureFault } from './capture/picture_gate';
import { whyNoCapture } from './check/findings';
import { probe } from './check/probe';
import { chooseSource, isStandIn, type SourceChoice } from './choose_source';
import { openExtension } from './extension_registry';
import { GuideMode } from './guidance/guide_mode';
import { guideOptionsOf } from './guidance/guide_options';
import type { GuideState } from './guidance/guide_session';
import { NextView, type NextViewMoment } from './next_view/next_view';
import { LiveView, type Hindrance, type Pace, type Shot } from './live_view';
import { governorOf, type Allowance } from './render/governor';
import { Api } from './server/api';
import { Warmth } from './server/warmth';
import { WHOLE } from './render/shares';
import type { FrameSource, LiveFrame } from './sources/frame_source';
import { ReplayControls, replaySource } from './sources/replay';
import type { VirtualPhone } from './sources/virtual/phone';
import { webXrSource } from './sources/webxr';
import type { TrackingState } from './tracking/pose_correction';
import { Hud, type HudState } from './ui/hud';
import { UNRESTRICTED } from './ui/hud_rules';
import { PictureOnPage } from './ui/picture_fit';
import { FREELY, GUIDED, StartPage } from './ui/start_page';
import { onTouch } from './ui/touch';
import { WHY_UNFIXABLE } from './ui/words';
import { showBeside } from './view/beside';
import type { Guidance, GuidedPlace } from './wire';

/** For tests, benchmarks, and people with the developer tools open. */
export interface Inspection {
  frames(): number;
  canShoot(): boolean;
  seen(): LiveView['state']['seen'];
  views(): readonly { readonly id: string; readonly number: number | null; readonly state: string }[];
  tracking(): TrackingState & {
    readonly succeeded: number; readonly failed: number; readonly took_ms: number | null;
  };
  pace(): Pace;
  allow(allowance: Allowance): void;
  timeline(): ReturnType<LiveView['timeline']['all']>;
  resident(): { readonly bytes: number; readonly views: number };
  readonly phone: VirtualPhone | null;
  /** Of a guided capture; null without a guide. */
  guide(): GuideState | null;
  /** The newest guidance of the server, and the one place that is suggested now. */
  guidance(): Guidance | null;
  suggested(): GuidedPlace | null;
}

declare global {
  interface Window { peaking?: Inspection }
}

/** Said before a picture is taken, and of one that was. */
const FAULTS: Readonly<Record<PictureFault, string>> = {
  blurred: 'Blurred. Hold still.',
  'too-dark': 'Too dark: noise hides the detail. Switch on a light.',
  'too-bright': 'Too bright: much of it is white. Turn away from the light.',
};
const HINDRANCES: Readonly<Record<NonNullable<Hindrance> | PictureFault, string | null>> = {
  ...FAULTS,
  'server-not-ready': null, // said below
  'no-picture': 'Waiting for the camera',
  'tracking-lost': 'Tracking lost. Move slowly and point the camera at something with texture.',
  'no-depth': 'No depth yet. Move the phone slightly from side to side.',
  'too-fast': 'Move more slowly to avoid blur.',
  busy: null,
};
/** What is offered where this device's own camera cannot be used. */
const STAND_INS: Readonly<Record<SourceChoice['kind'], string>> = {
  webxr: '', replay: 'Play the recording', virtual: 'Try the virtual phone',
};
const FINISHED = 'This session is finished: its views are saved. Finish, then "Take more views", goes on '
  + 'with it.';
const BY_TOUCH = 'Drag to look around. Two fingers carry the phone; spread them to step closer.';
/** A notice comes only when what hinders has lasted, so that nothing flickers. */
const NOTICE_AFTER_MS = 700;

interface Source {
  readonly source: FrameSource;
  readonly phone: VirtualPhone | null;
  readonly replay: ReplayControls | null;
}

async function main(): Promise<void> {
  const stage = elementOf('stage');
  const overlay = elementOf('overlay');
  const start = new StartPage(overlay);
  try {
    await capture(stage, overlay, start);
  } catch (error) {
    start.fail(error instanceof Error ? error.message : String(error), () => location.reload());
    throw error;
  }
}

async function capture(stage: HTMLElement, overlay: HTMLElement, start: StartPage): Promise<void> {
  const api = new Api();
  await api.pairFromHash();
  const info = await api.server();
  const query = new URLSearchParams(location.search);
  const choice = chooseSource(query, info.recordings, await canDoAr());
  const extension = await openExtension({ api, query, source: choice.kind });
  const rules = extension ?? UNRESTRICTED;
  const guideOptions = guideOptionsOf(query);
  for (const key of document.querySelectorAll<HTMLElement>('[data-only]')) {
    key.hidden = key.dataset['only'] !== choice.kind;
  }
  // Who takes part in a study is shown what its organiser chose.
  if (extension === null && isStandIn(choice, matchMedia('(pointer: coarse) and (hover: none)').matches)) {
    const why = whyNoCapture(await probe(api));
    if (why !== null) await start.standIn(why, STAND_INS[choice.kind]);
  }
  const { source, phone, replay } = await sourceOf(choice, api, stage, overlay, query);
  const session = await CaptureSession.open({
    api,
    db: await CaptureDb.open(),
    source: choice.kind,
    name: extension?.session.name ?? nameOf(choice),
    device: navigator.userAgent.slice(0, 400),
    sessionId: extension?.session.id ?? query.get('session'),
    resume: extension === null && choice.kind !== 'webxr',
  });
  const gl = contextOf(stage);
  let problem: string | null = null;
  const live = new LiveView(gl, info.options, session, (sentence) => { problem = sentence; });
  live.look = { ...live.look, threshold: info.options.error_threshold };
  live.governor = governorOf(query, info.options);
  const isOver = (): boolean => extension === null && session.snapshot.finished !== 'no';
  const shotOf = (automatic: boolean): Shot => ({
    automatic,
    kept: () => { problem = null; hud.confirm(); },
    faulty: (fault, id) => {
      if (id !== null && rules.offersHelp) hud.answer(FAULTS[fault], { label: 'Take it back', act: () => void session.undo(id) });
    },
  });
  const byHand = shotOf(false);
  const byItself = shotOf(true);
  const mayShoot = (): boolean => rules.mayShoot && !isOver();
  const shoot = (): void => { if (mayShoot()) live.shoot(byHand); };
  const guide = guideOptions === null ? null
    : new GuideMode(gl, overlay, guideOptions, live, shoot, choice.kind !== 'webxr');
  if (guide !== null) live.drawAlways();
  const auto = new AutoShutter();
  // A guide says where views are taken, a study's protocol when.
  const mayBeAuto = guide === null && extension === null;
  auto.on = mayBeAuto && query.get('auto') === 'on';
  const hud = new Hud(overlay, {
    setAuto: (on) => { auto.on = on && mayBeAuto; },
    shoot: () => (guide === null ? shoot() : guide.press()),
    undo: (id) => void session.undo(id),
    undoLast: () => {
      const last = session.views.at(-1);
      if (last !== undefined) void session.undo(last.id);
    },
    restore: (id) => void session.restore(id),
    retry: (id) => void session.retry(id),
    setLook: (look) => { live.look = guide?.look(look) ?? look; },
    finish: (name) => void session.finish(name),
    takeMore: () => void session.reopen(),
    selection: (signal) => session.selection(signal),
    dataset: (asked) => session.dataset(asked),
    newSession: () => beginAnew(query),
    viewer: () => `./view#${session.id}`,
  }, replay, rules);
  extension?.attach({ live, session, overlay });
  const picture = new PictureOnPage(choice.kind === 'webxr' ? null : stage.querySelector('canvas'));
  // A guide says where views are taken, a study's protocol what is shown.
  const nextView = guide === null && extension === null ? new NextView(overlay, session, picture) : null;
  // Who takes part in a study sees what its organiser chose.
  if (extension === null && choice.kind !== 'webxr') showBeside(api, session, info.options, elementOf('beside'));
  window.peaking = inspectionOf(live, session, phone, guide, nextView);
  let visible = WHOLE;
  onTouch(window, (clientX, clientY) => {
    const place = rules.showsRed && !rules.covered ? picture.placeAt(clientX, clientY) : null;
    const why = place === null ? null : live.whyUnfixable(...place);
    if (why !== null) hud.answer(WHY_UNFIXABLE[why]);
  });

  if (choice.kind === 'virtual' && matchMedia('(pointer: coarse)').matches) hud.answer(BY_TOUCH);
  const warmth = new Warmth(api, info, () => { live.serverIsReady = warmth.isWarm; });
  live.serverIsReady = warmth.isWarm;
  let connection = session.snapshot.connection;
  session.subscribe((now) => {
    // It may have been started anew.
    if (connection === 'offline' && now.connection === 'online') void warmth.ask();
    connection = now.connection;
  });
  const notices = new Notices(warmth);
  // Written anew at every frame, in which nothing is made.
  const shown: { -readonly [K in keyof HudState]: HudState[K] } = {
    time_ms: 0, look: live.look, peakedShare: null, wrongShare: null, unseenShare: null, towards: null,
    tracking: live.state.tracking, views: [], restorable: [], isOver: false, auto: null, notice: null, gettingReady: null,
    canShoot: false, sessionName: '',
  };
  const moment: { -readonly [K in keyof AutoMoment]: AutoMoment[K] } = {
    time_ms: 0, hindrance: null, fault: null, steady: false, views: 0, ready: 0, peakedShare: null,
  };
  const next: { -readonly [K in keyof NextViewMoment]: NextViewMoment[K] } = { time_ms: 0, camera: null, quiet: false };
  const loading = overlay.querySelector('.loading');
  const onFrame = (frame: LiveFrame): void => {
    loading?.remove();
    if (picture.visible !== visible) {
      visible = picture.visible;
      live.visible = visible;
    }
    live.draw(frame);
    if (extension?.showsGuide !== false) guide?.draw(frame);
    const { seen, hindrance, fault, camera, jumped } = live.state;
    const { trouble, storageProblem, name, views, restorable } = session.snapshot;
    shown.time_ms = frame.time_ms;
    shown.look = live.look;
    shown.peakedShare = seen?.peakedShare ?? null;
    const isApart = info.options.marks === 'apart';
    shown.wrongShare = isApart ? seen?.wrongShare ?? null : null;
    shown.unseenShare = isApart ? seen?.unseenShare ?? null : null;
    shown.towards = isApart && nextView?.suggests !== true ? live.state.towards : null;
    shown.views = views;
    shown.restorable = restorable;
    shown.isOver = isOver();
    const said = isOver() ? FINISHED : null;
    const toSay = rules.offersHelp ? fault : null;
    shown.notice = notices.of(frame.time_ms, hindrance ?? toSay, said ?? jumped ?? problem ?? storageProblem ?? trouble);
    shown.gettingReady = warmth.share;
    shown.canShoot = hindrance === null && !isOver() && (guide?.canPress ?? true) && rules.mayPress;
    shown.sessionName = name;
    if (auto.on) {
      moment.time_ms = frame.time_ms;
      moment.hindrance = shown.canShoot ? null : autoHindranceOf(hindrance);
      moment.fault = fault;
      moment.steady = live.steady;
      moment.views = views.length;
      moment.ready = readyOf(views);
      moment.peakedShare = shown.peakedShare;
      if (auto.look(moment) && mayShoot()) live.shoot(byItself);
    }
    shown.auto = auto.sentence;
    hud.show(shown);
    if (nextView !== null) {
      next.time_ms = frame.time_ms;
      next.camera = camera;
      next.quiet = isOver();
      nextView.onFrame(next);
    }
    extension?.onFrame(guide?.state ?? null);
    const time_s = Date.now() / 1000;
    if (camera !== null && seen?.peakedShare != null && session.wantsPeaked(time_s)) {
      session.reportPeaked({
        time_s,
        peaked_share: seen.peakedShare,
        wrong_share: seen.wrongShare,
        unseen_share: seen.unseenShare,
        unfixable_share: seen.unfixableShare,
        views: views.length,
        world_from_cam: Array.from(camera.worldFromCam.rows),
      });
    }
  };
  for (;;) {
    if (choice.kind === 'webxr') {
      await start.ask('Start the camera', extension?.task ?? (guide === null ? FREELY : GUIDED));
    }
    await source.run(gl, onFrame, new AbortController().signal);
    await new Promise<void>((resolve) => start.ended(resolve));
    // A new session of WebXR has another origin, so its views are no neighbours of the old ones.
    if (choice.kind === 'webxr') {
      if (extension === null) beginAnew(query);
      else location.reload();
    }
    start.hide();
  }
}

/** What to tell the photographer, once it has lasted for a moment. */
class Notices {
  #hindrance: Hindrance | PictureFault = null;
  #since_ms = 0;

  constructor(readonly warmth: Warmth) {}

  of(time_ms: number, hindrance: Hindrance | PictureFault, trouble: string | null): string | null {
    if (hindrance !== this.#hindrance) {
      this.#hindrance = hindrance;
      this.#since_ms = time_ms;
    }
    if (hindrance !== null && time_ms - this.#since_ms > NOTICE_AFTER_MS) {
      const sentence = HINDRANCES[hindrance];
      if (sentence !== null) return sentence;
    }
    return trouble ?? this.warmth.sentence;
  }
}

async function sourceOf(
  choice: SourceChoice, api: Api, stage: HTMLElement, overlay: HTMLElement, query: URLSearchParams,
): Promise<Source> {
  switch (choice.kind) {
    case 'webxr':
      return { source: webXrSource({ overlay }), phone: null, replay: null };
    case 'replay': {
      const replay = new ReplayControls();
      return { source: replaySource(api, choice.recording ?? '', replay), phone: null, replay };
    }
    case 'virtual': {
      // The drawn room brings three.js with it, which phones need not load.
      const { installVirtualPhone } = await import('./sources/virtual/phone');
      const exactDepth = query.get('depth') === 'exact';
      const phone = installVirtualPhone({ stage, overlay: null, exactDepth });
      return { source: phone.source, phone, replay: null };
    }
    default:
      return choice.kind satisfies never;
  }
}

function autoHindranceOf(hindrance: Hindrance): AutoHindrance {
  return hindrance !== null && hindrance in AUTO_WAITS ? hindrance as AutoHindrance : 'other';
}

function readyOf(views: readonly CapturedView[]): number {
  let ready = 0;
  for (const view of views) if (view.state === 'ready') ready += 1;
  return ready;
}

function contextOf(stage: HTMLElement): WebGL2RenderingContext {
  const canvas = stage.querySelector('canvas');
  const gl = canvas?.getContext('webgl2', {
    alpha: false, antialias: false, depth: false, xrCompatible: true,
    powerPreference: 'high-performance',
  });
  if (gl == null) {
    throw new Error('This browser does not support WebGL 2, which draws the pictures.');
  }
  canvas?.addEventListener('webglcontextlost', () => location.reload());
  return gl;
}

async function canDoAr(): Promise<boolean> {
  return (await navigator.xr?.isSessionSupported('immersive-ar').catch(() => false)) ?? false;
}

function nameOf(choice: SourceChoice): string {
  const when = new Date().toLocaleString([], { dateStyle: 'medium', timeStyle: 'short' });
  switch (choice.kind) {
    case 'webxr': return when;
    case 'virtual': return `Virtual room, ${when}`;
    case 'replay': return `${choice.recording ?? 'Recording'}, ${when}`;
    default: return choice.kind satisfies never;
  }
}

function beginAnew(query: URLSearchParams): void {
  const next = new URLSearchParams(query);
  next.set('session', crypto.randomUUID());
  location.search = next.toString();
}

function inspectionOf(
  live: LiveView, session: CaptureSession, phone: VirtualPhone | null, guide: GuideMode | null,
  nextView: NextView | null,
): Inspection {
  return {
    frames: () => live.frames,
    canShoot: () => live.state.hindrance === null,
    seen: () => live.state.seen,
    views: () => session.views.map(({ id, number, state }) => ({ id, number, state })),
    timeline: () => live.timeline.all(),
    tracking: () => ({
      ...live.state.tracking,
      succeeded: live.tracker.succeeded, failed: live.tracker.failed, took_ms: live.tracker.took_ms,
    }),
    pace: () => live.pace,
    allow: (allowance) => live.allow(allowance),
    resident: () => ({ bytes: live.store.residentBytes, views: live.store.residentCount }),
    phone,
    guide: () => guide?.state ?? null,
    guidance: () => nextView?.newest ?? null,
    suggested: () => nextView?.place ?? null,
  };
}

function elementOf(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element #${id}`);
  return element;
}

void main();
