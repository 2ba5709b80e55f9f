"""Choose the views of a recording that show the rest of it, in two ways.

The paper's photographer takes a frame when more than a share of it is red. The default policy
looks at all frames and keeps as many views, those that would be missed most.

Usage: python examples/choose_views.py scenes/desk 0.0428
"""

import sys

import peaking

recording = peaking.open_recording(sys.argv[1])
threshold_share = float(sys.argv[2])
reconstruction = peaking.Reconstruction()
taken: list[int] = []

for index in range(len(recording)):
    live = reconstruction.prepare(recording.read(index))
    if taken:
        errors = reconstruction.compare(live.rgb, live.camera).errors
        if errors.peaked_share <= threshold_share:
            continue
    reconstruction.add_view(recording.read(index))
    taken.append(index)

kept = peaking.select(recording, len(taken))
print(f"when it is red: {' '.join(map(str, taken))}")
print(f"as many, kept:  {' '.join(map(str, kept))}")
