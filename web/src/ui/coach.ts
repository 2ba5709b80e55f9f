/** Four tasks, solved by doing them: take a view, move, take one where it is marked, see the marks go. */

export interface CoachMoment {
  views: number;
  /** Views whose MPI takes part already. */
  ready: number;
  peakedShare: number | null;
}

export interface Task {
  readonly title: string;
  readonly text: string;
}

/** How views are taken, and who moves. */
export interface CoachedWay {
  readonly auto: boolean;
  /** A recording plays as the camera: nobody can walk in it. */
  readonly isRecording: boolean;
}

export const NUM_TASKS = 4;

const FIRST_VIEW: Task = { title: 'Take a first view', text: 'Hold still and press the round button.' };
const FIRST_FRAME: Task = { title: 'Take a first view', text: 'Press the round button.' };
const MARKS = 'What is shown wrongly turns red; what is new is hatched.';
const WALK: Task = { title: 'Now move', text: `Take a step sideways. ${MARKS}` };
const PLAY: Task = { title: 'Let it play on', text: MARKS };
const SHOOT: Task = { title: 'Capture where it is marked', text: 'A view from here mends what is red or hatched.' };
const HOLD: Task = { title: 'Hold still where it is marked', text: 'Auto takes a view as soon as the phone is steady.' };
const WATCH: Task = { title: 'Auto takes views by itself', text: 'It waits until the camera is steady where it is marked.' };
const GO_ON: Task = { title: 'The marks disappear', text: 'Keep going until few remain, then press Finish.' };
const GO_ON_PLAYING: Task = { title: 'The marks disappear', text: 'Play on until few remain, then press Finish.' };

/** What to say at a task; undefined when all are done. */
export function taskOf(task: number, { auto, isRecording }: CoachedWay): Task | undefined {
  switch (task) {
    case 0: return isRecording ? FIRST_FRAME : FIRST_VIEW;
    case 1: return isRecording ? PLAY : WALK;
    case 2:
      if (!auto) return SHOOT;
      return isRecording ? WATCH : HOLD;
    case 3: return isRecording ? GO_ON_PLAYING : GO_ON;
    default: return undefined;
  }
}

/** Said between the first press and its picture. */
export const ON_ITS_WAY = { title: 'One moment', text: 'Your first view is being reconstructed.' } as const;

/** Peaked share at which a beginner notices the red. */
const MUCH_RED = 0.06;
/** Less than this is no place to capture any more: moved away, or back. */
const CALM = 0.02;
/** It went when it fell to this part of what it was. */
const GONE = 0.8;

export class Coach {
  /** Index of the current task; `NUM_TASKS` when all are done. */
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
        else if (red < CALM) this.task = 1;
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
    return this.task >= NUM_TASKS;
  }

  #next(now: Readonly<CoachMoment>): void {
    this.task += 1;
    this.#viewsBefore = now.views;
  }
}
