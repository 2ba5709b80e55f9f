"""Train 3D Gaussians on a recording, on the CPU, and write them for viewers such as SuperSplat.

python examples/train_gaussians.py scenes/desk out/desk.ply 500
"""

import sys
from pathlib import Path

from peaking.datasets import open_recording
from peaking.frame import working_size_px
from peaking.splat.options import SplatOptions
from peaking.splat.ply import write_ply
from peaking.splat.train import TrainingStep, train

scene, ply_file, iterations = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
recording = open_recording(scene)
size_px = working_size_px(*recording.cameras[0].pinhole.size_px, pixels=40_000)
every_third = range(0, len(recording), 3)
frames = [recording.read(index).resized(*size_px) for index in every_third]


def show(step: TrainingStep) -> None:
    """Print the loss now and then."""
    if step.iteration % 100 == 0:
        print(f"step {step.iteration}: loss {step.loss:.3f}, {step.num_gaussians} Gaussians")


gaussians = train(frames, SplatOptions(iterations=iterations), progress=show)
write_ply(ply_file, gaussians)
print(f"{ply_file}: {len(gaussians)} Gaussians")
