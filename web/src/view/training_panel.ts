/** Trains 3D Gaussians of a session on the server: one button, how far it is, and what came out. */

import { ApiError, type Api } from '../server/api';
import { make, say, show } from '../ui/dom';
import type { Training } from '../wire';
import type { SessionPlace } from './session_place';

const HEARD: Readonly<Record<Training['state'], string>> = {
  none: '', waiting: 'The training waits.', running: 'Training.', stopped: 'The training stopped.',
  failed: 'The training failed.', done: 'The training is done.',
};
/** Fewer cannot be trained on. */
const LEAST_VIEWS = 3;

export class TrainingPanel {
  readonly element = make('div', { className: 'place-training' });
  readonly #api: Api;
  readonly #place: SessionPlace;
  readonly #button = make('button', { type: 'button',  onclick: () => void this.#press() });
  readonly #details = make('div', { className: 'place-details' });
  readonly #bar = make('progress', { max: 1 });
  readonly #says = make('p');
  /** For those who hear the page: what became of it, and not how far it is twice a second. */
  readonly #announced = make('p', { className: 'place-heard' });
  readonly #worst = make('ul');
  #onSplat: () => void = () => undefined;
  #onView: (capture: string) => void = () => undefined;
  /** It was begun here, and nothing of it was shown yet. */
  #isMine = false;
  /** It was told to stop, and has not yet. */
  #stopping = false;
  /** What the server refused. */
  #refusal = '';

  constructor(api: Api, place: SessionPlace) {
    this.#api = api;
    this.#place = place;
    this.#details.append(this.#bar, this.#says, this.#worst);
    this.element.append(this.#button, this.#details, this.#announced);
    this.#announced.setAttribute('role', 'status');
    this.#bar.ariaLabel = 'Training';
    place.subscribe(() => this.#draw());
    this.#draw();
  }

  /** @param listener Called when the first Gaussians of a training that was begun here can be shown. */
  onSplat(listener: () => void): void {
    this.#onSplat = listener;
    this.#draw();
  }

  /** @param listener Called with a view that someone wants to look from. */
  onView(listener: (capture: string) => void): void {
    this.#onView = listener;
  }

  async #press(): Promise<void> {
    const running = isUnderWay(this.#place.training);
    this.#stopping = running;
    this.#isMine = !running;
    this.#refusal = '';
    this.#button.disabled = true;
    try {
      await this.#api.train(this.#place.session.summary.id, running ? 'stopped' : 'running');
    } catch (error) {
      this.#refusal = error instanceof ApiError ? error.problem : String(error);
    } finally {
      this.#button.disabled = false;
      this.#draw();
    }
  }

  #draw(): void {
    const training = this.#place.training;
    const state = training?.state ?? 'none';
    const views = this.#place.place.views.length;
    show(this.element, views >= LEAST_VIEWS || state !== 'none');
    if (!isUnderWay(training)) this.#stopping = false;
    say(this.#button, this.#stopping ? 'Stopping …' : labelOf(training));
    say(this.#announced, HEARD[state]);
    show(this.#button, state !== 'done' || training?.outdated === true);
    show(this.#bar, isUnderWay(training) || state === 'stopped');
    if (training !== null && training.steps > 0) this.#bar.value = training.step / training.steps;
    const text = this.#refusal === '' ? factsOf(training) : this.#refusal;
    say(this.#says, text);
    show(this.#details, text !== '');
    this.#drawWorst(training);
    if (this.#isMine && (training?.splat_version ?? 0) > 0) {
      this.#isMine = false;
      this.#onSplat();
    }
  }

  #drawWorst(training: Training | null): void {
    const worst = training?.state === 'done' ? training.worst : [];
    const key = JSON.stringify(worst);
    if (this.#worst.dataset['drawn'] === key) return;
    this.#worst.dataset['drawn'] = key;
    this.#worst.replaceChildren(...worst.map(({ capture, psnr_db, suggestion }) => {
      const photo = this.#place.place.views.findIndex(({ name }) => name === capture) + 1;
      const text = `${photo > 0 ? `Photo ${photo}` : 'A photo that is gone'}: ${psnr_db.toFixed(1)}\u00a0dB. ${suggestion}`;
      return make('li', {}, make('button', { type: 'button', onclick: () => this.#onView(capture) }, text));
    }));
    show(this.#worst, worst.length > 0);
  }
}

function isUnderWay(training: Training | null): boolean {
  return training?.state === 'running' || training?.state === 'waiting';
}

function labelOf(training: Training | null): string {
  switch (training?.state) {
    case 'running': case 'waiting': return 'Stop training';
    case 'stopped': return training.outdated ? 'Train again' : 'Go on training';
    case 'done': return 'Train again: the views have changed';
    case 'failed': return 'Train again';
    default: return 'Train a splat';
  }
}

function factsOf(training: Training | null): string {
  switch (training?.state) {
    case 'waiting': return 'Waiting for another training to finish.';
    case 'running': {
      const left = training.remaining_s === null ? ''
        : ` · ${timeText(training.remaining_s)} left`;
      return `${percentOf(training)} · ${training.gaussians.toLocaleString('en')} Gaussians${left}`;
    }
    case 'stopped': return `Stopped at ${percentOf(training)}.`;
    case 'failed': return training.problem ?? 'The training failed.';
    case 'done': {
      const quality = training.psnr_db === null ? ''
        : `${training.psnr_db.toFixed(1)}\u00a0dB on ${training.held_out} photos kept out of the training · `;
      return `${quality}${training.gaussians.toLocaleString('en')} Gaussians`;
    }
    default: return '';
  }
}

function percentOf({ step, steps }: Training): string {
  return `${Math.round((100 * step) / Math.max(steps, 1))}\u00a0%`;
}

function timeText(time_s: number): string {
  return time_s < 90 ? `${Math.max(1, Math.round(time_s))}\u00a0s` : `${Math.round(time_s / 60)}\u00a0min`;
}
