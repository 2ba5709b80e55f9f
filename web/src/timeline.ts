/**
 * What happened to a capture, and when: from the shutter to the first frame drawn with its MPI. For
 * `peaking bench live` and for people with the developer tools open.
 */

export const MILESTONES = [
  'shutter', 'photo', 'kept', 'acknowledged', 'ready', 'fetched', 'decoded', 'drawn',
] as const;
export type Milestone = (typeof MILESTONES)[number];

/** Milliseconds since the page was opened, of `performance.now()`. */
export type MilestoneTimes = Readonly<Partial<Record<Milestone, number>>>;

export class Timeline {
  /** Goes up with everything that is noted. */
  noted = 0;
  private readonly captures = new Map<string, Partial<Record<Milestone, number>>>();

  /** Note the first time that a capture reaches a milestone; later ones are ignored. */
  mark(captureId: string, milestone: Milestone, now_ms: number): void {
    const times = this.captures.get(captureId);
    if (times?.[milestone] !== undefined) return;
    this.noted += 1;
    if (times === undefined) this.captures.set(captureId, { [milestone]: now_ms });
    else times[milestone] = now_ms;
  }

  has(captureId: string, milestone: Milestone): boolean {
    return this.captures.get(captureId)?.[milestone] !== undefined;
  }

  /** All captures since the page was opened, in order. */
  all(): readonly { readonly id: string; readonly times: MilestoneTimes }[] {
    return Array.from(this.captures, ([id, times]) => ({ id, times: { ...times } }));
  }
}
