/** The end of a session: what was got, how many of the views are enough, and where they go. */

import type { CapturedView } from '../capture/capture_session';
import { ApiError } from '../server/api';
import type { Selection } from '../wire';
import { make } from './dom';
import { FormatChoice } from './format_choice';
import { drawQuality } from './quality_curve';
import { sheet, type Sheet, type SheetActions, type SheetState } from './sheets';
import { viewsText } from './words';

const AGAIN_MS = 2000;
const BUSY = 503;
/** The network may come back, and what takes the server long is there when it is asked again. */
const NO_ANSWER = 0;
/** A smaller difference of predicted quality is none. */
const SAME_DB = 0.05;

/** "63 views, 2 blurred, exposure even." */
export function gotText(views: readonly CapturedView[], selection: Selection | null): string {
  const said = [viewsText(views.length)];
  const failed = views.filter(({ state }) => state === 'failed').length;
  if (failed > 0) said.push(`${failed} failed (the list of views says why)`);
  if (selection !== null && selection.captures.length > 0) {
    const faults = selection.captures.map((capture) => capture.faults ?? []);
    const blurred = faults.filter((some) => some.includes('blurred')).length;
    const jumps = faults.filter((some) => some.includes('brighter') || some.includes('darker')).length;
    said.push(blurred === 0 ? 'none blurred' : `${blurred} blurred`);
    said.push(jumps === 0 ? 'exposure even' : `exposure jumps at ${jumps}`);
  }
  return `${said.join(', ')}.`;
}

/** "The best 40 show nearly the same: 0.3 dB less."; empty where nothing can be said. */
export function enoughText({ captures, curve = [], enough }: Selection): string {
  const last = curve.at(-1);
  if (enough == null || last === undefined) return '';
  if (enough >= captures.length) return captures.length < 2 ? '' : 'Each of them shows what the others do not.';
  const at = curve.find(({ num_views }) => num_views === enough) ?? last;
  const less_db = last.psnr_db - at.psnr_db;
  return `The best ${enough} show ${less_db < SAME_DB ? 'the same.'
    : `nearly the same: ${less_db.toFixed(1)} dB less.`}`;
}

/** What is still to come before more can be said; empty: nothing. */
export function onTheWayText(views: readonly CapturedView[]): string {
  const count = (...states: readonly CapturedView['state'][]): number =>
    views.filter(({ state }) => states.includes(state)).length;
  const here = count('waiting', 'uploading');
  const there = count('queued');
  if (here > 0) {
    return `${here} of ${viewsText(views.length)} still on the way to the server: saved on this device, `
      + 'and sent as soon as there is a connection.';
  }
  return there > 0 ? `The server is still at work on ${viewsText(there)}.` : '';
}

export function finishSheet(
  name: string, state: SheetState, actions: SheetActions, close: () => void,
): Sheet {
  return new FinishSheet(name, state, actions, close);
}

class FinishSheet implements Sheet {
  readonly element: HTMLElement;
  readonly #got = make('p');
  readonly #curve = make('div', { className: 'quality-curve', hidden: true });
  readonly #onTheWay = make('p', { className: 'quiet' });
  readonly #undone = make('p', { className: 'quiet' });
  readonly #said = make('p', { className: 'said', role: 'status' });
  readonly #name: HTMLInputElement;
  readonly #look = make('a', { className: 'primary', target: '_blank' }, 'Look at it');
  readonly #best = secondary('', () => void this.#download(this.#selection?.enough ?? null));
  readonly #all = secondary('', () => void this.#download(null));
  readonly #format = new FormatChoice();
  readonly #finish = secondary('Finish without downloading', () => this.#end());
  readonly #more = secondary('Take more views', () => this.#takeMore());
  readonly #title: HTMLElement | null;
  #state: SheetState;
  #selection: Selection | null = null;
  /** Of which views it was asked. */
  #asked = '';
  #asking = new AbortController();
  /** Why there is no answer. */
  #unsaid = '';
  #isDownloading = false;

  constructor(
    readonly name: string, state: SheetState, readonly actions: SheetActions,
    readonly close: () => void,
  ) {
    this.#name = make('input', { type: 'text', value: name, maxLength: 80 });
    this.element = sheet('Finish', close, this.#got, this.#curve, this.#onTheWay, this.#undone,
      make('label', {}, 'Session name', this.#name), this.#format.element,
      this.#said, this.#look, this.#best, this.#all, this.#finish,
      this.#more, secondary('Start a new session', () => actions.newSession()));
    this.#title = this.element.querySelector('h2');
    this.#state = state;
    this.update(state);
  }

  update(state: SheetState): void {
    this.#state = state;
    const { views } = state;
    const isSettled = views.every(({ state: each }) => each === 'ready' || each === 'failed');
    const ready = views.filter(({ state: each }) => each === 'ready');
    const key = isSettled ? ready.map(({ id, mpiVersion }) => `${id} ${mpiVersion}`).join() : '';
    if (key !== this.#asked) {
      this.#asked = key;
      this.#selection = null;
      this.#unsaid = '';
      this.#asking.abort();
      this.#asking = new AbortController();
      if (key !== '') void this.#ask(this.#asking.signal);
    }
    this.#show();
  }

  closed(): void {
    this.#asking.abort();
  }

  async #ask(signal: AbortSignal): Promise<void> {
    while (!signal.aborted) {
      try {
        const selection = await this.actions.selection(signal);
        if (signal.aborted) return;
        this.#selection = selection;
        this.#unsaid = '';
        return this.#show();
      } catch (error) {
        if (signal.aborted) return;
        const status = error instanceof ApiError ? error.status : null;
        if (status !== BUSY) {
          this.#unsaid = `Which views are enough cannot be said now: ${sentenceOf(error)}`;
          this.#show();
        }
        if (status !== BUSY && status !== NO_ANSWER) return;
        await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
      }
    }
  }

  #show(): void {
    const { views, restorable, isOver } = this.#state;
    const selection = this.#selection;
    const title = isOver ? 'Finished' : 'Finish';
    if (this.#title !== null && this.#title.textContent !== title) this.#title.textContent = title;
    const isLooking = selection === null && this.#asked !== '' && this.#unsaid === '';
    this.#got.textContent = [
      gotText(views, selection), selection === null ? '' : enoughText(selection), this.#unsaid,
      isLooking ? 'Looking at them …' : '',
    ].join(' ').trim();
    // Only numbers go into it, so it is safe as markup.
    const curve = selection === null ? ''
      : drawQuality(selection.curve ?? [], selection.enough ?? 0, selection.captures.length);
    this.#curve.innerHTML = curve;
    this.#curve.hidden = curve === '';
    this.#onTheWay.textContent = onTheWayText(views);
    const undone = restorable.filter(({ setAside }) => !setAside).length;
    this.#undone.textContent = undone === 0 || isOver ? '' : `Finishing deletes the `
      + `${undone === 1 ? 'view' : `${undone} views`} that you undid. You can still bring them back in the `
      + 'list of views.';
    const onServer = views.filter((view) => view.onServer).length;
    const numReady = views.filter(({ state }) => state === 'ready').length;
    this.#look.href = this.actions.viewer();
    const enough = selection?.enough ?? 0;
    const hasBest = enough > 0 && enough < onServer;
    this.#best.hidden = !hasBest;
    this.#best.textContent = `Download the best ${enough}`;
    this.#all.textContent = onServer === views.length ? `Download all ${onServer}`
      : `Download the ${onServer} that have arrived`;
    this.#all.hidden = onServer === 0;
    this.#look.hidden = numReady === 0;
    this.#all.className = numReady === 0 ? 'primary' : 'secondary';
    this.#best.disabled = this.#isDownloading;
    this.#all.disabled = this.#isDownloading;
    this.#finish.hidden = isOver;
    this.#more.hidden = !isOver;
  }

  #end(): void {
    this.actions.finish(this.#name.value.trim() || this.name);
    this.#say('Finished. Everything is kept on the server.');
  }

  #takeMore(): void {
    this.actions.takeMore();
    this.close();
  }

  async #download(views: number | null): Promise<void> {
    const what = views === null ? 'data set' : `best ${views}`;
    this.#isDownloading = true;
    this.#say(`Getting the ${what} ready …`);
    this.actions.finish(this.#name.value.trim() || this.name);
    this.#show();
    try {
      const href = await this.actions.dataset({ views, format: this.#format.format });
      make('a', { href, download: '' }).click();
      this.#say(`Finished. Your browser downloads the ${what} as a zip; it is kept on the server, too.`);
    } catch (error) {
      this.#say(`The ${what} cannot be downloaded now: ${sentenceOf(error)} Everything is kept; try again.`);
    } finally {
      this.#isDownloading = false;
      this.#show();
    }
  }

  #say(sentence: string): void {
    this.#said.textContent = sentence;
  }
}

function secondary(text: string, onclick: () => void): HTMLButtonElement {
  return make('button', { className: 'secondary', type: 'button', onclick }, text);
}

function sentenceOf(error: unknown): string {
  return error instanceof ApiError ? error.problem : String(error);
}
