/** The experimenter's console: who is where, and what happens next. */

import { Api, ApiError } from '../server/api';
import { followEvents } from '../server/events';
import { Warmth } from '../server/warmth';
import { make } from '../ui/dom';
import { percent } from '../ui/share_graph';
import { Orders } from './orders';
import {
  consoleStateSchema, newParticipantSchema, participantStateSchema, type ConsoleState,
  type ParticipantLine, type Reason, type StepLine, type TrialLine,
} from './wire';

const CONSOLE = '/study/console';
const TICK_MS = 1000;
const SILENT = 'The server does not answer; trying again.';

const api = new Api();
const orders = new Orders({ onSilence: () => say(SILENT) });
let state: ConsoleState | null = null;
let warmth: Warmth | null = null;
/** Of the phones: each pairs one phone within ten minutes, so they are asked for anew in time. */
const codes = new Map<string, PhoneCode>();
const NEW_CODE_EVERY_MS = 5 * 60_000;

interface PhoneCode {
  readonly asked_ms: number;
  /** It has been used when this changes. */
  readonly on_phone: boolean;
  readonly image: HTMLImageElement;
  links: readonly string[];
}

async function main(): Promise<void> {
  await api.pairFromHash();
  window.addEventListener('hashchange', draw);
  setInterval(tick, TICK_MS);
  void api.server().then((info) => { warmth = new Warmth(api, info, drawRemarks); drawRemarks(); }, () => undefined);
  const open = (signal: AbortSignal): ReturnType<Api['eventBytes']> =>
    api.eventBytes(`${CONSOLE}/events`, signal);
  await followEvents(open, consoleStateSchema, {
    onEvent: (news) => { state = news; draw(); },
    onConnection: (connection, refusal) => {
      document.body.dataset['connection'] = connection;
      if (connection === 'online') codes.clear(); // a server that was started anew knows none
      if (refusal === null) return;
      elementOf('detail').replaceChildren(make('p', {}, refusal.status === 401 || refusal.status === 403
        ? 'This browser has no access to the console. Open the link that the server printed.'
        : refusal.problem));
    },
  }, new AbortController().signal);
}

function draw(): void {
  if (state === null) return;
  document.title = `peaking: ${state.title}`;
  elementOf('title').textContent = state.title;
  drawRemarks();
  drawList(state);
  drawDetail(state);
}

/** Until the server is ready nobody can take a view. */
function drawRemarks(): void {
  const cold = warmth === null || warmth.share === null ? []
    : [make('p', {}, `${warmth.sentence ?? ''} Do not start a capture yet. `,
      make('progress', { value: warmth.share }))];
  const remarks = state?.remarks.map((said) => make('p', {}, said)) ?? [];
  elementOf('remarks').replaceChildren(...cold, ...remarks);
}

function chosen(from: ConsoleState): ParticipantLine | null {
  const name = location.hash.slice(1);
  return from.participants.find((one) => one.participant === name) ?? from.participants.at(-1)
    ?? null;
}

function drawList(from: ConsoleState): void {
  const counting = from.participants.filter((one) => one.excluded === null);
  const done = counting.filter((one) => one.state === 'done').length;
  const add = make('button', { className: 'add', type: 'button' }, 'Add participant');
  add.onclick = () => void whileDisabled(add, async () => {
    const added = await orders.give('participant', (id) =>
      api.ask('PUT', `${CONSOLE}/participants/${id}`, newParticipantSchema));
    if (added !== null) location.hash = added.participant;
  });
  const current = chosen(from)?.participant;
  const items = from.participants.map((one) => {
    const item = make('button', { type: 'button', onclick: () => { location.hash = one.participant; } },
      make('b', {}, one.participant),
      make('span', { className: 'quiet' }, oneLine(one)));
    item.setAttribute('aria-current', String(one.participant === current));
    item.classList.add(one.state);
    return item;
  });
  elementOf('list').replaceChildren(add,
    make('p', { className: 'quiet' }, `${done} of ${from.planned} planned participants done`), ...items);
}

function oneLine(one: ParticipantLine): string {
  if (one.excluded !== null) return `excluded: ${one.excluded}`;
  if (one.state === 'done') return 'done';
  const step = one.steps.find((each) => each.key === one.current);
  return step === undefined ? '' : `${step.label}${step.state === 'running' ? '' : ', waiting'}`;
}

function drawDetail(from: ConsoleState): void {
  const one = chosen(from);
  if (one === null) {
    elementOf('detail').replaceChildren(make('h1', {}, 'No participants yet'), make('p', {},
      'Add a participant. The program assigns a pseudonym and the next order of the design. Do '
      + 'not write names anywhere.'));
    return;
  }
  // What is being typed or chosen must outlive the news of the next second.
  const typed = document.querySelector<HTMLTextAreaElement>('#note')?.value ?? '';
  const focused = document.activeElement?.id ?? '';
  const wasOpen = document.querySelector<HTMLDetailsElement>('.phone-link')?.open;
  const note = noteForm(one, typed);
  elementOf('detail').replaceChildren(
    make('div', { className: 'title' }, make('h1', {}, one.participant), badge(one)),
    now(one),
    make('div', { className: 'columns' },
      make('div', {}, ...one.trials.map((trial) => trialCard(trial, one)), note),
      make('div', {}, phoneCard(from, one, wasOpen ?? one.steps[0]?.state !== 'done'),
        make('ol', { className: 'steps' }, ...stepsOf(one)))));
  if (focused !== '') document.getElementById(focused)?.focus();
  tick();
}

function badge(one: ParticipantLine): HTMLElement {
  const phone = one.on_phone ? 'phone connected' : 'no phone';
  return make('span', { className: `badge ${one.on_phone ? 'on' : ''}` }, phone);
}

/** The one thing that the experimenter does next. */
function now(one: ParticipantLine): HTMLElement {
  const step = one.steps.find((each) => each.key === one.current);
  if (one.excluded !== null) {
    return make('div', { className: 'now' }, make('h2', {}, 'Excluded'), make('p', {}, one.excluded));
  }
  if (step === undefined) {
    return make('div', { className: 'now running' }, make('h2', {}, 'Done'),
      make('p', {}, 'All data is saved. Take the phone back.'));
  }
  const place = make('p', { className: 'quiet' }, placeOf(step, one));
  const clock = make('output', { className: 'clock' });
  if (step.began_s != null && step.state === 'running') clock.dataset['since'] = String(step.began_s);
  const title = make('h2', {}, step.label);
  if (step.kind === 'ask' || step.kind === 'consent') {
    return make('div', { className: 'now' }, title, place,
      make('p', {}, 'The participant fills this in on the phone.'));
  }
  const waiting = step.state === 'waiting';
  const go = make('button', { className: 'primary', type: 'button', id: 'go' },
    `${waiting ? 'Start' : 'Stop'} ${step.label.toLowerCase()}`);
  const path = `${stepPath(one, step)}/${waiting ? 'started' : 'finished'}`;
  go.onclick = () => void order(path, () => path, undefined, go);
  return make('div', { className: `now ${step.state}` }, title, place, clock, go);
}

function placeOf(step: StepLine, one: ParticipantLine): string {
  const trial = one.trials.find((each) => step.key.startsWith(`${each.key}.`));
  const n = one.steps.indexOf(step) + 1;
  const where = `Step ${n} of ${one.steps.length}`;
  return trial === undefined ? where : `${where} · ${trial.condition}, ${trial.scene}`;
}

function trialCard(trial: TrialLine, one: ParticipantLine): HTMLElement {
  const figures: readonly (readonly [string, string])[] = [
    ['TCT', trial.tct_s == null ? '–' : seconds(trial.tct_s)],
    ['NCT', trial.nct_s == null ? '–' : seconds(trial.nct_s)],
    ['Views', String(trial.captures)],
    ['Red', percent(trial.peaked_share)],
    ['Tracking lost', String(trial.tracking_losses)],
  ];
  const current = one.current?.startsWith(`${trial.key}.`) === true;
  return make('div', { className: `card trial ${current ? 'current' : ''}` },
    make('h2', {}, `Trial ${trial.key.slice(1)}`),
    make('p', {}, make('b', {}, trial.condition), ` · ${trial.scene}`),
    make('dl', {}, ...figures.map(([name, value]) =>
      make('div', {}, make('dt', {}, name), make('dd', {}, value)))));
}

function phoneCard(from: ConsoleState, one: ParticipantLine, open: boolean): HTMLElement {
  const bare = from.phone_links.map((link) => link.replace('{participant}', one.participant));
  const code = open ? codeOf(one) : null;
  const card = make('details', { className: 'card phone-link' },
    make('summary', {}, `Phone of ${one.participant}`),
    ...(code === null ? [] : [code.image]),
    ...bare.map((link, n) => make('p', {},
      make('a', { href: code?.links[n] ?? link, target: '_blank' }, link))));
  card.open = open;
  card.ontoggle = () => { if (card.open && code === null) draw(); };
  return card;
}

function codeOf(one: ParticipantLine): PhoneCode {
  const kept = codes.get(one.participant);
  if (kept !== undefined && kept.on_phone === one.on_phone
    && Date.now() - kept.asked_ms < NEW_CODE_EVERY_MS) return kept;
  const image = kept?.image ?? make('img', {
    width: 168, height: 168, alt: `QR code of the link for ${one.participant}`,
  });
  const code: PhoneCode = {
    asked_ms: Date.now(), on_phone: one.on_phone, image, links: kept?.links ?? [],
  };
  codes.set(one.participant, code);
  api.pairingLink(`${CONSOLE}${pathOf(one)}/codes`).then(({ links, qr_svg }) => {
    code.links = links;
    image.src = `data:image/svg+xml,${encodeURIComponent(qr_svg)}`;
    draw();
  }, () => codes.delete(one.participant));
  return code;
}

function stepsOf(one: ParticipantLine): HTMLElement[] {
  return one.steps.map((step) => {
    const again = make('button', { type: 'button', className: 'small', id: `again-${step.key}` }, 'Repeat');
    again.title = 'Repeat this step and all later ones';
    again.onclick = () => {
      const text = prompt(`Repeat "${step.label}" and all later steps. Why? The reason is recorded.`)?.trim();
      if (text !== undefined && text !== '') {
        const path = `${stepPath(one, step)}/repetitions`;
        void order(path, (id) => `${path}/${id}`, { text }, again);
      }
    };
    const took = step.began_s != null && step.ended_s != null
      ? seconds(step.ended_s - step.began_s) : '';
    const trial = one.trials.find((each) => step.key.startsWith(`${each.key}.`));
    const label = make('span', {}, step.label);
    if (trial !== undefined) label.append(make('small', {}, ` trial ${trial.key.slice(1)}`));
    return make('li', { className: step.state }, label, make('span', { className: 'took' }, took),
      ...(step.state === 'done' && step.kind !== 'consent' ? [again] : []));
  });
}

function noteForm(one: ParticipantLine, typed: string): HTMLElement {
  const note = make('textarea', { id: 'note', rows: 2, value: typed });
  const keep = make('button', { type: 'button', id: 'keep' }, 'Save note');
  keep.onclick = () => {
    const text = note.value.trim();
    if (text === '') return;
    note.value = '';
    const path = `${pathOf(one)}/notes`;
    void order(`${path} ${text}`, (id) => `${path}/${id}`, { text }, keep);
  };
  const out = make('button', { type: 'button', className: 'small' }, 'Exclude from the study');
  out.onclick = () => {
    const text = prompt(`Exclude ${one.participant} from the analysis. Why? The reason is recorded.`)?.trim();
    if (text !== undefined && text !== '') {
      const path = `${pathOf(one)}/excluded`;
      void order(path, () => path, { text }, out);
    }
  };
  return make('div', { className: 'card' },
    make('label', { htmlFor: 'note' }, 'Note (no names)'), note,
    make('div', { className: 'row' }, keep, ...(one.excluded === null ? [out] : [])),
    make('ul', {}, ...one.notes.map((text) => make('li', {}, text))),
    make('p', { className: 'quiet' }, one.images ? 'Photos may be kept.'
      : 'Photos are deleted after each trial, or a day after the last step.'));
}

async function order(
  what: string, address: (id: string) => string, json: Reason | undefined,
  button: HTMLButtonElement,
): Promise<void> {
  await whileDisabled(button, () => orders.give(what, (id) =>
    api.ask('PUT', CONSOLE + address(id), participantStateSchema, json)));
}

/** Pressed once is pressed once; what goes wrong is said at the top. */
async function whileDisabled(
  button: HTMLButtonElement, work: () => Promise<unknown>,
): Promise<void> {
  button.disabled = true;
  try {
    await work();
  } catch (error) {
    say(error instanceof ApiError ? error.problem : String(error));
  } finally {
    button.disabled = false;
  }
}

function say(said: string): void {
  elementOf('remarks').replaceChildren(make('p', { role: 'alert' }, said));
}

function pathOf(one: ParticipantLine): string {
  return `/participants/${encodeURIComponent(one.participant)}`;
}

function stepPath(one: ParticipantLine, step: StepLine): string {
  return `${pathOf(one)}/steps/${encodeURIComponent(step.key)}`;
}

/** Clocks run on, and codes end; nothing else changes without news. */
function tick(): void {
  const one = state === null ? null : chosen(state);
  if (one !== null && document.querySelector<HTMLDetailsElement>('.phone-link')?.open === true) {
    codeOf(one);
  }
  for (const clock of document.querySelectorAll<HTMLElement>('[data-since]')) {
    clock.textContent = seconds(Math.max(0, Date.now() / 1000 - Number(clock.dataset['since'])));
  }
}

function seconds(s: number): string {
  const whole = Math.round(s);
  return whole < 60 ? `${whole} s` : `${Math.floor(whole / 60)} min ${whole % 60} s`;
}

function elementOf(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element #${id}`);
  return element;
}

main().catch((error: unknown) => {
  elementOf('detail').replaceChildren(make('p', { role: 'alert' },
    error instanceof Error ? error.message : String(error)));
});
