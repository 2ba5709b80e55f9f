/**
 * What happened to a capture, and when: from the shutter to the first frame drawn with its MPI. For
 * `peaking bench live` and for people with the developer tools open.
 */

export const STEPS = [
  'shutter', 'photo', 'kept', 'acknowledged', 'ready', 'fetched', 'decoded', 'drawn',
] as const;
export type Step = (typeof STEPS)[number];

/** Milliseconds since the page was opened, of `performance.now()`. */
export type StepTimes = Readonly<Partial<Record<Step, number>>>;

export class Timeline {
  /** Goes up with every step that is noted. */
  noted = 0;
  private readonly captures = new Map<string, Partial<Record<Step, number>>>();

  /** Note the first time that a capture reaches a step; later ones are ignored. */
  mark(captureId: string, step: Step, now_ms: number): void {
    const times = this.captures.get(captureId);
    if (times?.[step] !== undefined) return;
    this.noted += 1;
    if (times === undefined) this.captures.set(captureId, { [step]: now_ms });
    else times[step] = now_ms;
  }

  has(captureId: string, step: Step): boolean {
    return this.captures.get(captureId)?.[step] !== undefined;
  }

  /** All captures since the page was opened, in order. */
  all(): readonly { readonly id: string; readonly times: StepTimes }[] {
    return Array.from(this.captures, ([id, times]) => ({ id, times: { ...times } }));
  }
}
