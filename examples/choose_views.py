"""Choose the views of a recording that show the rest of it: take a frame when too much is red.

python examples/choose_views.py scenes/desk 0.0428
"""

import sys
from pathlib import Path

from peaking.datasets import open_recording
from peaking.pipeline import Reconstruction

recording = open_recording(Path(sys.argv[1]))
threshold_share = float(sys.argv[2])
scene = Reconstruction()
chosen: list[int] = []

for index in range(len(recording)):
    live = scene.prepare(recording.read(index))
    if chosen:
        errors = scene.compare(live.rgb, live.camera).errors
        if errors.peaked_share <= threshold_share:
            continue
    scene.add_view(recording.read(index))
    chosen.append(index)

print(f"{len(chosen)} of {len(recording)} frames: {' '.join(map(str, chosen))}")
