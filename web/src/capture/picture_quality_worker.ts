/** Worker: measures pictures beside the frame loop. `picture_sampler.ts` is the other end. */

import { PictureMeter, type PictureQuality } from './picture_quality';

export interface MeasureRequest {
  readonly width: number;
  readonly height: number;
  readonly rgba: ArrayBuffer;
}

export interface MeasureReply {
  readonly quality: PictureQuality;
  /** To be filled again. */
  readonly rgba: ArrayBuffer;
}

declare const self: {
  onmessage: ((event: MessageEvent<MeasureRequest>) => void) | null;
  postMessage(message: MeasureReply, transfer?: Transferable[]): void;
};

const meter = new PictureMeter();

self.onmessage = ({ data: { width, height, rgba } }) => {
  const quality = meter.measure(new Uint8Array(rgba), width, height);
  self.postMessage({ quality, rgba }, [rgba]);
};
