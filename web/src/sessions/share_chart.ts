/** Peaked share over the time of a session, as SVG. */

import { percent } from '../ui/share_graph';
import { PAPER_PEAKED_SHARE, type Capture, type PeakedSample } from '../wire';

const WIDTH = 600;
const HEIGHT = 400;
const LEFT = 68;
const BOTTOM = 32;

export function drawShares(
  samples: readonly PeakedSample[], captures: readonly Capture[],
): string {
  const first = samples[0]?.time_s;
  const last = samples.at(-1)?.time_s;
  if (first === undefined || last === undefined) return '';
  const top = Math.max(2.5 * PAPER_PEAKED_SHARE, ...samples.map((sample) => sample.peaked_share));
  const x = (time_s: number): number =>
    LEFT + ((WIDTH - LEFT - 6) * (time_s - first)) / Math.max(last - first, 1);
  const y = (share: number): number => HEIGHT - BOTTOM - (HEIGHT - BOTTOM - 16) * (share / top);
  const at = (time_s: number, share: number): string => `${x(time_s).toFixed(1)} ${y(share).toFixed(1)}`;
  const curve = samples.map((s) => at(s.time_s, s.peaked_share));
  const unseen = samples.flatMap((s) => (s.unseen_share == null ? [] : [at(s.time_s, s.unseen_share)]));
  const ofUnseen = unseen.length === 0 ? ''
    : `<path d="M${unseen.join('L')}" fill="none" stroke="#96a5be" stroke-width="2" stroke-linejoin="round">`
      + '<title>New: what no view shows</title></path>';
  const marks = captures
    .filter((c) => c.removed !== true && c.time_s >= first && c.time_s <= last)
    .map((c) => `<path d="M${x(c.time_s).toFixed(1)} 8V${HEIGHT - BOTTOM}" stroke="#ffffff66">`
      + `<title>View ${c.number}</title></path>`);
  const label = (share: number): string =>
    `<text x="4" y="${y(share) + 7}" fill="#a9b0bb" font-size="20">${percent(share)}</text>`;
  return `<svg viewBox="0 0 ${WIDTH} ${HEIGHT}" role="img" aria-label="Share of what is marked over time: wrong and new together, and new alone">
    <path d="M${LEFT} ${y(PAPER_PEAKED_SHARE)}H${WIDTH - 6}" stroke="#a9b0bb" stroke-dasharray="5 6"/>
    ${marks.join('')}${ofUnseen}<path d="M${curve.join('L')}" fill="none" stroke="#ff4d4d" stroke-width="2.5"
    stroke-linejoin="round"><title>Wrong and new</title></path>${label(top)}${label(PAPER_PEAKED_SHARE)}
    <text x="${LEFT}" y="${HEIGHT - 4}" fill="#a9b0bb" font-size="20">0 s</text>
    <text x="${WIDTH - 6}" y="${HEIGHT - 4}" fill="#a9b0bb" font-size="20" text-anchor="end">${
  Math.round(last - first)} s</text></svg>`;
}
