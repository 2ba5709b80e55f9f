/** What a study records of a guide. */

import type { GuideState } from '../guidance/guide_session';

/** `scanned`: the guide has seen the scene; and the numbers that it shows. */
export type GuideNews = Readonly<Record<string, number | boolean>>;

/** Numbers are told when the scan is over: until then they are on their way. */
export function guideNews(state: GuideState): GuideNews {
  if (state.phase === 'scan') return { scanned: false };
  return {
    scanned: true,
    targets: state.takenBy.length,
    targets_taken: state.taken,
    ...(state.zMin_m !== null && { z_min_m: state.zMin_m }),
    ...(state.bound !== null && {
      views_needed: state.bound.numViews, spacing_m: state.bound.spacing_m,
      area_side_m: state.bound.areaSide_m,
    }),
  };
}
