/** What slides up from below: the list of views, settings, the end of a session. */

import type { CapturedView } from '../capture/capture_session';
import type { Look } from '../render/view_renderer';
import { button, make } from './dom';
import { viewsText } from './words';

/** What the sheets ask of the page. */
export interface SheetActions {
  undo(id: string): void;
  restore(id: string): void;
  retry(id: string): void;
  setLook(look: Look): void;
  finish(name: string): void;
  newSession(): void;
  readonly datasetUrl: string;
}

export interface Sheet {
  readonly element: HTMLElement;
  /** Called when views change while it is open. */
  readonly update?: (views: readonly CapturedView[], restorable: readonly CapturedView[]) => void;
}

export const VIEW_STATES: Readonly<Record<CapturedView['state'], string>> = {
  waiting: 'waiting to upload',
  uploading: 'uploading',
  queued: 'processing',
  ready: 'ready',
  failed: 'failed',
};

function sheet(title: string, close: () => void, ...content: Node[]): HTMLElement {
  const element = make('section', { className: 'sheet', role: 'dialog' },
    make('h2', {}, title), button('close', '✕', 'Close', close), ...content);
  element.ariaLabel = title;
  return element;
}

export function viewsSheet(
  views: readonly CapturedView[], restorable: readonly CapturedView[], actions: SheetActions,
  close: () => void,
): Sheet {
  const list = make('ul');
  const undone = make('ul', { className: 'undone' });
  const undoneTitle = make('h3', {}, 'Undone, until you finish');
  const update = (now: readonly CapturedView[], gone: readonly CapturedView[]): void => {
    const items = now.map((view, i) => viewItem(view, i, actions));
    list.replaceChildren(...items.reverse());
    if (now.length === 0) list.replaceChildren(make('li', {}, 'No views yet.'));
    undoneTitle.hidden = gone.length === 0;
    undone.replaceChildren(...gone.map((view) => undoneItem(view, actions)).reverse());
  };
  update(views, restorable);
  return { element: sheet('Views', close, list, undoneTitle, undone), update };
}

/** What is to be known of a view: its problem, or its state and the generator of its MPI. */
export function viewNote(view: Pick<CapturedView, 'state' | 'problem' | 'generator' | 'guessed'>): string {
  if (view.problem !== null && view.state !== 'ready') return view.problem;
  const notes = [VIEW_STATES[view.state]];
  if (view.generator !== null) notes.push(`made by ${view.generator}`);
  if (view.guessed) notes.push('distance is a guess: take another view nearby');
  if (view.problem !== null) notes.push(view.problem);
  return notes.join(' · ');
}

/** Its picture is on this device only while it was never sent: the server shows it to nobody. */
function undoneItem(view: CapturedView, actions: SheetActions): HTMLElement {
  const name = view.number === null ? 'View' : `View ${view.number}`;
  const time = new Date(view.time_s * 1000).toLocaleTimeString([], { timeStyle: 'short' });
  return make('li', {},
    ...(view.thumbnailUrl.startsWith('blob:') ? [make('img', { src: view.thumbnailUrl, alt: '' })] : []),
    make('div', {}, name, make('small', {}, `taken at ${time}`)),
    button('pill', 'Bring back', `Bring back ${name.toLowerCase()}`, () => actions.restore(view.id)));
}

function viewItem(view: CapturedView, index: number, actions: SheetActions): HTMLElement {
  return make('li', {},
    make('img', { src: view.thumbnailUrl, alt: '' }),
    make('div', {}, `View ${index + 1}`,
      make('small', {}, viewNote(view))),
    ...(view.state === 'failed' && !view.onServer
      ? [button('pill', 'Try again', `Send view ${index + 1} again`, () => actions.retry(view.id))]
      : []),
    button('pill', 'Undo', `Undo view ${index + 1}`, () => actions.undo(view.id)));
}

export function settingsSheet(look: Look, actions: SheetActions, close: () => void): Sheet {
  let now = look;
  const change = (part: Partial<Look>): void => {
    now = { ...now, ...part };
    actions.setLook(now);
  };
  const pattern = make('input', { type: 'checkbox', checked: look.pattern });
  pattern.onchange = () => change({ pattern: pattern.checked });
  return {
    element: sheet('Settings', close,
      slider('Error threshold', 0.05, 1.5, 0.01, look.threshold, (threshold) =>
        change({ threshold })),
      slider('Opacity of the red', 0.1, 1, 0.05, look.peakOpacity, (peakOpacity) =>
        change({ peakOpacity })),
      make('label', {}, pattern, ' Patterns for every mark (colour-blind mode)'),
      make('p', {}, 'Red: wrong, a view from here mends it. Hatched: not captured yet. Amber dots: no view '
        + 'will help; touch them to see why.'),
      make('p', {}, 'A pixel is wrong when its error exceeds the threshold. The error is the sum of the '
        + 'differences in red, green and blue (0 to 3) between the digital double and the live '
        + 'picture. The paper uses 0.40.')),
  };
}

function slider(
  name: string, min: number, max: number, step: number, value: number,
  onchange: (value: number) => void,
): HTMLElement {
  const output = make('output', {}, value.toFixed(2));
  const input = make('input', {
    type: 'range', min: String(min), max: String(max), step: String(step), value: String(value),
  });
  input.oninput = () => {
    output.textContent = Number(input.value).toFixed(2);
    onchange(Number(input.value));
  };
  return make('label', {}, name, output, input);
}

export function finishSheet(
  name: string, views: readonly CapturedView[], restorable: readonly CapturedView[],
  actions: SheetActions, close: () => void,
): Sheet {
  const input = make('input', { type: 'text', value: name, maxLength: 80 });
  const state = make('p');
  const download = make('a', { className: 'primary', href: actions.datasetUrl, download: '' },
    'Download the data set (zip)');
  const undone = make('p', { className: 'quiet' });
  const update = (now: readonly CapturedView[], gone: readonly CapturedView[]): void => {
    undone.hidden = gone.length === 0;
    undone.textContent = `Finishing deletes the ${gone.length === 1 ? 'view' : `${gone.length} views`} that `
      + 'you undid. You can still bring them back in the list of views.';
    const onServer = now.filter((view) => view.onServer).length;
    state.textContent = onServer === now.length
      ? `${viewsText(now.length)}, saved on the server.`
      : `${onServer} of ${viewsText(now.length)} saved on the server. The rest is saved on this `
        + 'device and is uploaded as soon as there is a connection.';
    download.hidden = onServer === 0;
  };
  update(views, restorable);
  const finish = (): void => {
    actions.finish(input.value.trim() || name);
    close();
  };
  download.onclick = () => actions.finish(input.value.trim() || name);
  return {
    element: sheet('Finish', close, state, undone, make('label', {}, 'Session name', input),
      download,
      make('button', { className: 'secondary', type: 'button', onclick: finish },
        'Finish without downloading'),
      make('button', { className: 'secondary', type: 'button', onclick: () => actions.newSession() },
        'Start a new session')),
    update,
  };
}
