/** Words that several pages use. */

import type { WhyUnfixable } from '../render/touched';

/** "tracking off by 6 mm, 0.3°"; empty while nobody knows. */
export function trackingText({ moved_m, turned_rad }: {
  readonly moved_m: number | null; readonly turned_rad: number | null;
}): string {
  if (moved_m === null || turned_rad === null) return '';
  const degrees = (turned_rad * 180) / Math.PI;
  return `tracking off by ${Math.round(1000 * moved_m)} mm, ${degrees.toFixed(1)}°`;
}

/** What to say of a place where no view will help. */
export const WHY_UNFIXABLE: Readonly<Record<WhyUnfixable, string>> = {
  'over-exposed': 'Too bright for the camera: lower the exposure or leave it.',
  unsteady: 'Mirror, glass or movement: more photos will not help here.',
};

/** "1 view", "2 views". */
export function viewsText(count: number): string {
  return count === 1 ? '1 view' : `${count} views`;
}
