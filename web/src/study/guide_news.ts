/** What a study records of a guide. */

import type { GuideState } from '../guidance/guide_session';

/** The numbers that a guide shows, by name. */
export type GuideNews = Readonly<Record<string, number>>;

/** Of a scan that is over: until then the numbers are on their way. */
export function guideNews(state: GuideState): GuideNews {
  return {
    targets: state.takenBy.length,
    targets_taken: state.taken,
    ...(state.zMin_m !== null && { z_min_m: state.zMin_m }),
    ...(state.bound !== null && {
      views_needed: state.bound.numViews, spacing_m: state.bound.spacing_m,
      area_side_m: state.bound.areaSide_m,
    }),
  };
}
