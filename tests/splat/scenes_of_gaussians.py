"""Small sets of Gaussians before a camera."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.splat.columns import (
    LOG_SCALES,
    MEAN_Z,
    MEANS,
    NUM_COLUMNS,
    OPACITY_LOGIT,
    QUAT_W,
    QUATS,
    SH,
    SH0,
)
from peaking.splat.rendering import C0

PINHOLE = Pinhole(36, 28, 30.0, 33.0, 17.0, 15.0)
HERE = Camera(PINHOLE, Rigid.identity())


def cloud(num: int, *, seed: int = 0, sh_degree: int = 1) -> Float64[np.ndarray, "n columns"]:
    """Return parameters of Gaussians about 3 m ahead, of all shapes and colours."""
    rng = np.random.default_rng(seed)
    parameters = np.zeros((num, NUM_COLUMNS[sh_degree]))
    parameters[:, MEANS] = 0.4 * rng.normal(size=(num, 3)) + [0, 0, 3]
    parameters[:, LOG_SCALES] = 0.3 * rng.normal(size=(num, 3)) - 1.6
    parameters[:, QUATS] = rng.normal(size=(num, 4))
    parameters[:, OPACITY_LOGIT] = rng.normal(size=num)
    parameters[:, SH] = 0.3 * rng.normal(size=parameters[:, SH].shape)
    return parameters


def one(
    *, depth_m: float = 2.0, scale_m: float = 0.1, opacity: float = 0.8
) -> Float64[np.ndarray, "1 14"]:
    """Return one round red Gaussian on the optical axis."""
    row = np.zeros((1, NUM_COLUMNS[0]))
    row[0, MEAN_Z] = depth_m
    row[0, LOG_SCALES] = np.log(scale_m)
    row[0, QUAT_W] = 1
    row[0, OPACITY_LOGIT] = np.log(opacity / (1 - opacity))
    row[0, SH0] = np.array([0.5, -0.5, -0.5]) / C0
    return row
