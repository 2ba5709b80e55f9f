/** What is marked where a finger touches the picture. */

import type { Targets } from './targets';

/** Why no view will help: the camera cannot show it, or views cannot agree on it. */
export type WhyUnfixable = 'over-exposed' | 'unsteady';

/** A finger is not a pixel: what is marked so far around it counts, in shares of the height. */
const REACH = 0.012;

/**
 * Why no view will help at a place, in shares of the picture from its top left corner; null where
 * that is not what is marked. Waits for the card.
 */
export function whyUnfixable(
  gl: WebGL2RenderingContext, { shown, result }: Targets, x: number, y: number,
): WhyUnfixable | null {
  const reach = Math.ceil(REACH * result.height);
  const left = Math.max(Math.floor(x * result.width) - reach, 0);
  const bottom = Math.max(Math.floor((1 - y) * result.height) - reach, 0);
  const width = Math.min(2 * reach + 1, result.width - left);
  const height = Math.min(2 * reach + 1, result.height - bottom);
  if (width <= 0 || height <= 0) return null;
  const read = (framebuffer: WebGLFramebuffer): Uint8Array => {
    const pixels = new Uint8Array(4 * width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.readPixels(left, bottom, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return pixels;
  };
  const states = read(shown.states.framebuffer);
  const results = read(result.framebuffer);
  let marked = 0;
  let overExposed = 0;
  for (let at = 0; at < states.length; at += 4) {
    if ((states[at + 2] ?? 0) < 128) continue;
    marked += 1;
    if ((results[at + 3] ?? 0) > 191) overExposed += 1;
  }
  if (marked === 0) return null;
  return 2 * overExposed >= marked ? 'over-exposed' : 'unsteady';
}
