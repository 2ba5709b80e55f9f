/** Hands MPIs to a worker and waits for their texels. */

import type { DecodedMpi } from './decode';
import type { DecodeReply, DecodeRequest } from './decode_worker';
import { MpiFileError } from './mpi_file';

interface Waiting {
  resolve(mpi: DecodedMpi): void;
  reject(error: Error): void;
}

export class MpiDecoder implements Disposable {
  readonly #worker = new Worker(new URL('./decode_worker.ts', import.meta.url), { type: 'module' });
  readonly #waiting = new Map<number, Waiting>();
  #next = 0;

  constructor() {
    this.#worker.onmessage = (event: MessageEvent<DecodeReply>) => {
      const reply = event.data;
      const waiting = this.#waiting.get(reply.id);
      this.#waiting.delete(reply.id);
      if ('mpi' in reply) waiting?.resolve(reply.mpi);
      else waiting?.reject(new MpiFileError(reply.problem));
    };
    this.#worker.onerror = (event) => this.#rejectAll(event.message);
  }

  /** @throws MpiFileError when the bytes are no sound `.mpi` file. */
  decode(bytes: ArrayBuffer): Promise<DecodedMpi> {
    const request: DecodeRequest = { id: this.#next, bytes };
    this.#next += 1;
    return new Promise((resolve, reject) => {
      this.#waiting.set(request.id, { resolve, reject });
      // Copied, not moved: the caller may keep the file.
      this.#worker.postMessage(request);
    });
  }

  [Symbol.dispose](): void {
    this.#worker.terminate();
    this.#rejectAll('the decoder was closed');
  }

  #rejectAll(problem: string): void {
    for (const waiting of this.#waiting.values()) waiting.reject(new MpiFileError(problem));
    this.#waiting.clear();
  }
}
