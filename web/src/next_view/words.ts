/** What is said of a suggested view and of the whole capture. */

import type { Guidance } from '../wire';
import type { Move } from './place';

export const MOVES: Readonly<Record<Move, string>> = {
  left: 'Step to the left, into the frame',
  right: 'Step to the right, into the frame',
  up: 'Hold the phone higher, into the frame',
  down: 'Hold the phone lower, into the frame',
  closer: 'Step closer, into the frame',
  back: 'Step back, into the frame',
  'turn-left': 'Turn to the left, into the frame',
  'turn-right': 'Turn to the right, into the frame',
  'turn-up': 'Tilt up, into the frame',
  'turn-down': 'Tilt down, into the frame',
  here: 'Take a view from here',
};

export const VERDICTS: Readonly<Record<Guidance['verdict'], string>> = {
  'go on': 'More views help',
  enough: 'Enough for this place',
  'no more help': 'More views will not help here',
};

/** "Done 82 %": rounded down, so that 100 % is all. */
export function doneText({ score }: Pick<Guidance, 'score'>): string {
  return `Done ${Math.floor(100 * score)}\u00a0%`;
}
