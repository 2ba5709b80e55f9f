"""Small sets of Gaussians before a camera."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Camera, Pinhole, Rigid

PINHOLE = Pinhole(36, 28, 30.0, 33.0, 17.0, 15.0)
HERE = Camera(PINHOLE, Rigid.identity())


def cloud(num: int, *, seed: int = 0, sh_degree: int = 1) -> Float64[np.ndarray, "n columns"]:
    """Return parameters of Gaussians about 3 m ahead, of all shapes and colours."""
    rng = np.random.default_rng(seed)
    parameters = np.zeros((num, 23 if sh_degree == 1 else 14))
    parameters[:, :3] = 0.4 * rng.normal(size=(num, 3)) + [0, 0, 3]
    parameters[:, 3:6] = 0.3 * rng.normal(size=(num, 3)) - 1.6
    parameters[:, 6:10] = rng.normal(size=(num, 4))
    parameters[:, 10] = rng.normal(size=num)
    parameters[:, 11:] = 0.3 * rng.normal(size=(num, parameters.shape[1] - 11))
    return parameters


def one(
    *, depth_m: float = 2.0, scale_m: float = 0.1, opacity: float = 0.8
) -> Float64[np.ndarray, "1 14"]:
    """Return one round red Gaussian on the optical axis."""
    row = np.zeros((1, 14))
    row[0, 2] = depth_m
    row[0, 3:6] = np.log(scale_m)
    row[0, 6] = 1
    row[0, 10] = np.log(opacity / (1 - opacity))
    row[0, 11:14] = np.array([0.5, -0.5, -0.5]) / 0.28209479177387814
    return row
