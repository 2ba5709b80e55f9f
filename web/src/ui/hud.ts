/** What lies over the picture: share of red, coach, views, shutter; and the keys. */

import type { CapturedView } from '../capture/capture_session';
import type { Vector3 } from '../geometry';
import type { Look, Overlay } from '../render/view_renderer';
import type { ReplayControls } from '../sources/replay';
import type { TrackingState } from '../tracking/pose_correction';
import { Coach, NUM_TASKS, ON_ITS_WAY, taskOf, type CoachMoment } from './coach';
import { button, make, say, show } from './dom';
import { EdgeArrow } from './edge_arrow';
import { finishSheet } from './finish_sheet';
import type { HudRules } from './hud_rules';
import { actionOfKey } from './keys';
import { PAPER_PERCENT, percent, ShareHistory } from './share_graph';
import {
  settingsSheet, viewsSheet, VIEW_STATES, type Sheet, type SheetActions, type SheetState,
} from './sheets';
import { trackingText, viewsText } from './words';

export interface HudActions extends SheetActions {
  shoot(): void;
  setAuto(on: boolean): void;
  /** The last one that is there now, which may be ahead of what is shown. */
  undoLast(): void;
}

/** What can be done about what is said. */
export interface Offer {
  readonly label: string;
  act(): void;
}

/** The object may be used again for the next frame; `look` and `views` are new when they change. */
export interface HudState extends SheetState {
  readonly time_ms: number;
  readonly look: Look;
  readonly peakedShare: number | null;
  /** What is shown wrongly, of it; null where it is not marked apart. */
  readonly wrongShare: number | null;
  /** What no view shows; null where it is not marked apart. */
  readonly unseenShare: number | null;
  /** Towards the largest wrong area outside the picture, in axes of the camera; null: none. */
  readonly towards: Vector3 | null;
  /** How far the device's pose is off, as far as is known. */
  readonly tracking: TrackingState;
  /** What the automatic shutter says of itself; null: it is off. */
  readonly auto: string | null;
  /** A sentence about what hinders, or null. */
  readonly notice: string | null;
  /** How far the server is on its first start, 0…1; null: it is ready. */
  readonly gettingReady: number | null;
  readonly canShoot: boolean;
  readonly sessionName: string;
}

const OVERLAYS: readonly (readonly [Overlay, string, string])[] = [
  ['mpi', 'Double', 'Digital double only'],
  ['video', 'Video + red', 'Live video with red'],
  ['peaks', 'Double + red', 'Digital double with red'],
];
const COACH_SEEN = 'peaking.coach-seen';
/** The number changes at most this often, so that it can be read. */
const NUMBER_EVERY_MS = 400;
/** The shutter is not among them: its key is space anyway. */
const PRESSED_BY_SPACE = 'button:not(.shutter), a, summary, input[type=checkbox]';
/** A sentence that was asked for goes away by itself. */
const TOAST_MS = 5000;

export class Hud {
  readonly #root: HTMLElement;
  readonly #actions: HudActions;
  readonly #history = new ShareHistory();
  readonly #coach = new Coach();
  readonly #moment: CoachMoment = { views: 0, ready: 0, peakedShare: null };
  readonly #way: { auto: boolean; readonly isRecording: boolean };
  readonly #share = make('strong', {}, '–');
  readonly #shareName = make('small', {}, 'red');
  readonly #new = make('strong', {}, '–');
  readonly #newPart = make('span', { className: 'new', hidden: true }, this.#new, make('small', {}, 'new'));
  readonly #tracking = make('div', { className: 'tracking' });
  readonly #auto = button('auto', 'Auto', 'Automatic shutter', () => this.#switchAuto());
  readonly #autoSays = make('div', { className: 'auto-says', hidden: true });
  readonly #graph = make('canvas', { width: 264, height: 60 });
  readonly #said = make('span');
  readonly #progress = make('progress', { hidden: true });
  readonly #notice = make('div', { className: 'notice', hidden: true, role: 'status' }, this.#said, this.#progress);
  readonly #toast = make('div', { className: 'notice toast', hidden: true, role: 'status' });
  #toastEnds: ReturnType<typeof setTimeout> | undefined;
  readonly #arrow: EdgeArrow;
  readonly #coachTitle = make('b');
  readonly #coachText = make('span');
  readonly #coachTasks = make('ol', {}, ...Array.from({ length: NUM_TASKS }, () => make('li')));
  readonly #coachBox: HTMLElement;
  readonly #looks = new Map<Overlay, HTMLButtonElement>();
  readonly #strip = make('div', { className: 'strip' });
  readonly #count = button('pill', viewsText(0), 'List of views', () => this.#open('views'));
  readonly #shutter = button('shutter', '', 'Take a view (space)', () => this.#shoot());
  readonly #finish = button('pill', 'Finish', 'Finish the session', () => this.#open('finish'));
  readonly #red: readonly HTMLElement[];
  readonly #flash = make('div', { className: 'flash' });
  readonly #replay: ReplayControls | null;
  readonly #scrub = make('input', { type: 'range', min: '0', step: '1', value: '0' });
  readonly #position = make('output');
  #play: HTMLButtonElement | null = null;
  #shownFrame = -1;
  #shownCount = -1;
  #sheet: Sheet | null = null;
  #state: HudState | null = null;
  #shownViews: readonly CapturedView[] = [];
  #shownRestorable: readonly CapturedView[] = [];
  #shownOver = false;
  #shownLook: Look | null = null;
  #numberAt_ms = -Infinity;

  constructor(
    root: HTMLElement, actions: HudActions, replay: ReplayControls | null, readonly rules: HudRules,
  ) {
    this.#root = root;
    this.#actions = actions;
    this.#replay = replay;
    this.#way = { auto: false, isRecording: replay !== null };
    this.#notice.ariaLive = 'polite';
    this.#progress.ariaLabel = 'How far the server is';
    const meter = make('div', { className: 'meter' },
      make('div', { className: 'shares' }, this.#share, this.#shareName, this.#newPart),
      this.#graph, this.#tracking, this.#autoSays);
    meter.title = 'Wrong: shown otherwise than it is (red). New: never captured (hatched). '
      + `Amber dots: no view will help; touch them to see why. Curve: wrong and new together. Dashed line: the paper's mean, ${PAPER_PERCENT}.`;
    this.#auto.ariaPressed = 'false';
    const tools = make('div', { className: 'tools' }, this.#auto,
      button('', '?', 'Show the introduction again', () => this.#restartCoach()),
      button('', '⚙', 'Settings', () => this.#open('settings')));
    this.#coachBox = make('div', { className: 'coach' }, this.#coachTitle, this.#coachText,
      this.#coachTasks, button('', '✕', 'Hide the introduction', () => this.#endCoach()));
    // Without help everybody sees the same, whatever others did on this phone.
    if (stored(COACH_SEEN) !== null || !rules.offersHelp) this.#coach.task = NUM_TASKS;
    const looks = make('div', { className: 'looks' });
    for (const [overlay, name, label] of OVERLAYS) {
      const each = button('', name, label, () => this.#setOverlay(overlay));
      this.#looks.set(overlay, each);
      looks.append(each);
    }
    const bottom = make('div', { className: 'bottom' }, looks, ...this.#player(), this.#strip,
      make('div', { className: 'shoot' },
        make('div', { className: 'side' }, this.#count), this.#shutter,
        make('div', { className: 'side' }, this.#finish)));
    this.#arrow = new EdgeArrow(root, 'The largest wrong area lies in this direction');
    root.append(this.#flash, make('div', { className: 'top' }, meter, tools), this.#notice, this.#toast,
      this.#coachBox, bottom);
    this.#red = [meter, looks];
    show(tools, rules.offersHelp);
    window.addEventListener('keydown', (event) => this.#key(event));
    // Who presses with a finger or a mouse did not choose where the focus is: space stays the shutter.
    root.addEventListener('click', ({ detail, target }) => {
      if (detail > 0 && target instanceof Element) target.closest<HTMLElement>('button')?.blur();
    });
  }

  #showShares({ peakedShare, wrongShare, unseenShare }: HudState): void {
    const isApart = wrongShare !== null && unseenShare !== null;
    show(this.#newPart, isApart);
    say(this.#shareName, isApart ? 'wrong' : 'red');
    say(this.#share, percent(isApart ? wrongShare : peakedShare));
    if (isApart) say(this.#new, percent(unseenShare));
  }

  #switchAuto(): void {
    this.#actions.setAuto(this.#state?.auto === null);
  }

  #showAuto(sentence: string | null): void {
    const pressed = String(sentence !== null);
    if (this.#auto.ariaPressed !== pressed) this.#auto.ariaPressed = pressed;
    this.#shutter.classList.toggle('automatic', sentence !== null);
    show(this.#autoSays, sentence !== null);
    say(this.#autoSays, sentence ?? '');
  }

  /** Say a sentence for a moment, the answer to a touch, and offer something to do about it. */
  answer(sentence: string, offer: Offer | null = null): void {
    clearTimeout(this.#toastEnds);
    this.#toast.replaceChildren(sentence);
    if (offer !== null) {
      this.#toast.append(button('', offer.label, offer.label, () => {
        show(this.#toast, false);
        offer.act();
      }));
    }
    show(this.#toast, true);
    this.#toastEnds = setTimeout(() => show(this.#toast, false), TOAST_MS);
  }

  /** Show a state; may be called for every frame. */
  show(state: HudState): void {
    this.#state = state;
    if (state.peakedShare !== null && this.#history.add(state.time_ms, state.peakedShare)) {
      this.#history.draw(this.#graph);
    }
    if (state.time_ms - this.#numberAt_ms > NUMBER_EVERY_MS) {
      this.#numberAt_ms = state.time_ms;
      this.#showShares(state);
      say(this.#tracking, trackingText(state.tracking));
    }
    this.#showAuto(state.auto);
    this.#arrow.point(this.rules.showsRed && state.look.overlay !== 'mpi' ? state.towards : null);
    say(this.#said, state.notice ?? '');
    show(this.#progress, state.gettingReady !== null);
    this.#progress.value = state.gettingReady ?? 1;
    show(this.#notice, state.notice !== null);
    if (this.#shutter.disabled === state.canShoot) this.#shutter.disabled = !state.canShoot;
    if (state.look !== this.#shownLook) this.#showLook(state.look);
    this.#follow(this.rules);
    if (state.views !== this.#shownViews || state.restorable !== this.#shownRestorable
      || state.isOver !== this.#shownOver) this.#showViews(state);
    this.#showCoach(state);
    this.#showPlayer();
  }

  /** A view is safe on this device: say it without words. */
  confirm(): void {
    this.#history.shot(this.#state?.time_ms ?? 0);
    this.#flash.classList.remove('on');
    void this.#flash.offsetWidth; // begins the animation anew
    this.#flash.classList.add('on');
    navigator.vibrate?.(30);
  }

  #follow({ finishLabel, showsRed, mayShoot, mayPress }: HudRules): void {
    if (finishLabel !== null) {
      say(this.#finish, finishLabel);
      if (this.#finish.ariaLabel !== null) {
        // What is read out is what is seen.
        this.#finish.removeAttribute('aria-label');
        this.#finish.removeAttribute('title');
      }
    }
    for (const each of this.#red) show(each, showsRed);
    this.#shutter.classList.toggle('away', !mayPress);
    show(this.#count, mayShoot);
    show(this.#strip, mayShoot);
  }

  #shoot(): void {
    if (this.#state?.canShoot === true) this.#actions.shoot();
  }

  #showLook(look: Look): void {
    this.#shownLook = look;
    for (const [overlay, each] of this.#looks) each.ariaPressed = String(overlay === look.overlay);
  }

  #showViews(state: HudState): void {
    const { views } = state;
    this.#shownViews = views;
    this.#shownRestorable = state.restorable;
    this.#shownOver = state.isOver;
    this.#moment.views = views.length;
    this.#moment.ready = views.filter((view) => view.state === 'ready').length;
    say(this.#count, viewsText(views.length));
    this.#showStrip(views);
    this.#sheet?.update?.(state);
  }

  /** Of a long session nearly all is there already. */
  #showStrip(views: readonly CapturedView[]): void {
    const strip = this.#strip;
    views.forEach(({ state, thumbnailUrl }, i) => {
      const key = `${state} ${thumbnailUrl}`;
      const before = strip.children[i];
      if (before instanceof HTMLElement && before.dataset['view'] === key) return;
      const thumb = make('button', {
        className: `thumb ${state}`, type: 'button', onclick: () => this.#open('views'),
      }, make('img', { src: thumbnailUrl, alt: '' }), make('span', {}, String(i + 1)));
      thumb.ariaLabel = `View ${i + 1}: ${VIEW_STATES[state]}`;
      thumb.dataset['view'] = key;
      if (before === undefined) strip.append(thumb);
      else before.replaceWith(thumb);
    });
    while (strip.children.length > views.length) strip.lastElementChild?.remove();
    strip.scrollLeft = strip.scrollWidth;
  }

  #showCoach(state: HudState): void {
    const before = this.#coach.task;
    this.#moment.peakedShare = state.peakedShare;
    this.#coach.update(this.#moment);
    if (this.#coach.done && before < NUM_TASKS) this.#endCoach();
    this.#way.auto = state.auto !== null;
    const task = taskOf(this.#coach.task, this.#way);
    show(this.#coachBox, task !== undefined && this.#sheet === null && state.gettingReady === null);
    if (task === undefined) return;
    const { title, text } = this.#coach.waits(this.#moment) ? ON_ITS_WAY : task;
    say(this.#coachTitle, title);
    say(this.#coachText, text);
    if (before === this.#coach.task && this.#coachTasks.dataset['task'] === String(before)) return;
    this.#coachTasks.dataset['task'] = String(this.#coach.task);
    Array.from(this.#coachTasks.children).forEach((each, i) =>
      each.classList.toggle('done', i <= this.#coach.task));
  }

  #restartCoach(): void {
    this.#coach.restart();
  }

  #endCoach(): void {
    this.#coach.task = NUM_TASKS;
    store(COACH_SEEN, 'yes');
  }

  #setOverlay(overlay: Overlay): void {
    if (!this.rules.showsRed) return;
    if (this.#state !== null) this.#actions.setLook({ ...this.#state.look, overlay });
  }

  #open(which: 'views' | 'settings' | 'finish'): void {
    this.#close();
    const state = this.#state;
    if (state === null) return;
    if (which === 'finish' && this.rules.finish !== null) return this.rules.finish();
    const close = (): void => this.#close();
    switch (which) {
      case 'views': this.#sheet = viewsSheet(state, this.#actions, close); break;
      case 'settings': this.#sheet = settingsSheet(state.look, this.#actions, close); break;
      case 'finish':
        this.#sheet = finishSheet(state.sessionName, state, this.#actions, close);
        break;
      default: which satisfies never;
    }
    const element = this.#sheet?.element;
    if (element === undefined) return;
    this.#root.append(element);
    element.querySelector<HTMLElement>('button, input')?.focus();
  }

  #close(): void {
    this.#sheet?.closed?.();
    this.#sheet?.element.remove();
    this.#sheet = null;
  }

  #player(): HTMLElement[] {
    const controls = this.#replay;
    if (controls === null) return [];
    this.#play = button('play', '', 'Play or pause', () => {
      if (controls.playing) controls.pause();
      else controls.play();
    });
    this.#scrub.ariaLabel = 'Position in the recording';
    this.#scrub.oninput = () => {
      controls.pause();
      controls.seek(Number(this.#scrub.value));
    };
    return [make('div', { className: 'player' }, this.#play,
      button('', '‹', 'Previous frame', () => controls.step(-1)),
      button('', '›', 'Next frame', () => controls.step(1)), this.#scrub, this.#position)];
  }

  #showPlayer(): void {
    const controls = this.#replay;
    if (controls === null) return;
    this.#play?.classList.toggle('playing', controls.playing);
    const { index, count } = controls;
    if (index === this.#shownFrame && count === this.#shownCount) return;
    this.#shownFrame = index;
    this.#shownCount = count;
    this.#scrub.max = String(Math.max(count - 1, 0));
    this.#scrub.value = String(index);
    say(this.#position, `${index + 1}/${count}`);
  }

  #key(event: KeyboardEvent): void {
    if (this.rules.covered) return;
    const typing = event.target instanceof HTMLInputElement && event.target.type === 'text';
    const pressing = event.target instanceof Element && event.target.closest(PRESSED_BY_SPACE) !== null;
    const action = actionOfKey(event, typing, pressing);
    if (action === null) return;
    switch (action.kind) {
      case 'shoot': this.#shoot(); break;
      case 'undo': if (this.rules.mayShoot) this.#actions.undoLast(); break;
      case 'look': this.#setOverlay(action.overlay); break;
      case 'finish': this.#open('finish'); break;
      case 'help': if (this.rules.offersHelp) this.#restartCoach(); break;
      case 'step': this.#replay?.step(action.frames); break;
      case 'close': this.#close(); return;
      default: action satisfies never;
    }
    event.preventDefault(); // space would scroll, or press the shutter, too
  }
}

function stored(key: string): string | null {
  try {
    return localStorage.getItem(key);
  } catch {
    return null; // storage is switched off: then nothing was seen before
  }
}

function store(key: string, value: string): void {
  try {
    localStorage.setItem(key, value);
  } catch {
    // Storage is switched off: the coach comes again next time.
  }
}
