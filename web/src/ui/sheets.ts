/** What slides up from below: the list of views, settings; `finish_sheet.ts` has the end. */

import type { CapturedView } from '../capture/capture_session';
import type { Look } from '../render/view_renderer';
import type { DatasetQuery, Selection } from '../wire';
import { button, make } from './dom';

/** What the sheets ask of the page. */
export interface SheetActions {
  undo(id: string): void;
  restore(id: string): void;
  retry(id: string): void;
  setLook(look: Look): void;
  finish(name: string): void;
  /** Take views again after the end. */
  takeMore(): void;
  newSession(): void;
  /** How good the views are, and how many are enough. @throws ApiError */
  selection(signal: AbortSignal): Promise<Selection>;
  /** Have the data set of the best so many, or of all, made ready. @returns Where it is. @throws ApiError */
  dataset(query: DatasetQuery): Promise<string>;
  /** Where the session can be looked at as a place. */
  viewer(): string;
}

/** What a sheet shows of a session. */
export interface SheetState {
  readonly views: readonly CapturedView[];
  /** Undone or set aside, and can be brought back. */
  readonly restorable: readonly CapturedView[];
  /** The session takes no more views. */
  readonly isOver: boolean;
}

export interface Sheet {
  readonly element: HTMLElement;
  /** Called when that changes while it is open. */
  readonly update?: (state: SheetState) => void;
  readonly closed?: () => void;
}

export const VIEW_STATES: Readonly<Record<CapturedView['state'], string>> = {
  waiting: 'waiting to upload',
  uploading: 'uploading',
  queued: 'processing',
  ready: 'ready',
  failed: 'failed',
};

export function sheet(title: string, close: () => void, ...content: Node[]): HTMLElement {
  const element = make('section', { className: 'sheet', role: 'dialog' },
    make('h2', {}, title), button('close', '✕', 'Close', close), ...content);
  element.ariaLabel = title;
  return element;
}

export function viewsSheet(state: SheetState, actions: SheetActions, close: () => void): Sheet {
  const list = make('ul');
  const away = [
    awayList('Undone, until you finish', (view) => !view.setAside, actions),
    awayList('Set aside: others show the same', (view) => view.setAside, actions),
  ];
  const update = ({ views, restorable }: SheetState): void => {
    const items = views.map((view, i) => viewItem(view, i, actions));
    list.replaceChildren(...items.reverse());
    if (views.length === 0) list.replaceChildren(make('li', {}, 'No views yet.'));
    for (const each of away) each.update(restorable);
  };
  update(state);
  return { element: sheet('Views', close, list, ...away.map(({ element }) => element)), update };
}

/** Those of the views that are not in the data set, with a button to bring each back. */
function awayList(
  title: string, isListed: (view: CapturedView) => boolean, actions: SheetActions,
): { readonly element: HTMLElement; update(restorable: readonly CapturedView[]): void } {
  const list = make('ul', { className: 'undone' });
  const element = make('div', {}, make('h3', {}, title), list);
  return {
    element,
    update(restorable) {
      const items = restorable.filter(isListed).map((view) => undoneItem(view, actions));
      element.hidden = items.length === 0;
      list.replaceChildren(...items.reverse());
    },
  };
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

/** Of what was undone the picture is here only while it was never sent: the server shows it to nobody. */
function undoneItem(view: CapturedView, actions: SheetActions): HTMLElement {
  const name = view.number === null ? 'View' : `View ${view.number}`;
  const time = new Date(view.time_s * 1000).toLocaleTimeString([], { timeStyle: 'short' });
  return make('li', {},
    ...(view.setAside || view.thumbnailUrl.startsWith('blob:') ? [make('img', { src: view.thumbnailUrl, alt: '' })] : []),
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
