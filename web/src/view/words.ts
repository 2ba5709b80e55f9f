/** What is said of a place, in words. */

import { viewsText } from '../ui/words';
import { pathLength, type Place, type Shown } from './place';

export const NAMES: Readonly<Record<Shown, string>> = {
  'light-field': 'Light field', place: 'Overview', splat: 'Splat',
};

/** For those who do not see the picture, and for those who look for the keys. */
export const HOW: Readonly<Record<Shown, string>> = {
  'light-field': 'Drag or use the arrow keys to look around. Walk with W A S D, up and down with E and Q; use the wheel or two fingers to step closer.',
  place: 'Drag or use the arrow keys to turn it. Move it with W A S D, E and Q, or two fingers; use the wheel or two fingers to move closer. Click a camera to look through it.',
  splat: 'Drag or use the arrow keys to turn it. Move it with W A S D, E and Q, or two fingers; use the wheel or two fingers to move closer.',
};

/** A smaller loss is none. */
const SAID_DB = 0.05;

/** A length: "85 cm", "3.1 m". */
export function lengthText(length_m: number): string {
  return length_m < 1 ? `${Math.round(100 * length_m)}\u00a0cm` : `${length_m.toFixed(1)}\u00a0m`;
}

/** "12 views · 3.1 m walked · 2.1 × 3.0 m, 1.9 m high". */
export function factsText(
  place: Place, size: { readonly wide: number; readonly deep: number; readonly high: number } | null,
): string {
  const facts = place.views.length === 0 ? [] : [viewsText(place.views.length)];
  if (!place.metric) {
    if (place.views.length > 0) facts.push('scale unknown');
    return facts.join(' · ');
  }
  if (place.views.length > 1) facts.push(`${lengthText(pathLength(place.views))} walked`);
  if (size !== null) facts.push(`${size.wide.toFixed(1)} × ${size.deep.toFixed(1)}\u00a0m, ${size.high.toFixed(1)}\u00a0m high`);
  return facts.join(' · ');
}

/** What the picture is, for those who do not see it. */
export function describes(place: Place, shown: Shown): string {
  const what = {
    'light-field': `The light field of ${place.title}, from ${viewsText(place.views.length)}, to walk in.`,
    place: `The cameras of ${place.title}: ${viewsText(place.views.length)}, their path and the points they see.`,
    splat: `3D Gaussians of ${place.title}, to turn around.`,
  }[shown];
  const lost_db = { 'light-field': place.loss_db, splat: place.splat_loss_db, place: null }[shown] ?? 0;
  const loss = lost_db < SAID_DB ? '' : ` ${lost_db.toFixed(1)} dB were lost to make it small.`;
  return `${what}${loss} ${HOW[shown]}`;
}
