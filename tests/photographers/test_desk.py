"""The desk that is drawn from anywhere is the desk of `scenes/desk`, which was path-traced."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from peaking.datasets import open_recording
from peaking.photographers.drawn import desk_scene
from peaking.photographers.drawn_mesh import build_mesh
from peaking.photographers.scene import Scene

DESK = Path(__file__).parent.parent.parent / "scenes" / "desk"
MM = 0.0006
"""Half a millimetre, by which depth was rounded, and a little."""


def test_depth_is_that_of_the_sample_scene() -> None:
    drawn = [make(np.random.default_rng((7, k))) for k, make in enumerate(desk_scene.PARTS)]
    mesh, _ = build_mesh(drawn)
    scene = Scene(mesh, np.ones_like(mesh.points_m))
    recording = open_recording(DESK)
    for number in (0, 75):
        true_m = recording.true_depth_m(number)
        assert true_m is not None
        camera = recording.cameras[number].resized(true_m.shape[1], true_m.shape[0])
        apart_m = np.abs(scene.depth_m(camera) - true_m)
        known = true_m > 0  # all but mirror and glass
        assert known.mean() > 0.9
        # Measured: half a millimetre, by which it was rounded.
        assert (apart_m[known] <= MM).mean() > 0.9999
