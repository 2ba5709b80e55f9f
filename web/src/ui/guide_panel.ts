/** What lies over the picture in a guided capture, in place of the share of red. */

import type { GuideKind } from '../guidance/guide_options';
import type { GuideState } from '../guidance/guide_session';
import { button, make, say, show } from './dom';
import { viewsText } from './words';

export interface GuideActions {
  place(): void;
  scanAgain(): void;
  setAutoShutter(on: boolean): void;
}

/** Words and numbers change at most this often, so that they can be read. */
const EVERY_MS = 300;
/** Steps smaller than this are not said. */
const MIN_SAID_M = 0.005;

const ASKS: Readonly<Record<GuideKind, (state: GuideState) => string>> = {
  plenoptic: ({ bound }) => (bound === null ? '' : `At least ${viewsText(bound.numViews)} needed: `
    + `a grid of ${bound.viewsPerSide} × ${bound.viewsPerSide}, ${cm(bound.pitch_m)} apart`),
  planes: ({ bound }) => (bound === null ? '' : `Planes needed: `
    + `${bound.viewsPerSide} × ${bound.viewsPerSide} views each, ${cm(bound.pitch_m)} apart`),
  hemisphere: () => 'The targets surround the point that you look at when you place them',
};

export class GuidePanel {
  readonly #number = make('strong', {}, '–');
  readonly #unit = make('small');
  readonly #bar = make('progress', { max: 1, value: 0, ariaLabel: 'Targets done' });
  readonly #text = make('p', { role: 'status' });
  readonly #place = button('pill', 'Place the targets', 'Place the targets here (space)', () =>
    this.#actions.place());
  readonly #again = button('pill', 'Scan again', 'Remove the targets and scan again', () =>
    this.#actions.scanAgain());
  readonly #auto = button('pill', 'Auto', 'Take a view automatically at each target', () => {
    this.#actions.setAutoShutter(this.#auto.ariaPressed !== 'true');
  });
  readonly #actions: GuideActions;
  #shownAt_ms = -Infinity;
  #phase: GuideState['phase'] | null = null;
  #taken = -1;

  constructor(root: HTMLElement, readonly kind: GuideKind, actions: GuideActions) {
    this.#actions = actions;
    root.append(make('section', { className: 'guide', ariaLabel: 'Guide' },
      make('div', {}, this.#number, this.#unit), this.#bar, this.#text,
      make('div', { className: 'choices' }, this.#place, this.#auto, this.#again)));
  }

  /** May be called for every frame. */
  show(time_ms: number, state: GuideState, autoShutter: boolean, problem: string | null): void {
    const changed = state.phase !== this.#phase || state.taken !== this.#taken;
    if (!changed && time_ms - this.#shownAt_ms < EVERY_MS) return;
    this.#shownAt_ms = time_ms;
    this.#phase = state.phase;
    this.#taken = state.taken;
    const scanning = state.phase === 'scan';
    const total = state.takenBy.length;
    say(this.#number, scanning ? metres(state.zMin_m) : `${state.taken} / ${total}`);
    say(this.#unit, scanning ? 'nearest depth' : 'targets');
    show(this.#bar, !scanning);
    this.#bar.value = total === 0 ? 0 : state.taken / total;
    say(this.#text, problem ?? this.#sentence(state));
    show(this.#place, scanning);
    this.#place.disabled = state.zMin_m === null;
    show(this.#auto, !scanning);
    show(this.#again, !scanning);
    const pressed = String(autoShutter);
    if (this.#auto.ariaPressed !== pressed) this.#auto.ariaPressed = pressed;
  }

  #sentence(state: GuideState): string {
    switch (state.phase) {
      case 'scan':
        if (state.zMin_m === null) return 'Slowly look at everything that should be in the pictures.';
        return `${ASKS[this.kind](state)}. Go to the centre and place the targets.`;
      case 'capture':
        if (state.reach !== null) return 'Hold still and take the view.';
        return `Align the rings. Next target: ${steps(state.toNext_m)}.`;
      case 'done': return 'All targets are done.';
      default: return state.phase satisfies never;
    }
  }
}

/** "4 cm right, 2 cm down": the two largest steps to the next target. */
export function steps(toNext_m: GuideState['toNext_m']): string {
  if (toNext_m === null) return 'waiting for tracking';
  const [right, down, ahead] = toNext_m;
  const named = ([
    [right, right > 0 ? 'right' : 'left'], [down, down > 0 ? 'down' : 'up'],
    [ahead, ahead > 0 ? 'forward' : 'back'],
  ] as const).filter(([step_m]) => Math.abs(step_m) >= MIN_SAID_M)
    .sort(([a], [b]) => Math.abs(b) - Math.abs(a)).slice(0, 2);
  if (named.length === 0) return 'turn until the blue line becomes a point';
  return named.map(([step_m, where]) => `${cm(Math.abs(step_m))} ${where}`).join(', ');
}

function metres(depth_m: number | null): string {
  return depth_m === null ? '–' : `${depth_m.toFixed(2)} m`;
}

function cm(length_m: number): string {
  const length_cm = 100 * length_m;
  return `${length_cm < 9.95 ? length_cm.toFixed(1) : length_cm.toFixed(0)} cm`;
}
