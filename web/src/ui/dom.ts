/** Small typed helpers to make and fill elements. */

type Props<K extends keyof HTMLElementTagNameMap> =
  Partial<Omit<HTMLElementTagNameMap[K], 'style' | 'children' | 'dataset'>>;

/** Make an element: `make('button', { className: 'pill', onclick: undo }, 'Undo')`. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K, props: Props<K> = {}, ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  Object.assign(element, props);
  element.append(...children);
  return element;
}

/** A button with a name for those who do not see its sign. */
export function button(
  className: string, sign: string, label: string, onclick: () => void,
): HTMLButtonElement {
  const element = make('button', { className, type: 'button', onclick }, sign);
  element.ariaLabel = label;
  element.title = label;
  return element;
}

/** What was said last: reading it back from an element would make a string every time. */
const said = new WeakMap<HTMLElement, string>();

/**
 * Set the text only when it changed: cheap enough for every frame. Nothing else may change the text
 * of such an element.
 */
export function say(element: HTMLElement, text: string): void {
  if (said.get(element) === text) return;
  said.set(element, text);
  element.textContent = text;
}

export function show(element: HTMLElement, visible: boolean): void {
  if (element.hidden === visible) element.hidden = !visible;
}
