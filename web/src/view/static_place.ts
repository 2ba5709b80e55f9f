/** A place from files: a folder of a web server, or all of it inside the page. */

import { SchemaError } from '../schema';
import { parsePlace, type Address, type Place, type ReadPlace } from './place';
import { PlaceError, type PlaceSource } from './place_source';

/** How a place's files are read. */
interface Files extends Disposable {
  bytes(file: string): Promise<ArrayBuffer>;
  url(file: string): string;
}

export class StaticPlace implements PlaceSource {
  readonly place: Place;
  readonly address: Address | null;
  readonly #files: Files;

  private constructor({ place, address }: ReadPlace, files: Files) {
    this.place = place;
    this.address = address;
    this.#files = files;
  }

  /**
   * The place beside this page.
   *
   * @param folder Its address, with a slash at the end.
   * @throws PlaceError It is not there, or no place.
   */
  static async fromFolder(folder: string): Promise<StaticPlace> {
    const files = new Served(folder);
    const json = new TextDecoder().decode(await files.bytes('place.json'));
    return new StaticPlace(understood(json), files);
  }

  /** The place inside a page, if there is one. @throws PlaceError It is no place. */
  static inPage(page: Document): StaticPlace | null {
    const element = page.getElementById('place');
    if (element === null) return null;
    return new StaticPlace(understood(element.textContent ?? ''), new Inlined(page));
  }

  subscribe(): void {
    // It never changes.
  }

  bytes(file: string): Promise<ArrayBuffer> {
    return this.#files.bytes(file);
  }

  url(file: string): string {
    return this.#files.url(file);
  }

  [Symbol.dispose](): void {
    this.#files[Symbol.dispose]();
  }
}

function understood(json: string): ReadPlace {
  try {
    return parsePlace(json);
  } catch (error) {
    if (!(error instanceof SchemaError) && !(error instanceof RangeError)) throw error;
    throw new PlaceError(`This place cannot be read: place.json: ${error.message}. Share it again with this version of peaking.`);
  }
}

class Served implements Files {
  constructor(readonly folder: string) {}

  async bytes(file: string): Promise<ArrayBuffer> {
    const answer = await fetch(this.url(file)).catch(() => null);
    if (answer === null) {
      throw new PlaceError(`${file} cannot be fetched: is the connection or the server gone?`);
    }
    if (!answer.ok) throw new PlaceError(await sentenceOf(answer, file));
    return answer.arrayBuffer();
  }

  url(file: string): string {
    return new URL(file, this.folder).href;
  }

  [Symbol.dispose](): void {
    // Nothing is kept.
  }
}

/** What a server of ours says of a problem, or else what the status is. */
async function sentenceOf(answer: Response, file: string): Promise<string> {
  if (answer.headers.get('Content-Type')?.includes('problem+json') === true) {
    const { detail } = await answer.json().catch(() => ({})) as { detail?: unknown };
    if (typeof detail === 'string') return detail;
  }
  return `${file} is missing (${answer.status}). There is no place at this address, or a part of its folder was not copied.`;
}

/** So often it is looked whether more of the page has come. */
const LOOK_AGAIN_MS = 20;

class Inlined implements Files {
  readonly #page: Document;
  readonly #urls = new Map<string, string>();

  constructor(page: Document) {
    this.#page = page;
  }

  /** While the browser still reads the page, what is further down is waited for. */
  async bytes(file: string): Promise<ArrayBuffer> {
    while (this.#page.readyState === 'loading' && !this.#isWhole(file)) {
      await new Promise((resolve) => setTimeout(resolve, LOOK_AGAIN_MS));
    }
    return this.#bytes(file).buffer;
  }

  url(file: string): string {
    const known = this.#urls.get(file);
    if (known !== undefined) return known;
    const type = file.endsWith('.svg') ? 'image/svg+xml' : file.endsWith('.png') ? 'image/png' : 'image/jpeg';
    const url = URL.createObjectURL(new Blob([this.#bytes(file)], { type }));
    this.#urls.set(file, url);
    return url;
  }

  [Symbol.dispose](): void {
    for (const url of this.#urls.values()) URL.revokeObjectURL(url);
    this.#urls.clear();
  }

  #bytes(file: string): Uint8Array<ArrayBuffer> {
    const element = this.#find(file);
    if (element === null) {
      throw new PlaceError(`${file} is missing in this page: it was cut off on its way, or changed.`);
    }
    return Uint8Array.from(atob((element.textContent ?? '').trim()), (c) => c.charCodeAt(0));
  }

  /** An element is there before its end is: that has come when something follows. */
  #isWhole(file: string): boolean {
    const element = this.#find(file);
    return element !== null && element.nextSibling !== null;
  }

  #find(file: string): HTMLElement | null {
    return this.#page.querySelector<HTMLElement>(`script[data-file="${CSS.escape(file)}"]`);
  }
}
