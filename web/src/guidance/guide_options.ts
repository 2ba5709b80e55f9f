/** Which guide the address asks for. */

import type { Tolerance } from './guide';

export type GuideKind = 'plenoptic' | 'planes' | 'hemisphere';

export interface GuideOptions {
  readonly kind: GuideKind;
  /** Side of the square in which views are taken; the paper's is 15 cm. */
  readonly areaSide_m: number;
  /** What is not given here follows from the spacing. */
  readonly nearEnough: Partial<Tolerance>;
  /** Takes a view by itself when the camera is held at a target. */
  readonly autoShutter: boolean;
  /** Of the hemisphere: angle between neighbours, and from the middle to the edge. */
  readonly step_rad: number;
  readonly extent_rad: number;
}

/** An address that asks for what is not there; a sentence. */
export class NoSuchGuide extends Error {
  override readonly name = 'NoSuchGuide';
}

const KINDS: readonly string[] = ['plenoptic', 'planes', 'hemisphere'] satisfies GuideKind[];
const RADIANS = Math.PI / 180;

/**
 * Read `?guide=plenoptic|planes|hemisphere&area=M&near=M&angle=DEG&shutter=auto|manual&step=DEG&
 * extent=DEG`. Null without `guide`.
 */
export function guideOptionsOf(query: URLSearchParams): GuideOptions | null {
  const kind = query.get('guide');
  if (kind === null) return null;
  if (!isKind(kind)) {
    throw new NoSuchGuide(`Unknown guide "${kind}". Use plenoptic, planes or hemisphere.`);
  }
  const shutter = query.get('shutter') ?? 'manual';
  if (shutter !== 'auto' && shutter !== 'manual') {
    throw new NoSuchGuide(`Unknown shutter "${shutter}". Use auto or manual.`);
  }
  const near_m = numberOf(query, 'near', 0.001, 1);
  const angle_deg = numberOf(query, 'angle', 0.1, 90);
  return {
    kind,
    areaSide_m: numberOf(query, 'area', 0.01, 10) ?? 0.15,
    nearEnough: {
      ...(near_m !== null && { position_m: near_m }),
      ...(angle_deg !== null && { direction_rad: angle_deg * RADIANS }),
    },
    autoShutter: shutter === 'auto',
    step_rad: (numberOf(query, 'step', 2, 90) ?? 20) * RADIANS,
    extent_rad: (numberOf(query, 'extent', 0, 90) ?? 60) * RADIANS,
  };
}

function isKind(kind: string): kind is GuideKind {
  return KINDS.includes(kind);
}

function numberOf(query: URLSearchParams, name: string, low: number, high: number): number | null {
  const text = query.get(name);
  if (text === null) return null;
  const value = Number(text);
  if (text.trim() !== '' && value >= low && value <= high) return value;
  throw new NoSuchGuide(`${name} must be from ${low} to ${high}, got "${text}".`);
}
