"""Which way is up: of a recording, and in each format."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Camera

Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
AXES: tuple[Axis, ...] = get_args(Axis)

MOST_TILT_DEG = 35.0
"""Photographers hold cameras upright: on average, up is within this of an axis, or is not known."""


def vector_of(axis: Axis) -> Float64[np.ndarray, "3"]:
    """Return an axis as a unit vector."""
    vector = np.zeros(3)
    vector["xyz".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    return vector


def guess_up(cameras: Sequence[Camera]) -> Axis | None:
    """Return the axis of the world that points up in most pictures; None where none does."""
    mean = np.mean([-camera.world_from_cam.rotation[:, 1] for camera in cameras], axis=0)
    length = float(np.linalg.norm(mean))
    best = max(AXES, key=lambda axis: float(mean @ vector_of(axis)))
    cosine = float(mean @ vector_of(best)) / length if length > 0.3 else 0.0
    return best if cosine > np.cos(np.deg2rad(MOST_TILT_DEG)) else None


def turn(up: Axis, to: Axis, *, half_turn: Literal["x", "z"] = "z") -> Float64[np.ndarray, "3 3"]:
    """Return the rotation that takes one axis to another, by the shortest way.

    Args:
        up: The axis that points up.
        to: The axis that is to point up.
        half_turn: About which axis, where they are opposite; about another where it is theirs.
    """
    a, b = vector_of(up), vector_of(to)
    if np.array_equal(a, b):
        return np.eye(3)
    if np.array_equal(a, -b):
        other = {"x": "z", "z": "x"}[half_turn] if up[1] == half_turn else half_turn
        about = np.array([other == "x", False, other == "z"], np.float64)
        return 2 * np.outer(about, about) - np.eye(3)
    about = np.cross(a, b)
    cross = np.array([[0, -about[2], about[1]], [about[2], 0, -about[0]], [-about[1], about[0], 0]])
    return np.eye(3) + cross + cross @ cross
