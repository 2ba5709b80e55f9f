/** All ways to show a place, each loaded when it is first shown. */

import type { ViewerParts } from './viewer';

export function partsOf(): ViewerParts {
  return { lightField: () => import('./light_field_layer'), space: () => import('./space_layer') };
}
