/** Before the picture: a button, because browsers start the camera only after a tap; and errors. */

import { make, show } from './dom';

export const FREELY = 'Walk around the scene. Take a view wherever red appears, until no red remains.';
export const GUIDED = 'Look at the whole scene first. Then targets appear; take a view at each of them.';

export class StartPage {
  readonly #box = make('section', { className: 'start', hidden: true });

  constructor(root: HTMLElement) {
    root.append(this.#box);
  }

  /** Ask for the tap; resolves with it. @param task What the photographer is to do then. */
  ask(label: string, task: string): Promise<void> {
    return new Promise((resolve) => {
      const start = make('button', { className: 'primary', type: 'button' }, label);
      start.onclick = () => {
        this.hide();
        resolve();
      };
      this.#fill('Ready', make('p', {}, task), start,
      make('a', { className: 'secondary', href: './?source=virtual' }, 'Try the virtual phone'));
    });
  }

  /** Say that this device cannot capture, and why; resolves when the photographer goes on without. */
  standIn(why: string, instead: string): Promise<void> {
    return new Promise((resolve) => {
      const goOn = make('button', { className: 'primary', type: 'button' }, instead);
      goOn.onclick = () => {
        this.hide();
        resolve();
      };
      this.#fill('This device cannot capture', make('p', {}, why), goOn,
        make('a', { className: 'secondary', href: './check' }, 'Check this browser'));
    });
  }

  /** Say what went wrong and what to do; `again` is offered when it makes sense. */
  fail(sentence: string, again: (() => void) | null): void {
    const error = make('div', { className: 'error', role: 'alert' }, sentence);
    const retry = make('button', { className: 'primary', type: 'button' }, 'Try again');
    if (again !== null) retry.onclick = again;
    this.#fill('Something went wrong', error, ...(again === null ? [] : [retry]),
      make('a', { className: 'secondary', href: './check' }, 'Check this browser'),
      make('a', { className: 'secondary', href: './?source=virtual' }, 'Try the virtual phone'));
  }

  /** It is over: the phone's session ended. */
  ended(again: () => void): void {
    const start = make('button', { className: 'primary', type: 'button', onclick: again },
      'Continue');
    this.#fill('Paused', make('p', {}, 'All your views are saved.'), start,
      make('a', { className: 'secondary', href: './sessions' }, 'All sessions'));
  }

  hide(): void {
    show(this.#box, false);
  }

  #fill(title: string, ...content: Node[]): void {
    this.#box.replaceChildren(make('h2', {}, title), ...content);
    show(this.#box, true);
  }
}
