/** The participant's page: whatever step the server says, as a calm page with one thing to do. */

import { Api } from '../server/api';
import { CaptureDb } from '../capture/capture_db';
import { forgetErased } from '../capture/erased_sessions';
import { make } from '../ui/dom';
import type { DraftKeeper, Keeping } from './draft_keeper';
import { paragraphs, QuestionForm } from './form';
import { sendLeftovers } from './outbox';
import { persist, stepForm } from './step_form';
import { fill, ParticipantApi, type Texts } from './study_api';
import type { Item, ParticipantState, Questionnaire, ShownStep } from './wire';

const query = new URLSearchParams(location.search);
const page = elementOf('page');
/** What is shown now, so that news of the same step do not disturb who fills in. */
let shownKey = '';
let form: QuestionForm | null = null;
let keeper: DraftKeeper | null = null;

async function main(): Promise<void> {
  const api = new Api();
  await api.pairFromHash();
  const participant = query.get('participant');
  const study = new ParticipantApi(api, participant ?? '');
  const texts = await study.texts();
  if (participant !== null) sendLeftovers(study);
  if (participant === null) {
    calm(texts['no_participant_title'], texts['no_participant_text']);
    return;
  }
  await study.follow({
    onEvent: (state) => {
      show(study, state, texts);
      void forgetWhatIsErased(api);
    },
    onConnection: (_, refusal) => {
      document.body.dataset['connection'] = refusal === null ? '' : 'refused';
      if (refusal !== null && shownKey === '') fail(refusal.problem);
    },
  }, new AbortController().signal);
}

/** Photos that may not be kept go after their review, and the capture page may not open again. */
async function forgetWhatIsErased(api: Api): Promise<void> {
  const db = await CaptureDb.open();
  try {
    await forgetErased(api, db, await db.sessionIds());
  } catch (error) {
    console.error('what was erased is still on this device', error);
  } finally {
    db.close();
  }
}

function show(study: ParticipantApi, state: ParticipantState, texts: Texts): void {
  document.documentElement.lang = state.language;
  document.title = state.title;
  showProgress(state, texts);
  const { step } = state;
  const key = step === null ? 'end' : `${step.key} ${step.running}`;
  if (key === shownKey) {
    if (step?.draft !== undefined) form?.merge(step.draft);
    return;
  }
  shownKey = key;
  form = null;
  keeper?.close();
  keeper = null;
  page.className = 'page';
  say('');
  if (step === null) {
    if (state.refused === true) calm(texts['refused_title'], texts['refused_text']);
    else calm(texts['thanks_title'], texts['thanks_text']);
  } else if (step.kind === 'consent') showConsent(study, step, texts);
  else if (step.kind === 'ask') showForm(study, step, texts);
  else showPhase(step, texts, study.participant);
  window.scrollTo(0, 0);
  page.focus({ preventScroll: true });
}

function showProgress(state: ParticipantState, texts: Texts): void {
  const bar = document.querySelector<HTMLElement>('.progress');
  bar?.setAttribute('aria-valuemin', '0');
  bar?.setAttribute('aria-valuemax', String(state.total));
  bar?.setAttribute('aria-valuenow', String(state.done));
  bar?.querySelector('i')?.style.setProperty('width', `${(100 * state.done) / state.total}%`);
  const n = Math.min(state.done + 1, state.total);
  elementOf('who').textContent = `${state.participant} · `
    + fill(texts['step_of'] ?? '', { n, total: state.total });
}

/** Consent is a form like the others, so it has their keyboard, their summary and their marks. */
function showConsent(study: ParticipantApi, step: ShownStep, texts: Texts): void {
  const choice = (id: string, name: string, yes: string, no: string): Item => ({
    id, text: texts[name] ?? '', kind: 'choice',
    choices: [{ value: 'yes', text: texts[yes] ?? '' }, { value: 'no', text: texts[no] ?? '' }],
  });
  const asked: Questionnaire = {
    name: 'consent',
    title: texts['consent_title'] ?? '',
    items: [
      choice('agreed', 'consent_question', 'consent_yes', 'consent_no'),
      choice('images', 'images_question', 'images_yes', 'images_no'),
    ],
  };
  form = new QuestionForm(asked, { ...texts, hand_in: texts['continue'] ?? '' }, {}, {
    changed: () => undefined,
    handIn: async (answers) => {
      await persist(() => study.consent({
        agreed: answers['agreed'] === 'yes', images: answers['images'] === 'yes',
      }).then((state) => show(study, state, texts)), keepingIn(texts));
      return null;
    },
  });
  const [title, ...rest] = Array.from(form.element.children);
  const text = make('div', { className: 'consent-text' }, ...paragraphs(step.text));
  form.element.replaceChildren(title as Element, text, ...rest);
  page.replaceChildren(form.element);
  // Who does not take part takes no photos.
  const images = form.element.querySelector('#images-yes')?.closest<HTMLElement>('.question');
  form.element.addEventListener('change', () => {
    const no = form?.answers['agreed'] === 'no';
    if (images !== null && images !== undefined) images.hidden = no;
    const second = form?.element.querySelector<HTMLInputElement>('#images-no');
    if (no && second != null) second.checked = true;
  });
}

function showForm(study: ParticipantApi, step: ShownStep, texts: Texts): void {
  const made = stepForm(study, step, texts, {
    done: (state) => show(study, state, texts), keeping: keepingIn(texts),
  });
  form = made.form;
  keeper = made.keeper;
  page.replaceChildren(form.element);
}

function showPhase(step: ShownStep, texts: Texts, participant: string): void {
  const title = texts[`${step.kind}_title`] ?? '';
  page.classList.add('calm');
  const text = make('div', {}, ...paragraphs(step.text));
  if (!step.running) {
    page.replaceChildren(make('h1', {}, title), text,
      make('p', { className: 'waiting', role: 'status' }, texts['wait_text'] ?? ''));
    return;
  }
  const open = make('a', { className: 'primary', href: captureUrl(step, participant) },
    texts['open_camera'] ?? '');
  page.replaceChildren(make('h1', {}, title), text, ...(step.kind === 'introduction' ? [] : [open]));
}

function captureUrl(step: ShownStep, participant: string): string {
  const next = new URLSearchParams({ study: participant });
  const source = query.get('source');
  if (source !== null) next.set('source', source);
  const { guide, area_side_m } = step.capture ?? { guide: 'none', area_side_m: null };
  if (guide !== 'none') next.set('guide', guide);
  if (area_side_m !== null) next.set('area', String(area_side_m));
  return `./?${next.toString()}`;
}

function keepingIn(texts: Texts): (how: Keeping) => void {
  return (how) => say(texts[how] ?? '', how);
}

function calm(title: string | undefined, text: string | undefined): void {
  page.className = 'page calm';
  page.replaceChildren(make('h1', {}, title ?? ''), make('p', {}, text ?? ''));
}

function fail(sentence: string): void {
  page.className = 'page calm';
  page.replaceChildren(make('div', { className: 'error', role: 'alert' }, sentence));
}

function say(text: string, how = ''): void {
  const line = elementOf('kept');
  line.textContent = text;
  line.className = how;
}

function elementOf(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element #${id}`);
  return element;
}

main().catch((error: unknown) => fail(error instanceof Error ? error.message : String(error)));
