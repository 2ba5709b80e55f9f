/** A suggested view over the picture: a dashed frame to step into, or an arrow at the edge. */

import type { Camera } from '../geometry';
import { make, show } from '../ui/dom';
import { EdgeArrow } from '../ui/edge_arrow';
import { frameOf, newFrame, type FrameInPicture } from './place';

/** Places of the picture in pixels of the overlay. */
export interface OnOverlay {
  placeOnOverlay(x: number, y: number, out: [number, number]): [number, number];
}

const SVG = 'http://www.w3.org/2000/svg';
/** The subject's middle is never drawn over: a circle of this part of the shorter side. */
const FREE = 0.16;
/** Smaller steps than these are not followed, so that it stands still in a hand that trembles. */
const STEP_PX = 2;
const SCRATCH: [number, number] = [0, 0];

export class Ghost {
  readonly #element = make('div', { className: 'ghost', hidden: true, role: 'img', ariaLabel: 'Take the next view here' });
  readonly #svg = document.createElementNS(SVG, 'svg');
  readonly #paths = [0, 1].map(() => document.createElementNS(SVG, 'path'));
  readonly #hole = document.createElementNS(SVG, 'circle');
  readonly #arrow: EdgeArrow;
  readonly #frame = newFrame();
  readonly #shown = new Float64Array(8).fill(NaN);
  readonly #now = new Float64Array(8);

  constructor(root: HTMLElement) {
    this.#svg.innerHTML = '<mask id="ghost-free" maskUnits="userSpaceOnUse" x="-9999" y="-9999" width="19999" height="19999">'
      + '<rect x="-9999" y="-9999" width="19999" height="19999" fill="#fff"/></mask>';
    this.#svg.querySelector('mask')?.append(this.#hole);
    for (const path of this.#paths) path.setAttribute('mask', 'url(#ghost-free)');
    this.#svg.append(...this.#paths);
    this.#element.append(this.#svg);
    root.prepend(this.#element); // under the controls
    this.#arrow = new EdgeArrow(root, 'The next view lies in this direction', 'next');
    new ResizeObserver(() => {
      const { clientWidth, clientHeight } = root;
      this.#hole.setAttribute('cx', String(clientWidth / 2));
      this.#hole.setAttribute('cy', String(clientHeight / 2));
      this.#hole.setAttribute('r', String(FREE * Math.min(clientWidth, clientHeight)));
      this.#shown.fill(NaN);
    }).observe(root);
  }

  get frame(): FrameInPicture {
    return this.#frame;
  }

  hide(): void {
    show(this.#element, false);
    this.#arrow.point(null);
  }

  /** May be called for every frame. */
  draw(live: Camera, suggested: Camera, picture: OnOverlay): void {
    const frame = frameOf(live, suggested, this.#frame);
    show(this.#element, frame.inside);
    this.#arrow.point(frame.inside ? null : frame.direction);
    if (!frame.inside) return;
    if (this.#element.classList.contains('reached') !== frame.reached) {
      this.#element.classList.toggle('reached', frame.reached);
    }
    let moved = false;
    for (let i = 0; i < 8; i += 2) {
      picture.placeOnOverlay(frame.corners[i] ?? NaN, frame.corners[i + 1] ?? NaN, SCRATCH);
      this.#now[i] = SCRATCH[0];
      this.#now[i + 1] = SCRATCH[1];
      const step = Math.hypot(SCRATCH[0] - (this.#shown[i] ?? NaN), SCRATCH[1] - (this.#shown[i + 1] ?? NaN));
      moved ||= !(step < STEP_PX);
    }
    if (!moved) return;
    this.#shown.set(this.#now);
    const outline = `M${Array.from(this.#now, (value) => value.toFixed(1)).join(' ')}Z`;
    for (const path of this.#paths) path.setAttribute('d', outline);
  }
}
