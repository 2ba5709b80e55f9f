/** Guidance on the capture page: one suggestion at a time, the score with its map, and the sheet. */

import { cameraOfWire, type Camera } from '../geometry';
import type { CaptureSession } from '../capture/capture_session';
import { button, make, say, show } from '../ui/dom';
import type { Guidance, GuidedPlace } from '../wire';
import { AdviceFeed } from './advice_feed';
import { drawMap } from './capture_map';
import { DoneSheet } from './done_sheet';
import { Ghost, type OnOverlay } from './ghost';
import { moveTo, type Move } from './place';
import { planViewOf, type PlanView } from './plan_view';
import { doneText, MOVES, VERDICTS } from './words';

const OFF = 'peaking.next-view-off';
/** Words change at most this often, so that they can be read. */
const WORDS_EVERY_MS = 700;

/** What a frame tells; the object may be used again. */
export interface NextViewMoment {
  readonly time_ms: number;
  /** Where the picture was taken from; null while tracking is lost. */
  readonly camera: Camera | null;
  /** Something else has the photographer's attention. */
  readonly quiet: boolean;
}

export class NextView {
  readonly #root: HTMLElement;
  readonly #ghost: Ghost;
  readonly #words = make('span');
  readonly #reason = make('small');
  readonly #says: HTMLElement;
  readonly #map = make('canvas', { width: 152, height: 120 });
  readonly #score = make('span');
  readonly #open: HTMLButtonElement;
  readonly #sheet: DoneSheet;
  readonly #feed: AdviceFeed;
  #guidance: Guidance | null = null;
  #plan: PlanView = planViewOf([], [], []);
  #isOn = stored() !== 'yes';
  /** What somebody asked to be led to; it stays until a view was taken since. */
  #asked: GuidedPlace | null = null;
  #askedAtViews = 0;
  #place: GuidedPlace | null = null;
  #camera: Camera | null = null;
  #move: Move | null = null;
  #wordsAt_ms = -Infinity;

  constructor(
    root: HTMLElement, private readonly session: CaptureSession, private readonly picture: OnOverlay,
  ) {
    this.#root = root;
    this.#ghost = new Ghost(root);
    this.#says = make('div', { className: 'next-says', hidden: true, role: 'status' },
      make('div', {}, this.#words, this.#reason),
      button('', '✕', 'Suggest no more views', () => this.#setOn(false)));
    this.#open = button('map', '', 'How complete the capture is', () => this.#show());
    this.#open.hidden = true;
    this.#open.append(this.#map, this.#score);
    root.append(this.#says, this.#open);
    this.#sheet = new DoneSheet({
      lead: (place) => this.#lead(place),
      setOn: (on) => this.#setOn(on),
      close: () => this.#close(),
    });
    this.#feed = new AdviceFeed(session.options.api, session.id, (guidance) => this.#heard(guidance));
    session.subscribe(({ guidanceNews }) => this.#feed.heard(guidanceNews));
  }

  /** Whether a suggestion is shown, so that nothing else points anywhere. */
  get suggests(): boolean {
    return this.#place !== null;
  }

  get newest(): Guidance | null {
    return this.#guidance;
  }

  /** What is suggested now, or null. */
  get place(): GuidedPlace | null {
    return this.#place;
  }

  /** May be called for every frame. */
  onFrame({ time_ms, camera, quiet }: NextViewMoment): void {
    if (this.#asked !== null && this.session.views.length > this.#askedAtViews) this.#choose(null);
    if (this.#camera === null || camera === null || quiet) {
      this.#ghost.hide();
      show(this.#says, false);
      return;
    }
    this.#ghost.draw(camera, this.#camera, this.picture);
    if (time_ms - this.#wordsAt_ms > WORDS_EVERY_MS || this.#move === null) {
      const move = moveTo(camera, this.#camera, this.#ghost.frame.reached);
      if (move !== this.#move) {
        this.#move = move;
        this.#wordsAt_ms = time_ms;
        say(this.#words, MOVES[move]);
      }
    }
    show(this.#says, true);
  }

  #heard(guidance: Guidance): void {
    this.#guidance = guidance;
    this.#plan = planViewOf(this.session.views.map(({ camera }) => cameraOfWire(camera)),
      guidance.left.map(({ camera }) => cameraOfWire(camera)), guidance.surface_m);
    show(this.#open, guidance.views > 0);
    drawMap(this.#map, this.#plan, 18);
    say(this.#score, guidance.verdict === 'go on' ? doneText(guidance) : VERDICTS[guidance.verdict]);
    this.#open.classList.toggle('enough', guidance.verdict === 'enough');
    this.#choose(this.#asked);
    if (this.#sheet.element.isConnected) this.#sheet.update(guidance, this.#plan, this.#isOn);
  }

  /** @param asked What somebody asked to be led to. */
  #choose(asked: GuidedPlace | null): void {
    this.#asked = asked;
    const place = asked ?? (this.#isOn ? this.#guidance?.next ?? null : null);
    this.#place = place;
    this.#camera = place === null ? null : cameraOfWire(place.camera);
    this.#move = null;
    say(this.#reason, place?.reason ?? '');
  }

  #lead(place: GuidedPlace): void {
    this.#askedAtViews = this.session.views.length;
    this.#choose(place);
    this.#close();
  }

  #setOn(on: boolean): void {
    this.#isOn = on;
    store(on ? null : 'yes');
    this.#choose(null);
  }

  #show(): void {
    if (this.#guidance === null) return;
    this.#sheet.update(this.#guidance, this.#plan, this.#isOn);
    this.#root.append(this.#sheet.element);
    this.#sheet.element.querySelector<HTMLElement>('button')?.focus();
  }

  #close(): void {
    this.#sheet.element.remove();
  }
}

function stored(): string | null {
  try {
    return localStorage.getItem(OFF);
  } catch {
    return null;
  }
}

function store(value: string | null): void {
  try {
    if (value === null) localStorage.removeItem(OFF);
    else localStorage.setItem(OFF, value);
  } catch { /* it is asked again next time */ }
}
