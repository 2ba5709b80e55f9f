/** How a picture lies in the box that shows it: which part is visible, and what lies under a finger. */

import { WHOLE, type Part } from '../render/shares';

export interface Size {
  readonly width: number;
  readonly height: number;
}

/** CSS's `object-fit`: all of the picture, with bars beside it, or a picture without bars, cropped. */
export type Fit = 'contain' | 'cover';

/** Pixels of the box per pixel of the picture. */
function scaleOf(picture: Size, box: Size, fit: Fit): number {
  const x = box.width / picture.width;
  const y = box.height / picture.height;
  return fit === 'cover' ? Math.max(x, y) : Math.min(x, y);
}

function isEmpty({ width, height }: Size): boolean {
  return !(width > 0 && height > 0);
}

/** The part of a picture that its box shows, the middle of both at one place. */
export function visiblePart(picture: Size, box: Size, fit: Fit): Part {
  if (isEmpty(picture) || isEmpty(box)) return WHOLE;
  const scale = scaleOf(picture, box, fit);
  const x = Math.max(0.5 - (0.5 * box.width) / (scale * picture.width), 0);
  const y = Math.max(0.5 - (0.5 * box.height) / (scale * picture.height), 0);
  return { left: x, top: y, right: 1 - x, bottom: 1 - y };
}

/** What of a picture lies at a place of its box, in shares from its top left corner; null: nothing. */
export function placeInPicture(
  picture: Size, box: Size, fit: Fit, x: number, y: number,
): readonly [x: number, y: number] | null {
  if (isEmpty(picture) || isEmpty(box)) return null;
  const scale = scaleOf(picture, box, fit);
  const at = [
    0.5 + (x - 0.5 * box.width) / (scale * picture.width),
    0.5 + (y - 0.5 * box.height) / (scale * picture.height),
  ] as const;
  return at.every((share) => share >= 0 && share <= 1) ? at : null;
}

/**
 * Where a place of a picture lies in its box, in pixels from the box's top left corner.
 *
 * @param x In shares of the picture, as `y`.
 * @param out Written to, and returned.
 */
export function placeInBox(
  picture: Size, box: Size, fit: Fit, x: number, y: number, out: [number, number],
): [number, number] {
  const scale = isEmpty(picture) || isEmpty(box) ? NaN : scaleOf(picture, box, fit);
  out[0] = 0.5 * box.width + (x - 0.5) * scale * picture.width;
  out[1] = 0.5 * box.height + (y - 0.5) * scale * picture.height;
  return out;
}

/** The picture on the page. */
export class PictureOnPage {
  #box: Size = { width: 0, height: 0 };
  #fit: Fit = 'contain';
  #picture: Size = { width: 0, height: 0 };
  #visible: Part = WHOLE;

  /** @param canvas It is drawn into; null: it fills the screen, as in augmented reality. */
  constructor(private readonly canvas: HTMLCanvasElement | null) {
    if (canvas === null) return;
    new ResizeObserver(() => this.#measure(canvas)).observe(canvas);
    this.#measure(canvas);
  }

  /** The same object while nothing changes; cheap enough for every frame. */
  get visible(): Part {
    const { canvas } = this;
    if (canvas === null) return WHOLE;
    if (canvas.width !== this.#picture.width || canvas.height !== this.#picture.height) {
      this.#measure(canvas);
    }
    return this.#visible;
  }

  /** What lies at a place of the page, in shares of the picture from its top left corner. */
  placeAt(clientX: number, clientY: number): readonly [x: number, y: number] | null {
    if (this.canvas === null) return [clientX / window.innerWidth, clientY / window.innerHeight];
    const { left, top } = this.canvas.getBoundingClientRect();
    return placeInPicture(this.#picture, this.#box, this.#fit, clientX - left, clientY - top);
  }

  /** Where a place of the picture lies on the page's overlay, in pixels. @param out As above. */
  placeOnOverlay(x: number, y: number, out: [number, number]): [number, number] {
    if (this.canvas === null) {
      out[0] = x * window.innerWidth;
      out[1] = y * window.innerHeight;
      return out;
    }
    return placeInBox(this.#picture, this.#box, this.#fit, x, y, out);
  }

  #measure(canvas: HTMLCanvasElement): void {
    this.#picture = { width: canvas.width, height: canvas.height };
    this.#box = { width: canvas.clientWidth, height: canvas.clientHeight };
    this.#fit = getComputedStyle(canvas).objectFit === 'cover' ? 'cover' : 'contain';
    this.#visible = visiblePart(this.#picture, this.#box, this.#fit);
  }
}
