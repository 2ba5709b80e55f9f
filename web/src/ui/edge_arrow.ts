/** An arrow at the edge of the screen, towards something outside the picture. */

import type { Vector3 } from '../geometry';
import { make, show } from './dom';

/** Longer than a thumb is broad. */
const LENGTH_PX = 96;
const DEPTH_PX = 34;
/** Free of what lies over the picture: the meter above, the buttons below. */
const INSET_PX = { side: 10, top: 118, bottom: 250 } as const;
/** Smaller steps than these are not followed, so that it stands still in a hand that trembles. */
const STEP_PX = 3;

export interface EdgePlace {
  /** Of the arrow's middle, from the top left corner of the box. */
  readonly x_px: number;
  readonly y_px: number;
  /** 0: it points right, π/2: down. */
  readonly angle_rad: number;
}

/**
 * Where on the edge of a box the arrow stands: as one has to turn, to the side and up or down, to
 * look along a direction.
 *
 * @param direction In axes of the camera (x right, y down, z ahead), of any length; what is exactly
 *   behind is on the right. Null when it is straight ahead.
 */
export function edgePlace(direction: Vector3, width_px: number, height_px: number): EdgePlace | null {
  const [x, y, z] = direction;
  const turn = Math.atan2(x, z);
  const tilt = Math.atan2(y, Math.hypot(x, z));
  const far = Math.hypot(turn, tilt);
  if (!(far > 1e-6)) return null;
  const top = Math.min(INSET_PX.top, 0.3 * height_px);
  const bottom = height_px - Math.min(INSET_PX.bottom, 0.4 * height_px);
  const half = { x: 0.5 * (width_px - DEPTH_PX) - INSET_PX.side, y: 0.5 * (bottom - top - DEPTH_PX) };
  const reach = Math.min(half.x / Math.abs(turn), half.y / Math.abs(tilt));
  return {
    x_px: 0.5 * width_px + reach * turn,
    y_px: 0.5 * (top + bottom) + reach * tilt,
    angle_rad: Math.atan2(tilt, turn),
  };
}

const SIGN = `<svg viewBox="0 0 ${DEPTH_PX} ${LENGTH_PX}" width="${DEPTH_PX}" height="${LENGTH_PX}">`
  + `<path d="M8 7L26 ${LENGTH_PX / 2}L8 ${LENGTH_PX - 7}"/>`
  + `<path d="M8 7L26 ${LENGTH_PX / 2}L8 ${LENGTH_PX - 7}"/></svg>`;

export class EdgeArrow {
  readonly #element: HTMLElement;
  #width_px = 0;
  #height_px = 0;
  #x_px = NaN;
  #y_px = NaN;

  constructor(root: HTMLElement, ariaLabel: string, kind = '') {
    this.#element = make('div', {
      className: `edge-arrow ${kind}`.trim(), hidden: true, role: 'img', innerHTML: SIGN, ariaLabel,
    });
    root.append(this.#element);
    new ResizeObserver(() => {
      this.#width_px = root.clientWidth;
      this.#height_px = root.clientHeight;
      this.#x_px = NaN;
    }).observe(root);
  }

  /** Point along a direction in axes of the camera, or at nothing; may be called for every frame. */
  point(direction: Vector3 | null): void {
    const place = direction === null || this.#width_px === 0 ? null
      : edgePlace(direction, this.#width_px, this.#height_px);
    show(this.#element, place !== null);
    if (place === null) {
      this.#x_px = NaN;
      return;
    }
    const { x_px, y_px, angle_rad } = place;
    if (Math.hypot(x_px - this.#x_px, y_px - this.#y_px) < STEP_PX) return;
    this.#x_px = x_px;
    this.#y_px = y_px;
    this.#element.style.transform = `translate(${x_px.toFixed(0)}px, ${y_px.toFixed(0)}px) `
      + `translate(-50%, -50%) rotate(${angle_rad.toFixed(2)}rad)`;
  }
}
