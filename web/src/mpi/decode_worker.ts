/** Decodes MPIs beside the frame loop. */

import { decodeMpi, type DecodedMpi } from './decode';

export interface DecodeRequest {
  readonly id: number;
  readonly bytes: ArrayBuffer;
}

export type DecodeReply =
  | { readonly id: number; readonly mpi: DecodedMpi }
  | { readonly id: number; readonly problem: string };

declare const self: {
  onmessage: ((event: MessageEvent<DecodeRequest>) => void) | null;
  postMessage(message: DecodeReply, transfer?: Transferable[]): void;
};

self.onmessage = (event) => {
  const { id, bytes } = event.data;
  decodeMpi(bytes).then(
    (mpi) => self.postMessage({ id, mpi }, [mpi.texels.buffer]),
    (error: unknown) => self.postMessage({ id, problem: String(error) }),
  );
};
