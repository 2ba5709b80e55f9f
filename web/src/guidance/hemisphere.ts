/** Views on a part of a sphere around a point, all looking at it; twin of guidance/hemisphere_guide.py. */

import { rigid, type Cam, type Rigid, type World } from '../geometry';
import { DIRECTION_TOLERANCE_RAD, type Guide, type Tolerance } from './guide';

const TOLERANCE_SHARE = 0.25;
const EXACT = 1e-9;

export interface Cap {
  /** From the anchor to the point that it looks at. */
  readonly radius_m: number;
  /** Between neighbours, seen from the point. */
  readonly step_rad: number;
  /** From the middle of the cap to its edge. */
  readonly extent_rad: number;
}

export function hemisphere(
  worldFromAnchor: Rigid<World, Cam>, cap: Cap, nearEnough: Partial<Tolerance> = {},
): Guide {
  const { radius_m, step_rad, extent_rad } = cap;
  const anchor = worldFromAnchor.rows;
  const at = (i: number): number => anchor[i] ?? NaN;
  const targets: Rigid<World, Cam>[] = [];
  for (let ring = 0; ring <= Math.floor(extent_rad / step_rad + EXACT); ring += 1) {
    const polar_rad = ring * step_rad;
    const count = Math.max(
      1, Math.ceil((2 * Math.PI * Math.sin(polar_rad)) / step_rad - EXACT));
    for (let place = 0; place < count; place += 1) {
      const tilt = tiltOf(polar_rad, (2 * Math.PI * place) / count);
      targets.push(rigid([0, 4, 8].flatMap((r) => {
        const [x, y, z] = [0, 1, 2].map((c) => at(r) * (tilt[c] ?? NaN)
          + at(r + 1) * (tilt[3 + c] ?? NaN) + at(r + 2) * (tilt[6 + c] ?? NaN));
        const point_m = at(r + 2) * radius_m + at(r + 3);
        return [x ?? NaN, y ?? NaN, z ?? NaN, point_m - radius_m * (z ?? NaN)];
      })));
    }
  }
  return {
    targets,
    nearEnough: {
      position_m: TOLERANCE_SHARE * radius_m * step_rad,
      direction_rad: DIRECTION_TOLERANCE_RAD,
      ...nearEnough,
    },
  };
}

/** The shortest rotation that moves a camera round the point: to its right at azimuth 0. */
function tiltOf(polar_rad: number, azimuth_rad: number): readonly number[] {
  const x = Math.sin(azimuth_rad);
  const y = -Math.cos(azimuth_rad);
  const c = Math.cos(polar_rad);
  const s = Math.sin(polar_rad);
  const d = 1 - c;
  return [
    c + d * x * x, d * x * y, s * y,
    d * x * y, c + d * y * y, -s * x,
    -s * y, s * x, c,
  ];
}
