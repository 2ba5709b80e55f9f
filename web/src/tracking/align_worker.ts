/** Aligns beside the frame loop. The buffer goes back with the answer, to be filled again. */

import { Aligner, type AlignFailure, type AlignLens } from './align';

export interface AlignRequest {
  readonly width: number;
  readonly height: number;
  readonly lens: AlignLens;
  /** As `AlignPictures.take` gives them: rendering, depth, live picture. */
  readonly pictures: ArrayBuffer;
}

export interface AlignReply {
  readonly failure: AlignFailure | null;
  /** `[R | t]`, 12 numbers. */
  readonly liveFromCam: Float64Array;
  readonly moveSd_m: Float64Array;
  readonly turnSd_rad: Float64Array;
  readonly took_ms: number;
  readonly pictures: ArrayBuffer;
}

declare const self: {
  onmessage: ((event: MessageEvent<AlignRequest>) => void) | null;
  postMessage(message: AlignReply, transfer?: Transferable[]): void;
};

const aligner = new Aligner();
let depth_m = new Float32Array(0);

self.onmessage = (event) => {
  const begun_ms = performance.now();
  const { width, height, lens, pictures } = event.data;
  const pixels = width * height;
  if (depth_m.length !== pixels) depth_m = new Float32Array(pixels);
  const packed = new Uint8Array(pictures, 4 * pixels, 4 * pixels);
  for (let k = 0, c = 0; k < pixels; k += 1, c += 4) {
    depth_m[k] = 1e-4 * ((packed[c] as number) + 256 * (packed[c + 1] as number)
      + 65536 * (packed[c + 2] as number));
  }
  const { failure, liveFromCam, moveSd_m, turnSd_rad } = aligner.align({
    width, height, lens, depth_m,
    rendered: new Uint8Array(pictures, 0, 4 * pixels),
    live: new Uint8Array(pictures, 8 * pixels, 4 * pixels),
  });
  const took_ms = performance.now() - begun_ms;
  self.postMessage({ failure, liveFromCam, moveSd_m, turnSd_rad, took_ms, pictures }, [pictures]);
};
