/** Pixels to JPEG, off the main thread. */

import type { EncodeAnswer, EncodeRequest } from './photo_worker';

export interface EncodedPhoto {
  readonly jpeg: Blob;
  readonly thumbnail: Blob;
}

const PHOTO_QUALITY = 0.95;

export interface PhotoEncoder extends Disposable {
  /**
   * @param rgba Top row first; alpha is ignored; the array is taken away.
   * @param quality Of the JPEG, 0…1; by default a photo's.
   */
  encode(
    rgba: Uint8Array<ArrayBuffer>, width_px: number, height_px: number, quality?: number,
  ): Promise<EncodedPhoto>;
}

interface Waiter {
  resolve(photo: EncodedPhoto): void;
  reject(error: Error): void;
}

export class WorkerPhotoEncoder implements PhotoEncoder {
  readonly #worker = new Worker(new URL('./photo_worker.ts', import.meta.url), { type: 'module' });
  readonly #waiters = new Map<number, Waiter>();
  #next = 0;

  constructor() {
    this.#worker.onmessage = ({ data }: MessageEvent<EncodeAnswer>) => {
      const waiter = this.#waiters.get(data.ticket);
      this.#waiters.delete(data.ticket);
      if ('problem' in data) waiter?.reject(new Error(data.problem));
      else waiter?.resolve(data);
    };
    this.#worker.onerror = ({ message }) => this.#giveUp(`The photo worker failed: ${message}`);
  }

  encode(
    rgba: Uint8Array<ArrayBuffer>, width_px: number, height_px: number, quality = PHOTO_QUALITY,
  ): Promise<EncodedPhoto> {
    const ticket = this.#next++;
    const request: EncodeRequest = { ticket, rgba: rgba.buffer, width_px, height_px, quality };
    return new Promise((resolve, reject) => {
      this.#waiters.set(ticket, { resolve, reject });
      this.#worker.postMessage(request, [rgba.buffer]);
    });
  }

  [Symbol.dispose](): void {
    this.#worker.terminate();
    this.#giveUp('The photo encoder was closed.');
  }

  #giveUp(problem: string): void {
    for (const waiter of this.#waiters.values()) waiter.reject(new Error(problem));
    this.#waiters.clear();
  }
}
