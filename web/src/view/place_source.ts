/** Where a place comes from. */

import type { Place } from './place';

export interface PlaceSource extends Disposable {
  /** As it is now; another object when it has changed. */
  readonly place: Place;
  /** Be told when it has changed. */
  subscribe(listener: () => void): void;
  /** What a file of the place holds. @throws An error whose message is for people. */
  bytes(file: string): Promise<ArrayBuffer>;
  /** An address of a picture, for `<img>`. */
  url(file: string): string;
}

/** A sentence for who looks: what is wrong and what to do. */
export class PlaceError extends Error {
  override readonly name = 'PlaceError';
}
