/** WebXR's depth, turned to what the rest of the client takes: millimetres in the picture's frame. */

import type { DepthFormat, DepthGeometry, DepthMap, RawDepth } from './frame_source';

export type { DepthFormat, DepthGeometry, RawDepth } from './frame_source';

/** The largest number of 16 bits: what devices give where they measure nothing. */
const SATURATED = 65535;

/**
 * Resample to a map that covers the picture. Phones turn and crop the depth buffer against the
 * picture; the matrix says how. Nearest texel: depths on both sides of an edge have no mean.
 *
 * @param aspect Width / height of the picture.
 */
export function depthMapOf(raw: RawDepth, format: DepthFormat, aspect: number): DepthMap {
  const m = raw.normDepthBufferFromNormView.matrix;
  const values = format === 'float32' ? new Float32Array(raw.data) : new Uint16Array(raw.data);
  const { width_px, height_px } = sizeInView(raw, aspect);
  const depth_mm = new Uint16Array(width_px * height_px);
  const toMm = 1000 * raw.rawValueToMeters;
  for (let y = 0; y < height_px; y += 1) {
    const v = (y + 0.5) / height_px;
    for (let x = 0; x < width_px; x += 1) {
      const u = (x + 0.5) / width_px;
      const column = Math.floor((at(m, 0) * u + at(m, 4) * v + at(m, 12)) * raw.width);
      const row = Math.floor((at(m, 1) * u + at(m, 5) * v + at(m, 13)) * raw.height);
      if (column < 0 || row < 0 || column >= raw.width || row >= raw.height) continue;
      const value = at(values, row * raw.width + column);
      const mm = Math.round(value * toMm);
      // What is not a number, not in front, saturated or too far for 16 bits is unknown.
      if (format !== 'float32' && value === SATURATED) continue;
      if (mm > 0 && mm < SATURATED) depth_mm[y * width_px + x] = mm;
    }
  }
  return { width_px, height_px, depth_mm };
}

/** The map; null where nothing is known in it: the same as no depth. */
export function known(map: DepthMap): DepthMap | null {
  return map.depth_mm.some((mm) => mm > 0) ? map : null;
}

/** As many texels as the buffer has in the picture, in the picture's aspect. */
export function sizeInView(
  raw: DepthGeometry, aspect: number,
): { readonly width_px: number; readonly height_px: number } {
  const m = raw.normDepthBufferFromNormView.matrix;
  const across = Math.hypot(at(m, 0) * raw.width, at(m, 1) * raw.height);
  const down = Math.hypot(at(m, 4) * raw.width, at(m, 5) * raw.height);
  const area = Math.max(Math.min(across * down, raw.width * raw.height), 1);
  const height_px = Math.max(Math.round(Math.sqrt(area / aspect)), 1);
  return { width_px: Math.max(Math.round(height_px * aspect), 1), height_px };
}

function at(values: ArrayLike<number>, index: number): number {
  return values[index] ?? NaN;
}
