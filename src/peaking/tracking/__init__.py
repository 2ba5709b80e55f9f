"""Find where a live picture was taken from, by what the rendering for about there shows.

Devices know their pose to about a centimetre and half a degree, and that much is red. `align` moves
the camera until the rendering, by its own depth, looks as the live picture does; `refine` renders
again from there and aligns again.

The method is direct (Lucas & Kanade 1981) and inverse compositional (Baker & Matthews 2004) on the
rendering's depth, as in DVO (Kerl, Sturm & Cremers, ICRA 2013): six numbers of motion, one gain and
one offset of brightness; robust (Cauchy) weights; coarse to fine. The device's pose is a prior, so
what the picture does not tell stays as the device has it.

`_numpy.py` is the method in float64; `_numba.py` is the same, fast; `web/src/tracking/align.ts` is
its twin in the client.
"""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from peaking.geometry import Cam, Camera, Rigid
from peaking.rendering import Backend, Rendering
from peaking.tracking.solution import MIN_PIXELS, Solution, first_and_last_level, halved

Failure = Literal[
    "too-few-pixels", "too-far", "not-converged", "too-different", "undetermined", "no-better"
]
"""Why a pose was not corrected.

- `too-few-pixels`: too little of the picture is rendered and has texture;
- `too-far`: the search left the surroundings of the given pose;
- `not-converged`: the last step was still large;
- `too-different`: the pictures do not show the same;
- `undetermined`: the picture says hardly more than the given pose does;
- `no-better`: at the pose that was found the pictures differ as much as before.
"""

MAX_MOVE_M = 0.1
MAX_TURN_RAD = math.radians(5)
"""What is found further away from the given pose is not believed."""

MAX_LAST_MOVE_M = 1e-3
MAX_LAST_TURN_RAD = 1e-3
"""A last step longer than this is no convergence."""

MIN_AGREEING = 0.5
"""Share of the pixels that must agree."""

MIN_CORRELATION = 0.7
"""Of the brightness of both pictures, by the weights that pixels have in the end."""

MIN_LEARNED = 0.5
"""Some direction must be known better than this times as well as it was before."""

SAME_ERROR = 1.001
"""Errors whose ratio is less than this are the same: nobody needs to move who stands right."""

PRIOR_MOVE_M = 0.01
PRIOR_TURN_RAD = math.radians(0.5)
"""How well a device knows its pose: standard deviations along, and about, each axis."""


@dataclass(frozen=True)
class Alignment:
    """Where a live picture was taken from.

    Attributes:
        camera: The corrected camera; the given one where the alignment failed.
        covariance: Of the corrected camera's motion in its own frame, along x, y, z in metres, then
            about x, y, z in radians. Never more than the prior's (`PRIOR_MOVE_M`).
        agreeing: Share of the compared pixels whose brightness agrees, 0…1.
        num_pixels: Pixels that were compared.
        failure: Why the camera was not corrected; None where it was.
        moved_m: How far the corrected camera is from the given one.
        turned_rad: By how much it is turned.
    """

    camera: Camera
    covariance: Float64[np.ndarray, "6 6"]
    agreeing: float
    num_pixels: int
    failure: Failure | None
    moved_m: float
    turned_rad: float

    @property
    def ok(self) -> bool:
        """Whether the camera was corrected."""
        return self.failure is None

    @property
    def move_sd_m(self) -> Float64[np.ndarray, "3"]:
        """Standard deviations along the camera's axes, metres."""
        return np.sqrt(np.diag(self.covariance)[:3])

    @property
    def turn_sd_rad(self) -> Float64[np.ndarray, "3"]:
        """Standard deviations about the camera's axes, radians."""
        return np.sqrt(np.diag(self.covariance)[3:])


def prior_covariance() -> Float64[np.ndarray, "6 6"]:
    """Return the covariance of a device's pose, as in `Alignment.covariance`."""
    return np.diag([PRIOR_MOVE_M**2] * 3 + [PRIOR_TURN_RAD**2] * 3)


def align(
    rendering: Rendering,
    camera: Camera,
    live: UInt8[np.ndarray, "h w 3"],
    *,
    backend: Backend = "numba",
) -> Alignment:
    """Find where the live picture was taken from, near the camera of the rendering.

    Args:
        rendering: What the captured views show from `camera`.
        camera: About where the picture was taken from.
        live: The picture, of the rendering's size.
        backend: Which implementation.

    Raises:
        ValueError: The sizes of rendering, camera and picture differ.
    """
    size_px = camera.pinhole.size_px
    if not live.shape[:2] == rendering.depth_m.shape == size_px[::-1]:
        raise ValueError(
            f"need a picture and a rendering of the camera's size {size_px[::-1]}, "
            f"got {live.shape[:2]} and {rendering.depth_m.shape}"
        )
    if backend == "numpy":
        from peaking.tracking import _numpy as module
    else:
        from peaking.tracking import _numba as module
    information = np.linalg.inv(prior_covariance())
    solution = module.solve(rendering.rgba, rendering.depth_m, live, camera.pinhole, information)
    return _judged(solution, camera)


def refine(
    render: Callable[[Camera], Rendering],
    camera: Camera,
    live: UInt8[np.ndarray, "h w 3"],
    *,
    rounds: int = 2,
    backend: Backend = "numba",
) -> Alignment:
    """Align, render from the pose that was found, and align again.

    The first rendering is of a place up to some centimetres away, where other things are hidden and
    highlights lie elsewhere; the second is not. What is rendered is no larger than what is compared
    (`FINEST_PIXELS`).

    Args:
        render: Renders the captured views.
        camera: About where the picture was taken from.
        live: The picture, of the camera's size.
        rounds: How often to align, at least 1.
        backend: Which implementation.

    Returns:
        The last alignment that succeeded, or the first where none did. How far it moved is counted
        from the given camera.

    Raises:
        ValueError: The sizes of camera and picture differ, or rounds < 1.
    """
    if rounds < 1:
        raise ValueError(f"need rounds >= 1, got {rounds}")
    if live.shape[:2] != camera.pinhole.size_px[::-1]:
        raise ValueError(
            f"need a picture of the camera's size {camera.pinhole.size_px[::-1]}, "
            f"got {live.shape[:2]}"
        )
    times, _ = first_and_last_level(*live.shape[:2])
    lens = halved(camera.pinhole, times)
    small = cv2.resize(
        live[: lens.height_px << times, : lens.width_px << times],
        lens.size_px,
        interpolation=cv2.INTER_AREA,
    )
    best: Alignment | None = None
    for _ in range(rounds):
        here = Camera(lens, camera.world_from_cam if best is None else best.camera.world_from_cam)
        found = align(render(here), here, small, backend=backend)
        found = _seen_from(found, camera)
        if not found.ok:
            return best or found
        best = found
    assert best is not None
    return best


def _seen_from(found: Alignment, camera: Camera) -> Alignment:
    """Count how far an alignment moved from another camera, and give that camera's picture size."""
    corrected = Camera(camera.pinhole, found.camera.world_from_cam)
    if not found.ok:
        return replace(found, camera=camera)
    moved_m, turned_rad = apart(camera, corrected)
    if moved_m > MAX_MOVE_M or turned_rad > MAX_TURN_RAD:
        return replace(
            found, camera=camera, covariance=prior_covariance(), failure="too-far", moved_m=0.0,
            turned_rad=0.0,
        )  # fmt: skip
    return replace(found, camera=corrected, moved_m=moved_m, turned_rad=turned_rad)


def apart(a: Camera, b: Camera) -> tuple[float, float]:
    """Return how far two cameras are apart: metres, and radians of turn."""
    move_m = float(np.linalg.norm(a.position_m - b.position_m))
    return move_m, _angle_rad(a.world_from_cam.rotation.T @ b.world_from_cam.rotation)


def _angle_rad(rotation: Float64[np.ndarray, "3 3"]) -> float:
    # By the sine of the half angle, which is exact for small ones too.
    half = np.linalg.norm(rotation - np.eye(3)) / math.sqrt(8.0)
    return 2.0 * math.asin(min(float(half), 1.0))


def _judged(solution: Solution, camera: Camera) -> Alignment:
    """Believe what was found, or say why not."""
    move_m = float(np.linalg.norm(solution.translation_m))
    turn_rad = _angle_rad(solution.rotation)
    covariance = np.linalg.inv(solution.information)
    failure = _failure(solution, move_m, turn_rad, covariance)
    if failure is not None:
        share, count = solution.agreeing, solution.num_pixels
        return Alignment(camera, prior_covariance(), share, count, failure, 0.0, 0.0)
    live_from_cam: Rigid[Cam, Cam] = Rigid(solution.rotation, solution.translation_m)
    world_from_live = Rigid.from_matrix(
        (camera.world_from_cam @ live_from_cam.inverse()).matrix()  # orthonormal to the last bit
    )
    return Alignment(
        Camera(camera.pinhole, world_from_live),
        covariance,
        solution.agreeing,
        solution.num_pixels,
        None,
        move_m,
        turn_rad,
    )


def _failure(
    solution: Solution,
    move_m: float,
    turn_rad: float,
    covariance: Float64[np.ndarray, "6 6"],
) -> Failure | None:
    if solution.num_pixels < MIN_PIXELS:
        return "too-few-pixels"
    if not (move_m <= MAX_MOVE_M and turn_rad <= MAX_TURN_RAD):
        return "too-far"
    still_m = np.linalg.norm(solution.last_step[:3])
    still_rad = np.linalg.norm(solution.last_step[3:])
    if not (still_m <= MAX_LAST_MOVE_M and still_rad <= MAX_LAST_TURN_RAD):
        return "not-converged"
    if solution.agreeing < MIN_AGREEING or solution.correlation < MIN_CORRELATION:
        return "too-different"
    prior_sd = np.sqrt(np.diag(prior_covariance()))
    learned = np.linalg.eigvalsh(covariance / np.outer(prior_sd, prior_sd))[0]
    if math.sqrt(max(float(learned), 0.0)) > MIN_LEARNED:
        return "undetermined"
    as_before = SAME_ERROR * solution.error_before + 1e-9
    return None if solution.error_after <= as_before else "no-better"
