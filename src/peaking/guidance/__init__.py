"""Where to take views from: the guidance that the paper compares with, behind one interface.

`scan` finds the nearest depth, `plenoptic` turns it into a spacing and a grid, `planes` and
`hemisphere` are the other layouts that the paper names, `guide` says which targets are taken.

Without targets, `watch` says where the next view helps most and how complete a capture is
(docs/guidance.md): `virtual_cameras` are poses around the walk, `foresight` says what is to be
expected at each, `next_view` chooses one, `completeness` scores.
"""

from peaking.guidance.guide import Guide, GuideProgress, Tolerance, progress
from peaking.guidance.hemisphere_guide import hemisphere
from peaking.guidance.planes import plane_stack
from peaking.guidance.plenoptic import PlenopticBound, plenoptic_grid
from peaking.guidance.scan import DepthScan

__all__ = [
    "DepthScan",
    "Guide",
    "GuideProgress",
    "PlenopticBound",
    "Tolerance",
    "hemisphere",
    "plane_stack",
    "plenoptic_grid",
    "progress",
]
