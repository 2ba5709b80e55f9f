/** From a texel of an MPI to a pixel of the view, without making anything. */

import type { Cam, Camera, Pinhole, Rigid, World } from '../geometry';

/** Scratch, and the answer of `project`. */
export interface Projection {
  /** K_t R K_s⁻¹, column-major: takes a source pixel (x, y, 1), times its depth … */
  readonly matrix: Float32Array;
  /** … and K_t t, added to it, to homogeneous pixels of the target. */
  readonly translation: Float32Array;
  /** Depth of the target's centre in the source's frame. */
  targetDepth_m: number;
}

export function newProjection(): Projection {
  return { matrix: new Float32Array(9), translation: new Float32Array(3), targetDepth_m: 0 };
}

/**
 * @param target The pinhole that is rendered with.
 * @param out Written to, and returned.
 */
export function project(
  source: Camera, worldFromTarget: Rigid<World, Cam>, target: Pinhole, out: Projection,
): Projection {
  const s = source.worldFromCam.rows;
  const w = worldFromTarget.rows;
  const { fx_px, fy_px, cx_px, cy_px } = source.pinhole;
  const dx = at(s, 3) - at(w, 3);
  const dy = at(s, 7) - at(w, 7);
  const dz = at(s, 11) - at(w, 11);
  for (let column = 0; column < 4; column += 1) {
    // Column of [R | t] of the target from the source: turned by the inverse of the target's pose.
    const x = column < 3 ? at(s, column) : dx;
    const y = column < 3 ? at(s, 4 + column) : dy;
    const z = column < 3 ? at(s, 8 + column) : dz;
    const right = at(w, 0) * x + at(w, 4) * y + at(w, 8) * z;
    const down = at(w, 1) * x + at(w, 5) * y + at(w, 9) * z;
    const ahead = at(w, 2) * x + at(w, 6) * y + at(w, 10) * z;
    const into = column < 3 ? out.matrix : out.translation;
    const from = column < 3 ? 3 * column : 0;
    into[from] = target.fx_px * right + target.cx_px * ahead;
    into[from + 1] = target.fy_px * down + target.cy_px * ahead;
    into[from + 2] = ahead;
  }
  const { matrix } = out;
  for (let row = 0; row < 3; row += 1) {
    const right = at(matrix, row) / fx_px;
    const down = at(matrix, 3 + row) / fy_px;
    matrix[row] = right;
    matrix[3 + row] = down;
    matrix[6 + row] = at(matrix, 6 + row) - right * cx_px - down * cy_px;
  }
  out.targetDepth_m = -(at(s, 2) * dx + at(s, 6) * dy + at(s, 10) * dz);
  return out;
}

function at(values: ArrayLike<number>, index: number): number {
  return values[index] ?? NaN;
}
