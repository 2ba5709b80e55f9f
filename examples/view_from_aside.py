"""Make the MPI of one frame, keep it as a file, and render it from 10 cm to the right.

Usage: python examples/view_from_aside.py scenes/desk out/view.mpi out/aside.png
"""

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

import peaking

scene, mpi_file, picture = (Path(name) for name in sys.argv[1:4])
frame = peaking.open_recording(scene).read(0)
peaking.write_mpi(mpi_file, peaking.generate(frame))

mpi = peaking.read_mpi(mpi_file)
here = mpi.camera.world_from_cam
to_the_right_m = here.rotation @ np.array([0.1, 0.0, 0.0])
aside = replace(here, translation_m=here.translation_m + to_the_right_m)
rendering = peaking.render(mpi, replace(mpi.camera, world_from_cam=aside))

bgr = np.clip(255 * rendering.rgb()[..., ::-1], 0, 255).astype(np.uint8)
cv2.imwrite(str(picture), bgr)
print(f"{picture}: {np.mean(rendering.alpha > 0.5):.1%} of the picture is known from this frame")
