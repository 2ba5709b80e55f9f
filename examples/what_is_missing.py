"""Tell how much of each frame of a recording one captured view cannot show.

Usage: python examples/what_is_missing.py scenes/desk
"""

import sys

import peaking

recording = peaking.open_recording(sys.argv[1])
reconstruction = peaking.Reconstruction()
reconstruction.add_view(recording.read(0))

for index in range(0, len(recording), max(len(recording) // 10, 1)):
    live = reconstruction.prepare(recording.read(index))
    errors = reconstruction.compare(live.rgb, live.camera, depth_m=live.depth_m).errors
    print(
        f"frame {index:4}: {errors.wrong_share:6.1%} of the pixels are wrong, "
        f"{errors.unseen_share:6.1%} show what was never seen"
    )
