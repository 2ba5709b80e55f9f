/** Four tasks, solved by doing them: take a view, move, take one where it is red, see the red go. */

export interface CoachMoment {
  views: number;
  /** Views whose MPI takes part already. */
  ready: number;
  peakedShare: number | null;
}

export const TASKS = [
  { title: 'Take a first view', text: 'Hold still and press the round button.' },
  { title: 'Now move', text: 'Take a step sideways. What is shown wrongly turns red; what is new is hatched.' },
  { title: 'Capture where it is marked', text: 'A view from here mends what is red or hatched.' },
  { title: 'The marks disappear', text: 'Keep going until none remain, then press Finish.' },
] as const;

/** Said between the first press and its picture. */
export const ON_ITS_WAY = { title: 'One moment', text: 'Your first view is being reconstructed.' } as const;

/** Peaked share at which a beginner notices the red. */
const MUCH_RED = 0.06;
/** It went when it fell to this part of what it was. */
const GONE = 0.8;

export class Coach {
  /** Index of the current task; `TASKS.length` when all are done. */
  task = 0;
  #viewsBefore = 0;
  #redBefore = 0;

  /** Tell what is; moves on when a task is done. */
  update(now: Readonly<CoachMoment>): void {
    const red = now.peakedShare ?? 0;
    switch (this.task) {
      case 0:
        if (now.ready > 0) this.#next(now);
        break;
      case 1:
        if (red <= MUCH_RED) break;
        this.#redBefore = red;
        this.#next(now);
        break;
      case 2:
        if (now.views > this.#viewsBefore) this.#next(now);
        else this.#redBefore = Math.max(this.#redBefore, red);
        break;
      case 3:
        if (now.ready >= now.views && red < GONE * this.#redBefore) this.#next(now);
        break;
      default:
    }
  }

  /** Whether what the task asks for was done, and shows in a moment. */
  waits(now: Readonly<CoachMoment>): boolean {
    return this.task === 0 && now.views > 0;
  }

  /** From the beginning. */
  restart(): void {
    this.task = 0;
  }

  get done(): boolean {
    return this.task >= TASKS.length;
  }

  #next(now: Readonly<CoachMoment>): void {
    this.task += 1;
    this.#viewsBefore = now.views;
  }
}
