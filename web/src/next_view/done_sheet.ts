/** The whole capture: how complete it is and how that went, the map, and what is left. */

import { button, make } from '../ui/dom';
import type { Guidance, GuidedPlace } from '../wire';
import { drawCurve, drawMap } from './capture_map';
import type { PlanView } from './plan_view';
import { doneText, VERDICTS } from './words';

export interface DoneActions {
  /** Lead to a place. */
  lead(place: GuidedPlace): void;
  setOn(on: boolean): void;
  close(): void;
}

export class DoneSheet {
  readonly element: HTMLElement;
  readonly #title = make('h2');
  readonly #verdict = make('p', { className: 'verdict' });
  readonly #map = make('canvas', { width: 640, height: 420, className: 'plan' });
  readonly #curve = make('canvas', { width: 640, height: 150, className: 'curve' });
  readonly #leftTitle = make('h3', {}, 'Left to do, if you want it all');
  readonly #left = make('div', { className: 'left' });
  readonly #on = make('input', { type: 'checkbox' });

  constructor(private readonly actions: DoneActions) {
    this.#map.role = 'img';
    this.#map.ariaLabel = 'The capture from above: views green, what is left white';
    this.#curve.role = 'img';
    this.#curve.ariaLabel = 'How complete it was after each view';
    this.#on.onchange = () => actions.setOn(this.#on.checked);
    this.element = make('section', { className: 'sheet done', role: 'dialog' },
      this.#title, button('close', '✕', 'Close', () => actions.close()), this.#verdict,
      this.#curve, this.#leftTitle, this.#left, this.#map,
      make('label', {}, this.#on, ' Show where the next view helps most'));
    this.element.ariaLabel = 'How complete the capture is';
    this.element.addEventListener('keydown', (event) => { if (event.key === 'Escape') actions.close(); });
  }

  update(guidance: Guidance, plan: PlanView, on: boolean): void {
    this.#title.textContent = doneText(guidance);
    this.#verdict.textContent = VERDICTS[guidance.verdict];
    this.#on.checked = on;
    this.#leftTitle.hidden = guidance.left.length === 0;
    this.#left.replaceChildren(...guidance.left.map((place) => this.#item(place)));
    drawMap(this.#map, plan, 26);
    drawCurve(this.#curve, guidance.curve);
  }

  #item(place: GuidedPlace): HTMLElement {
    const item = button('place', '', `Lead me there. ${place.reason}`, () => this.actions.lead(place));
    if (place.picture != null) {
      item.append(make('img', { src: `data:image/jpeg;base64,${place.picture}`, alt: '' }));
    }
    item.append(make('span', {}, place.reason));
    return item;
  }
}
