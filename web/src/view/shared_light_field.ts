/** For pages that show a light field alone: without three.js they are small. */

import { openShared } from './shared';

const parts = { lightField: () => import('./light_field_layer'), space: null };
void openShared(parts, document.getElementById('view') ?? document.body);
