/**
 * How densely to sample, and the grid and the planes of views; twin of guidance/plenoptic.py and
 * guidance/planes.py, derived in docs/plenoptic.md.
 */

import { rigid, type Cam, type Pinhole, type Rigid, type World } from '../geometry';
import { DIRECTION_TOLERANCE_RAD, type Guide, type Tolerance } from './guide';

const GRID_TOLERANCE_SHARE = 0.25;
const PLANES_TOLERANCE_SHARE = 0.5;
/** So that a number of views that is whole but for rounding is not rounded up. */
const EXACT = 1e-9;

/** The paper's bound: N = (S W / (2 D z_min tan(θ/2)))², Δu = S / √N. */
export interface PlenopticBound {
  /** Side of the square in which views are taken, S. */
  readonly areaSide_m: number;
  /** The largest spacing that is allowed, Δu. */
  readonly spacing_m: number;
  /** N, not rounded. */
  readonly numViewsExact: number;
  /** N, rounded up. */
  readonly numViews: number;
  /** Views along a side of the grid that fills the area at no more than the spacing. */
  readonly viewsPerSide: number;
  /** Spacing of that grid. */
  readonly pitch_m: number;
  /** tan(θ/2). */
  readonly tanHalfFov: number;
}

/** @param pinhole Of an MPI: its width and its focal length along it count. */
export function plenopticBound(
  pinhole: Pinhole, zMin_m: number, areaSide_m: number, numPlanes: number,
): PlenopticBound {
  for (const [name, value] of Object.entries({ zMin_m, areaSide_m, numPlanes })) {
    if (!(Number.isFinite(value) && value > 0)) {
      throw new RangeError(`need a finite ${name} > 0, got ${value}`);
    }
  }
  const spacing_m = (numPlanes * zMin_m) / pinhole.fx_px;
  const numViewsExact = (areaSide_m / spacing_m) ** 2;
  const viewsPerSide = Math.ceil(areaSide_m / spacing_m - EXACT);
  return {
    areaSide_m,
    spacing_m,
    numViewsExact,
    numViews: Math.ceil(numViewsExact - EXACT),
    viewsPerSide,
    pitch_m: areaSide_m / viewsPerSide,
    tanHalfFov: pinhole.width_px / (2 * pinhole.fx_px),
  };
}

/** LLFF's guide: a square grid around the anchor, row by row from the top left. */
export function plenopticGrid(
  worldFromAnchor: Rigid<World, Cam>, bound: PlenopticBound, nearEnough: Partial<Tolerance> = {},
): Guide {
  return {
    targets: gridTargets(worldFromAnchor, bound.viewsPerSide, bound.pitch_m, 0),
    nearEnough: {
      position_m: GRID_TOLERANCE_SHARE * bound.pitch_m,
      direction_rad: DIRECTION_TOLERANCE_RAD,
      ...nearEnough,
    },
  };
}

/** A cube of the area's side, filled with planes of views; the first is the anchor's, others behind. */
export function planeStack(
  worldFromAnchor: Rigid<World, Cam>, bound: PlenopticBound, nearEnough: Partial<Tolerance> = {},
): Guide {
  const gap_m = bound.spacing_m / bound.tanHalfFov;
  const layers = Math.ceil(bound.areaSide_m / gap_m - EXACT);
  const layerPitch_m = bound.areaSide_m / layers;
  return {
    targets: Array.from({ length: layers }, (_, layer) => gridTargets(
      worldFromAnchor, bound.viewsPerSide, bound.pitch_m, layer * layerPitch_m)).flat(),
    nearEnough: {
      position_m: PLANES_TOLERANCE_SHARE * bound.pitch_m,
      direction_rad: DIRECTION_TOLERANCE_RAD,
      ...nearEnough,
    },
  };
}

function gridTargets(
  worldFromAnchor: Rigid<World, Cam>, perSide: number, pitch_m: number, back_m: number,
): Rigid<World, Cam>[] {
  const m = worldFromAnchor.rows;
  const at = (i: number): number => m[i] ?? NaN;
  const steps_m = Array.from({ length: perSide }, (_, i) => (i - (perSide - 1) / 2) * pitch_m);
  return steps_m.flatMap((y_m) => steps_m.map((x_m) => rigid<World, Cam>([0, 4, 8].flatMap((r) => [
    at(r), at(r + 1), at(r + 2),
    at(r) * x_m + at(r + 1) * y_m - at(r + 2) * back_m + at(r + 3),
  ]))));
}
