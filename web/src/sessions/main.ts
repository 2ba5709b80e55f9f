/** The dashboard: /sessions, and /sessions#ID for one of them. */

import { Api } from '../server/api';
import { serverEvents, sessionEvents } from '../server/events';
import { make } from '../ui/dom';
import { PAPER_PERCENT, percent } from '../ui/share_graph';
import { viewsText } from '../ui/words';
import type { PeakedSample, ServerEvent, Session, SessionEvent, SessionSummary } from '../wire';
import { drawShares } from './share_chart';
import { drawTopView, topViewOf } from './top_view';

const api = new Api();
/** Samples come once a second; the charts need not be faster. */
const CHARTS_EVERY_MS = 2000;

const summaries = new Map<string, SessionSummary>();
let shown: { id: string; session: Session; samples: readonly PeakedSample[] } | null = null;
let watching = new AbortController();

async function main(): Promise<void> {
  await api.pairFromHash();
  void serverEvents(api, {
    onEvent: heard,
    onConnection: (_, refusal) => { if (refusal !== null) fail(refusal.problem); },
  }, new AbortController().signal);
  window.addEventListener('hashchange', () => void open(location.hash.slice(1)));
  setInterval(() => void refreshSamples(), CHARTS_EVERY_MS);
}

function heard(event: ServerEvent): void {
  switch (event.type) {
    case 'SessionList':
      summaries.clear();
      for (const summary of event.sessions) summaries.set(summary.id, summary);
      if (shown === null) void open(location.hash.slice(1) || (newest()[0]?.id ?? ''));
      break;
    case 'SessionChanged': summaries.set(event.summary.id, event.summary); break;
    default: event satisfies never;
  }
  drawList();
}

function newest(): SessionSummary[] {
  return Array.from(summaries.values())
    .sort((a, b) => Number(b.live) - Number(a.live) || b.created_s - a.created_s);
}

function drawList(): void {
  const items = newest().map((summary) => {
    const item = make('button', { type: 'button', onclick: () => { location.hash = summary.id; } },
      make('b', { className: summary.live ? 'live' : '' }, summary.name),
      make('span', { className: 'quiet' }, `${viewsText(summary.captures)} · ${percent(summary.peaked_share)} red · `
        + whenOf(summary)));
    item.setAttribute('aria-current', String(summary.id === shown?.id));
    return item;
  });
  const empty = make('p', { className: 'quiet' }, 'No sessions yet. Open the capture page on a phone '
    + 'with the link that the server printed, or try the virtual phone.');
  elementOf('list').replaceChildren(...(items.length > 0 ? items : [empty]));
}

async function open(id: string): Promise<void> {
  watching.abort();
  if (id === '') return;
  watching = new AbortController();
  shown = null;
  await sessionEvents(api, id, {
    onEvent: (event) => follow(id, event),
    onConnection: (_, refusal) => { if (refusal !== null) fail(refusal.problem); },
  }, watching.signal, { role: 'watch' });
}

function follow(id: string, event: SessionEvent): void {
  switch (event.type) {
    case 'SessionState':
      shown = { id, session: event.session, samples: [] };
      void refreshSamples();
      break;
    case 'CaptureChanged': {
      if (shown === null) return;
      const others = shown.session.captures.filter((capture) => capture.id !== event.capture.id);
      const captures = [...others, event.capture].sort((a, b) => a.number - b.number);
      shown = { ...shown, session: { ...shown.session, captures } };
      break;
    }
    case 'SessionChanged':
      if (shown === null) return;
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

function drawDetail(): void {
  if (shown === null) return;
  const { id, session } = shown;
  const { summary, captures } = session;
  const rename = make('button', { type: 'button' }, 'Rename');
  rename.onclick = () => {
    const name = prompt('Session name', summary.name)?.trim();
    if (name !== undefined && name !== '') void api.changeSession(id, { name });
  };
  const photos = captures.map((capture) => make('a', {
    className: capture.removed === true ? 'removed' : capture.state,
    href: api.photoUrl(id, capture.id),
    target: '_blank',
    title: capture.problem ?? (capture.removed === true ? 'undone' : capture.state),
  }, make('img', { src: api.thumbnailUrl(id, capture.id), alt: `View ${capture.number}`, loading: 'lazy' }),
  make('span', {}, String(capture.number))));
  elementOf('detail').replaceChildren(
    make('h1', {}, summary.name),
    make('div', { className: 'quiet' }, `${viewsText(summary.captures)}, ${summary.ready} ready`
      + `${summary.finished ? ', finished' : ''} · folder ${summary.folder}`),
    make('div', { className: 'row' },
      make('a', { className: 'button primary', href: api.datasetUrl(id), download: '' },
        'Download the data set'),
      make('a', { className: 'button', href: `./?source=${summary.source === 'other' ? 'virtual'
        : summary.source}&session=${id}` }, 'Continue capturing'), rename),
    make('div', { className: 'cards' },
      make('div', { className: 'card' }, make('h2', {}, 'Seen from above'), make('div', { id: 'above' })),
      make('div', { className: 'card' }, make('h2', {}, `Share of red over time (dashed: ${PAPER_PERCENT})`),
        make('div', { id: 'shares' }))),
    make('div', { className: 'photos' }, ...photos),
  );
  drawCharts();
}

function whenOf({ created_s }: SessionSummary): string {
  return new Date(created_s * 1000).toLocaleString([], { dateStyle: 'short', timeStyle: 'short' });
}

function drawCharts(): void {
  if (shown === null) return;
  const { session, samples } = shown;
  // Only numbers go into these pictures, so they are safe as markup.
  elementOf('above').innerHTML = drawTopView(topViewOf(session.captures, samples));
  elementOf('shares').innerHTML = drawShares(samples, session.captures);
}

function fail(problem: string): void {
  elementOf('detail').replaceChildren(make('p', {}, problem));
}

function elementOf(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element #${id}`);
  return element;
}

void main();
