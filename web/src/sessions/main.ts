/** The dashboard: /sessions, and /sessions#ID for one of them. */

import { Api, ApiError } from '../server/api';
import { serverEvents, sessionEvents, type Connection } from '../server/events';
import { make } from '../ui/dom';
import { FormatChoice, type DatasetFormat } from '../ui/format_choice';
import { PAPER_PERCENT, percent } from '../ui/share_graph';
import { viewsText } from '../ui/words';
import type { PeakedSample, ServerEvent, Session, SessionEvent, SessionSummary } from '../wire';
import type { ShownSession } from '../view/open_session';
import { drawShares } from './share_chart';
import { drawTopView, topViewOf } from './top_view';

const api = new Api();
/** Samples come once a second; the charts need not be faster. */
const CHARTS_EVERY_MS = 2000;

/** So long a deleted session can be restored. */
const RESTORABLE_DAYS = 30;
const DAY_S = 24 * 3600;

const summaries = new Map<string, SessionSummary>();
let damaged: readonly string[] = [];
let shown: { id: string; session: Session; samples: readonly PeakedSample[] } | null = null;
let watching = new AbortController();
/** The session as a place, of which the element stays when the rest is drawn anew. */
let place: { readonly id: string; readonly element: HTMLElement; seen: ShownSession | null } | null = null;
/** How far the list was scrolled when a session was chosen. */
let listAt_px = 0;

async function main(): Promise<void> {
  await api.pairFromHash();
  void serverEvents(api, { onEvent: heard, onConnection: connected }, new AbortController().signal);
  window.addEventListener('hashchange', () => void open(location.hash.slice(1)));
  setInterval(() => void refreshSamples(), CHARTS_EVERY_MS);
}

function connected(connection: Connection, refusal: ApiError | null): void {
  if (refusal !== null) say(refusal.problem);
  else if (connection === 'online') say('');
}

function heard(event: ServerEvent): void {
  switch (event.type) {
    case 'SessionList':
      summaries.clear();
      for (const summary of event.sessions) summaries.set(summary.id, summary);
      damaged = event.problems ?? [];
      if (shown === null) void open(location.hash.slice(1));
      break;
    case 'SessionChanged': summaries.set(event.summary.id, event.summary); break;
    default: event satisfies never;
  }
  drawList();
}

function newest(): SessionSummary[] {
  return Array.from(summaries.values()).filter((summary) => !isDeleted(summary) && !isEmpty(summary))
    .sort((a, b) => Number(b.live) - Number(a.live) || b.created_s - a.created_s);
}

function drawList(): void {
  const items = newest();
  const gone = Array.from(summaries.values())
    .filter((summary) => isDeleted(summary) && !isEmpty(summary));
  const empty = make('p', { className: 'quiet' }, 'No sessions yet. Open the capture page on a phone '
    + 'with the link that the server printed, or try the virtual phone. A session is listed here '
    + 'when it has a view.');
  elementOf('sessions').classList.toggle('none', items.length + gone.length === 0);
  drawnAnew('list', [
    ...(items.length > 0 ? items.map((summary) => listed('item', summary, itemOf))
      : [kept('empty', () => empty)]),
    ...(gone.length === 0 ? []
      : [kept('deleted', () => make('h2', { className: 'quiet' }, 'Deleted'))]),
    ...gone.map((summary) => listed('deleted', summary, deletedOf)),
    ...damaged.map((problem) =>
      kept(`problem ${problem}`, () => make('p', { className: 'quiet problem' }, problem))),
  ]);
}

/** What the list shows, by what it was made from: an element that stays keeps its focus. */
let elements = new Map<string, HTMLElement>();
let drawn = new Map<string, HTMLElement>();

function kept(key: string, made: () => HTMLElement): HTMLElement {
  const element = elements.get(key) ?? made();
  drawn.set(key, element);
  return element;
}

function listed(
  kind: string, summary: SessionSummary, made: (summary: SessionSummary) => HTMLElement,
): HTMLElement {
  const current = summary.id === shown?.id;
  const share = percent(summary.peaked_share);
  return kept(JSON.stringify([kind, { ...summary, peaked_share: share }, current]), () => made(summary));
}

function drawnAnew(id: string, children: readonly HTMLElement[]): void {
  const parent = elementOf(id);
  elements = drawn;
  drawn = new Map();
  const same = children.length === parent.childNodes.length
    && children.every((child, i) => child === parent.childNodes[i]);
  if (!same) parent.replaceChildren(...children);
}

function itemOf(summary: SessionSummary): HTMLElement {
  const { id, name, live, captures, finished, restorable = 0 } = summary;
  const marked = summary.peaked_share === null ? '' : ` · ${percent(summary.peaked_share)} marked`;
  const what = captures > 0 ? `${viewsText(captures)}${marked}`
    : restorable > 0 ? `${viewsText(restorable)} taken back` : 'no view that can be read';
  const item = make('button', { type: 'button', onclick: () => { location.hash = id; } },
    make('b', { className: live ? 'live' : '' }, name),
    make('span', { className: 'quiet' }, `${what}${finished ? ' · finished' : ''} · ${whenOf(summary)}`),
    thumbnailsOf(summary));
  item.setAttribute('aria-current', String(id === shown?.id));
  return item;
}

function thumbnailsOf({ id, thumbnails = [] }: SessionSummary): HTMLElement {
  return make('span', { className: 'thumbnails' }, ...thumbnails.map((capture) =>
    make('img', { src: api.thumbnailUrl(id, capture), alt: '', loading: 'lazy' })));
}

/** A session that was deleted: for some time it can be restored, or erased at once. */
function deletedOf(summary: SessionSummary): HTMLElement {
  const restore = button('Restore', () =>
    void api.changeSession(summary.id, { deleted: false }).catch(failed));
  const erase = button('Erase for good', () => {
    if (!confirm(`Erase "${summary.name}" with all its photos, for good?`)) return;
    void api.eraseSession(summary.id).then(() => {
      summaries.delete(summary.id);
      drawList();
    }, failed);
  });
  const passed = Date.now() / 1000 - (summary.deleted_s ?? 0);
  const days = Math.max(0, Math.ceil(RESTORABLE_DAYS - passed / DAY_S));
  return make('div', { className: 'deleted' }, make('b', {}, summary.name),
    make('span', { className: 'quiet' }, `${viewsText(summary.captures)} · erased in ${days} days`),
    make('div', { className: 'row' }, restore, erase));
}

function isDeleted({ deleted_s }: SessionSummary): boolean {
  return deleted_s != null;
}

/** Such sessions begin whenever a capture page is opened; nobody misses them. */
function isEmpty({ captures, restorable = 0, damaged: lost = 0 }: SessionSummary): boolean {
  return captures + restorable + lost === 0;
}

/**
 * Show a session. Where there is room for list and session, the newest is shown while nobody has
 * chosen one; a phone shows the list then.
 */
async function open(chosen: string): Promise<void> {
  const page = elementOf('sessions');
  if (page.classList.toggle('chosen', chosen !== '')) {
    listAt_px = scrollY;
    scrollTo(0, 0);
  } else {
    scrollTo(0, listAt_px);
  }
  const id = chosen || (newest()[0]?.id ?? '');
  if (id === shown?.id) return;
  watching.abort();
  shown = null;
  place?.seen?.viewer[Symbol.dispose]();
  place = null;
  elementOf('detail').replaceChildren();
  say('');
  if (id === '') return;
  watching = new AbortController();
  await sessionEvents(api, id, {
    onEvent: (event) => follow(id, event), onConnection: connected,
  }, watching.signal, { role: 'watch' });
}

function button(text: string, onclick: () => void): HTMLButtonElement {
  return make('button', { type: 'button', onclick }, text);
}

function follow(id: string, event: SessionEvent): void {
  place?.seen?.place.follow(event);
  switch (event.type) {
    case 'SessionState':
      shown = { id, session: event.session, samples: shown?.id === id ? shown.samples : [] };
      void refreshSamples();
      break;
    case 'CaptureChanged': {
      if (shown === null) return;
      const others = shown.session.captures.filter((capture) => capture.id !== event.capture.id);
      const captures = [...others, event.capture].sort((a, b) => a.number - b.number);
      shown = { ...shown, session: { ...shown.session, captures } };
      break;
    }
    case 'GuidanceChanged': case 'TrainingChanged':
      return; // the place shows it
    case 'SessionChanged':
      if (shown === null) return;
      if (isDeleted(event.summary)) {
        summaries.set(id, event.summary);
        if (location.hash === '') void open('');
        else location.hash = '';
        return drawList();
      }
      shown = { ...shown, session: { ...shown.session, summary: event.summary } };
      break;
    default: event satisfies never;
  }
  drawDetail();
  drawList();
}

async function refreshSamples(): Promise<void> {
  const { id } = shown ?? {};
  if (id === undefined) return;
  const { samples } = await api.peaked(id).catch(() => ({ samples: [] }));
  if (shown?.id !== id || samples.length === shown.samples.length) return;
  shown = { ...shown, samples };
  drawCharts();
}

/** Anew only when it has changed: who is about to press a button presses this one. */
function drawDetail(): void {
  if (shown === null) return;
  const { id, session } = shown;
  const { summary, captures } = session;
  const key = JSON.stringify([{ ...summary, peaked_share: null, live: false }, captures]);
  const detail = elementOf('detail');
  if (detail.dataset['drawn'] === key && detail.childElementCount > 0) return;
  detail.dataset['drawn'] = key;
  const rename = button('Rename', () => {
    const name = prompt('Session name', summary.name)?.trim();
    if (name !== undefined && name !== '') void api.changeSession(id, { name }).catch(failed);
  });
  const remove = button('Delete', () => {
    const question = `Delete "${summary.name}"? You can restore it for ${RESTORABLE_DAYS} days.`;
    if (confirm(question)) void api.changeSession(id, { deleted: true }).catch(failed);
  });
  const photos = captures.filter(({ removed }) => removed !== true).map((capture) => make('a', {
    className: capture.state,
    href: api.photoUrl(id, capture.id),
    target: '_blank',
    title: capture.problem ?? capture.state,
  }, make('img', { src: api.thumbnailUrl(id, capture.id), alt: `View ${capture.number}`, loading: 'lazy' }),
  make('span', {}, String(capture.number))));
  const undone = captures.filter(({ restorable }) => restorable === true).map((capture) =>
    button(`Bring back view ${capture.number}${capture.ending === 'set_aside' ? ', set aside' : ''}`, () =>
      void api.restoreCapture(id, capture.id).catch(failed)));
  const whole = make('a', { className: 'button primary', download: '' }, 'Download the data set');
  const best = make('a', {
    className: 'button', download: '', title: 'As many views as show nearly what all do',
  }, 'Download the best');
  const point = (format: DatasetFormat): void => {
    whole.href = api.datasetUrl(id, { format });
    best.href = api.datasetUrl(id, { views: 'auto', format });
  };
  const choice = new FormatChoice(point);
  point(choice.format);
  const [head, rest] = partsOf(detail, placeOf(id, session));
  head.replaceChildren(
    make('a', { className: 'button back', href: '#' }, 'All sessions'),
    make('h1', {}, summary.name),
    make('div', { className: 'quiet' }, `${viewsText(summary.captures)}, ${summary.ready} ready`
      + `${summary.finished ? ', finished' : ''} · folder ${summary.folder}`),
    make('div', { className: 'row' },
      whole, ...(summary.ready < 2 ? [] : [best]), choice.element,
      summary.finished ? button('Take more views', () => void takeMore(summary))
        : make('a', { className: 'button', href: capturePage(summary) }, 'Continue capturing'), rename, remove),
    ...(summary.damaged ? [make('p', { className: 'quiet problem' }, `${summary.damaged} records of this `
      + 'session are damaged on the disk and were left out. The server names them when it starts.')] : []),
  );
  rest.replaceChildren(
    make('div', { className: 'cards' },
      make('div', { className: 'card' }, make('h2', {}, 'Seen from above'), make('div', { id: 'above' })),
      make('div', { className: 'card', id: 'shares-card' }, make('h2', {}, `Share of red over time (dashed: ${PAPER_PERCENT})`),
        make('div', { id: 'shares' }))),
    make('div', { className: 'photos' }, ...photos),
    ...(undone.length > 0 ? [make('h2', { className: 'quiet' }, 'Taken back'),
      make('div', { className: 'row undone' }, ...undone)] : []),
  );
  drawCharts();
}

/** What lies above and below the place, which stays where it is: who uses it goes on. */
function partsOf(detail: HTMLElement, seen: HTMLElement): readonly [HTMLElement, HTMLElement] {
  const [head, middle, rest] = detail.children;
  if (middle === seen && head instanceof HTMLElement && rest instanceof HTMLElement) return [head, rest];
  const parts = [make('div', { className: 'head' }), make('div', { className: 'rest' })] as const;
  detail.replaceChildren(parts[0], seen, parts[1]);
  return parts;
}

/** The session as a place to look around in; what shows it is loaded once there is something to see. */
function placeOf(id: string, session: Session): HTMLElement {
  const opening = place?.id === id ? place : { id, element: make('section', { className: 'place', ariaLabel: 'The captured place' }), seen: null };
  place = opening;
  opening.element.hidden = session.captures.every(({ removed }) => removed === true);
  if (!opening.element.hidden && !opening.element.dataset['opened']) {
    opening.element.dataset['opened'] = 'yes';
    openPlace(opening, session).catch((error: unknown) => {
      delete opening.element.dataset['opened']; // tried again with the next news
      failed(error);
    });
  }
  return opening.element;
}

async function openPlace(opening: NonNullable<typeof place>, session: Session): Promise<void> {
  const [{ showSession }, { options }] = await Promise.all([import('../view/open_session'), api.server()]);
  if (place !== opening) return;
  const larger = make('a', { className: 'button', href: `./view#${opening.id}` }, 'Full screen');
  opening.seen = showSession(api, shown?.id === opening.id ? shown.session : session, options, opening.element,
    { compact: true, trains: true, more: [larger] });
}

function capturePage({ id, source }: SessionSummary): string {
  return `./?source=${source === 'other' ? 'virtual' : source}&session=${id}`;
}

/** A finished session takes no views until one says so. */
async function takeMore(summary: SessionSummary): Promise<void> {
  await api.changeSession(summary.id, { finished: false })
    .then(() => { location.href = capturePage(summary); }, failed);
}

function whenOf({ created_s }: SessionSummary): string {
  return new Date(created_s * 1000).toLocaleString([], { dateStyle: 'short', timeStyle: 'short' });
}

function drawCharts(): void {
  if (shown === null) return;
  const { session, samples } = shown;
  // Only numbers go into these pictures, so they are safe as markup.
  elementOf('above').innerHTML = drawTopView(topViewOf(session.captures, samples));
  elementOf('shares-card').hidden = samples.length === 0;
  elementOf('shares').innerHTML = drawShares(samples, session.captures);
}

function failed(error: unknown): void {
  say(error instanceof ApiError ? error.problem : String(error));
}

function say(problem: string): void {
  elementOf('problem').hidden = problem === '';
  elementOf('problem').textContent = problem;
}

function elementOf(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element #${id}`);
  return element;
}

void main();
