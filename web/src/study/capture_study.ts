/**
 * The capture page as part of a study (`?study=P01`): it shows what the condition shows, follows the
 * server from step to step without leaving the camera, and records what happens.
 */

import type { CaptureSession } from '../capture/capture_session';
import type { LiveView } from '../live_view';
import type { Look } from '../render/view_renderer';
import type { CaptureExtension, CapturePage, ExtensionRequest } from '../extension';
import type { GuideState } from '../guidance/guide_session';
import { make } from '../ui/dom';
import { CaptureRecord, type Moment } from './capture_record';
import { paragraphs } from './form';
import './form.css';
import { guideNews, type GuideNews } from './guide_news';
import { outboxOf, sendLeftovers, type Outbox } from './outbox';
import './sheet.css';
import { persist, stepForm } from './step_form';
import { fill, ParticipantApi, type Texts } from './study_api';
import type { ParticipantState, ShownStep } from './wire';

const ALIVE_EVERY_S = 1;

/** Go on with the step that the participant is at, or leave for the participant's page. */
export async function open(
  { value: participant, query, api, source }: ExtensionRequest,
): Promise<CaptureExtension> {
  const own = new ParticipantApi(api, participant);
  const [texts, state] = await Promise.all([own.texts(), own.state()]);
  const { step } = state;
  if (step === null || !isOverCamera(step)) return leave(participant, query);
  const known = step.capture?.session ?? null;
  if (known === null) localStorage.removeItem(aliveKey(participant, step));
  // The world of a phone's camera has another origin after a reload: a session of its own.
  const id = known === null || source === 'webxr' ? crypto.randomUUID() : known;
  if (id !== known && step.kind !== 'ask' && step.kind !== 'review') {
    await own.beginSession(step.key, id);
  }
  return new StudyCapture(own, texts, id, step, query);
}

class StudyCapture implements CaptureExtension {
  readonly offersHelp = false;
  readonly #outbox: Outbox;
  readonly #sheet = make('section', { className: 'study-sheet', hidden: true });
  readonly #shownNumbers = new Map<string, number>();
  readonly #moment: Moment = {
    now_s: 0, canShoot: false, camera: null, peakedShare: null, wrongShare: null, unseenShare: null,
    unfixableShare: null, views: 0,
  };
  /** How far the timeline was looked through. */
  #noted = -1;
  #heardTaken: GuideState['takenBy'] | null = null;
  #heardBound: GuideState['bound'] = null;
  #step: ShownStep;
  #shown = '';
  #record: CaptureRecord | null = null;
  #live: LiveView | null = null;
  #session: CaptureSession | null = null;
  #alive_s = -Infinity;
  #finishing = false;

  constructor(
    readonly api: ParticipantApi, readonly texts: Texts, readonly sessionId: string,
    step: ShownStep, readonly query: URLSearchParams,
  ) {
    this.#step = step;
    sendLeftovers(api, sessionId);
    this.#outbox = outboxOf(api, sessionId);
  }

  /** The name is for whoever looks through the photos later. */
  get session(): CaptureExtension['session'] {
    return { id: this.sessionId, name: `${this.api.participant} ${this.#step.key}` };
  }

  /** What the participant is to do. */
  get task(): string {
    return this.#step.text;
  }

  get showsRed(): boolean {
    return this.#step.capture?.overlay === 'peaks' && this.#step.kind !== 'review';
  }

  get finishLabel(): string {
    return this.texts[`finish_${this.#step.kind}`] ?? this.texts['finish_capture'] ?? '';
  }

  get mayShoot(): boolean {
    return this.#step.running && ['practice', 'capture'].includes(this.#step.kind);
  }

  /** The shutter does something: it takes views, or ends a guide's scan. */
  get mayPress(): boolean {
    return this.mayShoot || (this.#step.running && this.#step.kind === 'scan');
  }

  get showsGuide(): boolean {
    return this.#step.kind !== 'review';
  }

  get covered(): boolean {
    return !this.#sheet.hidden;
  }

  /** Begin to follow the server, when the page has what is needed to show it. */
  attach({ live, session, overlay }: CapturePage): void {
    this.#live = live;
    this.#session = session;
    overlay.append(this.#sheet);
    document.body.classList.add('in-study');
    void this.#outbox.run();
    session.subscribe(({ views }) => this.#record?.follow(views, now_s()));
    this.#show(this.#step);
    void this.api.follow({
      onEvent: (state) => this.#follow(state),
      onConnection: () => undefined,
    }, new AbortController().signal);
  }

  onFrame(guide: GuideState | null): void {
    if (guide !== null) this.#hearGuide(guide);
    const live = this.#live;
    if (live === null || this.#record === null) return;
    const { seen, hindrance, camera } = live.state;
    const time_s = now_s();
    if (live.timeline.noted !== this.#noted) {
      this.#noted = live.timeline.noted;
      this.#record.joined(live.timeline.all(), time_s - performance.now() / 1000);
    }
    const moment = this.#moment;
    moment.now_s = time_s;
    moment.canShoot = hindrance === null;
    moment.camera = camera;
    moment.peakedShare = seen?.peakedShare ?? null;
    moment.wrongShare = seen?.wrongShare ?? null;
    moment.unseenShare = seen?.unseenShare ?? null;
    moment.unfixableShare = seen?.unfixableShare ?? null;
    moment.views = this.#session?.views.length ?? 0;
    this.#record.see(moment);
    if (!this.#record.running || Math.abs(time_s - this.#alive_s) < ALIVE_EVERY_S) return;
    this.#alive_s = time_s;
    localStorage.setItem(aliveKey(this.api.participant, this.#step), String(time_s));
  }

  /** The participant pressed Finish. */
  finish(): void {
    if (this.#step.kind !== 'capture') return void this.#finish();
    const views = this.#session?.views.length ?? 0;
    const yes = make('button', { className: 'primary', type: 'button' },
      this.texts['finish_capture'] ?? '');
    const no = make('button', { className: 'secondary', type: 'button' },
      this.texts['go_on'] ?? '');
    yes.onclick = () => void this.#finish();
    no.onclick = () => { this.#sheet.hidden = true; };
    this.#fill(false, make('h2', {}, fill(this.texts['really_finish'] ?? '', { n: views })), yes, no);
    yes.focus();
  }

  async #finish(): Promise<void> {
    if (this.#finishing || !this.#step.running) return;
    this.#finishing = true;
    const step = this.#step.key;
    this.#record?.end(now_s());
    try {
      await persist(async () => {
        await this.#outbox.flush();
        this.#follow(await this.api.finish(step));
      }, () => this.#fill(false, make('p', { role: 'status' }, this.texts['not_saved'] ?? '')));
    } finally {
      this.#finishing = false;
    }
  }

  #follow(state: ParticipantState): void {
    const { step } = state;
    const here = this.#step;
    const sameTrial = step !== null && trialOf(step) === trialOf(here)
      && (step.kind === 'practice') === (here.kind === 'practice');
    if (step === null || !sameTrial || !isOverCamera(step)) {
      // Events of the last second are on this device; the next page's outbox would send them late.
      void this.#outbox.flush().catch(() => undefined)
        .finally(() => leave(this.api.participant, this.query));
      return;
    }
    // The experimenter has it done again: with a session of its own.
    if (here.capture?.session != null && step.capture?.session == null) return location.reload();
    this.#step = step;
    this.#show(step);
  }

  #show(step: ShownStep): void {
    const key = `${step.key} ${step.running}`;
    if (key === this.#shown) return;
    this.#shown = key;
    if (this.#live !== null) this.#live.look = this.#lookOf(step, this.#live.look);
    document.body.classList.toggle('reviewing', step.kind === 'review');
    this.#recordStep(step);
    if (step.kind === 'ask') {
      const { form } = stepForm(this.api, step, this.texts, {
        done: (state) => this.#follow(state), keeping: () => undefined,
      });
      this.#fill(true, form.element);
    } else if (!step.running) {
      this.#fill(false, make('h2', {}, this.texts[`${step.kind}_title`] ?? ''),
        ...paragraphs(step.text),
        make('p', { className: 'waiting', role: 'status' }, this.texts['wait_text'] ?? ''));
    } else {
      this.#sheet.hidden = true;
    }
  }

  #recordStep(step: ShownStep): void {
    if (step.kind !== 'capture' || !step.running) {
      if (this.#record !== null && step.kind !== 'capture') {
        // Stopped from the console: the time ends there, and so does the recording.
        this.#record = null;
        localStorage.removeItem(aliveKey(this.api.participant, { ...step, key: captureOf(step) }));
      }
      return;
    }
    const alive_s = Number(localStorage.getItem(aliveKey(this.api.participant, step)) ?? NaN);
    this.#record = new CaptureRecord({
      step: step.key,
      session: this.sessionId,
      put: (event) => this.#outbox.put(event),
      before: this.#session?.views.map((view) => view.id) ?? [],
      gone_s: Number.isFinite(alive_s) ? alive_s : null,
    });
  }

  #lookOf(step: ShownStep, look: Look): Look {
    if (step.kind === 'review') return { ...look, overlay: 'mpi' };
    return this.showsRed ? { ...look, overlay: 'peaks', peakOpacity: 1 }
      : { ...look, overlay: 'video', peakOpacity: 0 };
  }

  #hearGuide(guide: GuideState): void {
    if (guide.phase === 'scan') return;
    if (guide.takenBy !== this.#heardTaken || guide.bound !== this.#heardBound) {
      this.#heardTaken = guide.takenBy;
      this.#heardBound = guide.bound;
      this.#tellGuide(guideNews(guide));
    }
    if (this.#step.kind === 'scan') void this.#finish();
  }

  #tellGuide(news: GuideNews): void {
    for (const [name, value] of Object.entries(news)) {
      if (this.#shownNumbers.get(name) === value) continue;
      this.#shownNumbers.set(name, value);
      this.#outbox.put({
        kind: 'GuideTold', id: crypto.randomUUID(), step: this.#step.key, time_s: now_s(), name,
        value,
      });
    }
  }

  /** @param whole Over the whole picture, or from its lower edge. */
  #fill(whole: boolean, ...content: HTMLElement[]): void {
    this.#sheet.classList.toggle('whole', whole);
    this.#sheet.replaceChildren(...content);
    this.#sheet.hidden = false;
    this.#sheet.scrollTop = 0;
  }
}

function isOverCamera(step: ShownStep): boolean {
  return ['practice', 'scan', 'capture', 'review'].includes(step.kind) || step.over_camera === true;
}

function trialOf(step: ShownStep): string {
  return step.key.split('.')[0] ?? '';
}

function captureOf(step: ShownStep): string {
  return `${trialOf(step)}.capture`;
}

function aliveKey(participant: string, step: Pick<ShownStep, 'key'>): string {
  return `peaking.study.alive.${participant}.${step.key}`;
}

function now_s(): number {
  return Date.now() / 1000;
}

/** To the participant's page; never comes back. */
function leave(participant: string, query: URLSearchParams): never | Promise<never> {
  const next = new URLSearchParams({ participant });
  const source = query.get('source');
  if (source !== null) next.set('source', source);
  location.replace(`./participant?${next.toString()}`);
  return new Promise<never>(() => undefined);
}
