/** The peaked share over the last minute, as a small curve. */

import { PAPER_PEAKED_SHARE } from '../wire';

/** "4.28 %": the dashed line of the graphs. */
export const PAPER_PERCENT = `${(100 * PAPER_PEAKED_SHARE).toFixed(2)}\u00a0%`;
const SHOWN_MS = 60_000;
const EVERY_MS = 500;

interface Point { readonly time_ms: number; readonly share: number }

export class ShareHistory {
  readonly points: Point[] = [];
  readonly shots_ms: number[] = [];

  /** Note a share; at most one every half second is kept. Returns whether it was. */
  add(time_ms: number, share: number): boolean {
    const last = this.points.at(-1);
    if (last !== undefined && time_ms - last.time_ms < EVERY_MS) return false;
    this.points.push({ time_ms, share });
    while ((this.points[0]?.time_ms ?? time_ms) < time_ms - SHOWN_MS) this.points.shift();
    while ((this.shots_ms[0] ?? time_ms) < time_ms - SHOWN_MS) this.shots_ms.shift();
    return true;
  }

  shot(time_ms: number): void {
    this.shots_ms.push(time_ms);
  }

  /** The top of the scale: what is shown fills the graph, and the goal is always in it. */
  get top(): number {
    return Math.max(2.5 * PAPER_PEAKED_SHARE, ...this.points.map(({ share }) => share));
  }

  /** Draw over the whole canvas; the newest point is at its right edge. */
  draw(canvas: HTMLCanvasElement): void {
    const context = canvas.getContext('2d');
    const now_ms = this.points.at(-1)?.time_ms;
    if (context === null || now_ms === undefined) return;
    const { width, height } = canvas;
    const x = (time_ms: number): number => width * (1 - (now_ms - time_ms) / SHOWN_MS);
    const y = (share: number): number => height - 2 - (height - 4) * (share / this.top);
    context.clearRect(0, 0, width, height);
    context.setLineDash([3, 4]);
    context.strokeStyle = 'rgb(255 255 255 / 45%)';
    context.beginPath();
    context.moveTo(0, y(PAPER_PEAKED_SHARE));
    context.lineTo(width, y(PAPER_PEAKED_SHARE));
    context.stroke();
    context.setLineDash([]);
    context.fillStyle = '#fff';
    for (const shot_ms of this.shots_ms) context.fillRect(x(shot_ms) - 1, 0, 2, height);
    context.strokeStyle = '#ff4d4d';
    context.lineWidth = 3;
    context.lineJoin = 'round';
    context.beginPath();
    for (const { time_ms, share } of this.points) context.lineTo(x(time_ms), y(share));
    context.stroke();
  }
}

/** A share for people: two digits are enough, and nothing is 0 that is not. */
export function percent(share: number | null): string {
  if (share === null) return '–';
  const value = 100 * share;
  if (value > 0 && value < 0.1) return '<0.1 %';
  return `${value.toFixed(value < 10 ? 1 : 0)} %`;
}
