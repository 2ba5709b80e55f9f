"""Train 3D Gaussians on a recording, on the CPU, and write them for viewers such as SuperSplat.

Usage: python examples/train_gaussians.py scenes/desk out/desk.ply 500
"""

import sys
from pathlib import Path

import peaking

LONG_SIDE_PX = 256
"""Training costs by the pixel."""

ply_file = Path(sys.argv[2])
recording = peaking.open_recording(sys.argv[1])
width_px, height_px = recording.cameras[0].pinhole.size_px
scale = min(LONG_SIDE_PX / max(width_px, height_px), 1.0)
size_px = round(scale * width_px), round(scale * height_px)
every_third = range(0, len(recording), 3)
frames = [recording.read(index).resized(*size_px) for index in every_third]

gaussians = peaking.train(frames, peaking.SplatOptions(iterations=int(sys.argv[3])))
peaking.write_ply(ply_file, gaussians)
print(f"{ply_file}: {len(gaussians)} Gaussians")
