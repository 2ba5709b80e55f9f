"""Choose the views of a recording that show the rest of it: take a frame when too much is red.

python examples/choose_views.py scenes/desk 0.0428
"""

import sys
from pathlib import Path

from peaking.datasets.nerfstudio import open_recording
from peaking.pipeline import LocalLightField

recording = open_recording(Path(sys.argv[1]))
threshold_share = float(sys.argv[2])
light_field = LocalLightField()
chosen: list[int] = []

for index in range(len(recording)):
    live = light_field.prepare(recording.read(index))
    if chosen:
        errors = light_field.see(live.rgb, live.camera).errors
        if errors.peaked_share <= threshold_share:
            continue
    light_field.add_view(recording.read(index))
    chosen.append(index)

print(f"{len(chosen)} of {len(recording)} frames: {' '.join(map(str, chosen))}")
