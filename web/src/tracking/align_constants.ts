/** Numbers of the alignment; `src/peaking/tracking/` explains them. */

export const LUMA = [0.299, 0.587, 0.114] as const;
export const MIN_ALPHA = 0.95;
export const DEPTH_EDGE = 1.08;
export const MIN_GRADIENT = 0.01;
export const MIN_PIXELS = 150;
export const MAX_CHOSEN = 8000;
export const FINEST_PIXELS = 48_000;
export const MAX_LEVELS = 4;
export const SHORTEST_SIDE_PX = 20;
export const ITERATIONS = 10;
export const SMALL_MOVE_M = 5e-5;
export const SMALL_TURN_RAD = 3e-5;
export const CAUCHY = 2;
export const MIN_SIGMA = 0.01;
export const AGREES = 3;
export const MAX_AGREEING_SIGMA = 0.04;
export const CORRELATED = 16;
export const GAIN_SD = 0.5;
export const OFFSET_SD = 0.1;
export const MIN_GAIN = 0.25;
export const MAX_GAIN = 4;
export const MAX_MOVE_M = 0.1;
export const MAX_TURN_RAD = (5 * Math.PI) / 180;
export const MAX_LAST_MOVE_M = 1e-3;
export const MAX_LAST_TURN_RAD = 1e-3;
export const MIN_AGREEING = 0.5;
export const MIN_CORRELATION = 0.7;
export const MIN_LEARNED = 0.5;
export const SAME_ERROR = 1.001;
export const PRIOR_MOVE_M = 0.01;
export const PRIOR_TURN_RAD = (0.5 * Math.PI) / 180;

/** Compared with Python's by a test. */
export const TRACKING = {
  MIN_ALPHA, DEPTH_EDGE, MIN_GRADIENT, MIN_PIXELS, MAX_CHOSEN, FINEST_PIXELS, MAX_LEVELS, SHORTEST_SIDE_PX,
  ITERATIONS, SMALL_MOVE_M, SMALL_TURN_RAD, CAUCHY, MIN_SIGMA, AGREES, MAX_AGREEING_SIGMA, CORRELATED,
  GAIN_SD, OFFSET_SD, MAX_MOVE_M, MAX_TURN_RAD, MAX_LAST_MOVE_M, MAX_LAST_TURN_RAD, MIN_AGREEING, MIN_CORRELATION, MIN_LEARNED,
  SAME_ERROR, PRIOR_MOVE_M, PRIOR_TURN_RAD,
} as const;
