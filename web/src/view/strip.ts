/** The photos of a place in a row; each leads to where it was taken. */

import { make } from '../ui/dom';
import type { PlaceView } from './place';

export class Strip {
  readonly element = make('nav', { className: 'place-strip', ariaLabel: 'Photos' });
  readonly #urlOf: (file: string) => string;
  readonly #onChoose: (view: number) => void;
  #current = -1;
  /** The names and pictures it was made of. */
  #drawn: readonly string[] = [];

  constructor(urlOf: (file: string) => string, onChoose: (view: number) => void) {
    this.#urlOf = urlOf;
    this.#onChoose = onChoose;
  }

  /** @param follows The newest is brought into sight. */
  update(views: readonly PlaceView[], follows: boolean): void {
    const wanted = views.map(({ name, thumbnail }) => `${name} ${thumbnail}`);
    this.element.hidden = views.every(({ thumbnail }) => thumbnail === null);
    const same = wanted.findIndex((key, i) => key !== this.#drawn[i]);
    const kept = same < 0 ? wanted.length : same;
    if (kept === wanted.length && kept === this.#drawn.length) return;
    this.#drawn = wanted;
    while (this.element.childElementCount > kept) this.element.lastElementChild?.remove();
    views.slice(kept).forEach((view, i) => this.element.append(this.#item(view, kept + i)));
    if (follows) this.element.scrollLeft = this.element.scrollWidth;
  }

  set current(view: number) {
    this.element.children[this.#current]?.removeAttribute('aria-current');
    this.#current = view;
    const item = this.element.children[view];
    item?.setAttribute('aria-current', 'true');
    item?.scrollIntoView({ block: 'nearest', inline: 'nearest' });
  }

  #item({ thumbnail, name }: PlaceView, index: number): HTMLElement {
    const label = `Photo ${index + 1}`;
    const item = make('button', { type: 'button', title: name, ariaLabel: label, onclick: () => this.#onChoose(index) });
    if (thumbnail !== null) item.append(make('img', { src: this.#urlOf(thumbnail), alt: '', loading: 'lazy' }));
    else item.append(String(index + 1));
    return item;
  }
}
