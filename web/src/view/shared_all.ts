/** For pages that show light fields, cameras and 3D Gaussians. */

import { partsOf } from './parts';
import { openShared } from './shared';

void openShared(partsOf(), document.getElementById('view') ?? document.body);
