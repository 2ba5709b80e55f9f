/** The viewer in a page of its own, with a place from files. */

import { make } from '../ui/dom';
import { PlaceError } from './place_source';
import { StaticPlace } from './static_place';
import { Viewer, type ViewerParts } from './viewer';

/**
 * Open the place inside this page, or beside it.
 *
 * @param parts What this page can show.
 */
export async function openShared(parts: ViewerParts, element: HTMLElement): Promise<void> {
  try {
    const source = StaticPlace.inPage(document) ?? await StaticPlace.fromFolder(new URL('./', location.href).href);
    const { place, address } = source;
    document.title = place.title;
    const viewer = new Viewer(element, source, { parts, keysOf: window });
    if (place.licence !== '') viewer.addLine(place.licence);
    if (address !== null) viewer.addAddress(address.address, address.qr === null ? null : source.url(address.qr));
    Object.assign(window, { viewer });
  } catch (error) {
    sayInstead(element, error instanceof PlaceError ? error.message : `This place cannot be shown: ${String(error)}`);
  }
}

/** Say a sentence in place of the viewer. */
export function sayInstead(element: HTMLElement, sentence: string): void {
  const problem = make('p', { className: 'problem' }, sentence);
  problem.setAttribute('role', 'alert');
  element.replaceChildren(problem);
}
