/** How long to wait before trying again. Time and chance are handed in, so tests do not wait. */

export interface Pacing {
  /** Resolves after so many milliseconds, or as soon as the signal aborts; never rejects. */
  sleep(duration_ms: number, signal: AbortSignal): Promise<void>;
  /** Uniform in [0, 1). */
  random(): number;
}

const FIRST_MS = 500;
const LONGEST_MS = 30_000;

/**
 * Exponential backoff with jitter: half of it is certain, half is drawn, so that twenty phones do
 * not come back in the same moment.
 *
 * @param failures In a row, so far; 1 after the first.
 */
export function backoff_ms(failures: number, pacing: Pacing): number {
  const full_ms = Math.min(LONGEST_MS, FIRST_MS * 2 ** Math.max(0, failures - 1));
  return full_ms * (0.5 + 0.5 * pacing.random());
}

/** The browser's own clock and chance. */
export const browserPacing: Pacing = {
  sleep: (duration_ms, signal) => new Promise((resolve) => {
    if (signal.aborted) return resolve();
    const finish = (): void => {
      clearTimeout(timer);
      signal.removeEventListener('abort', finish);
      resolve();
    };
    const timer = setTimeout(finish, duration_ms);
    signal.addEventListener('abort', finish);
  }),
  random: () => Math.random(),
};
