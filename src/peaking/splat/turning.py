"""Gaussians in a world that is turned: places, shapes, and what they show to each side."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float32, Float64

from peaking.splat.gaussians import NUM_COEFFICIENTS, Gaussians
from peaking.splat.rendering import C0, C1


def turned(gaussians: Gaussians, new_from_world: Float64[np.ndarray, "3 3"]) -> Gaussians:
    """Return the same Gaussians in a world with other axes.

    Seen from a camera that is turned with them they look as before.

    Args:
        gaussians: Of any degree.
        new_from_world: A rotation.
    """
    means_m = gaussians.means_m.astype(np.float64) @ new_from_world.T
    return replace(
        gaussians,
        means_m=means_m.astype(np.float32),
        quaternions=_turned_quaternions(gaussians.quaternions, new_from_world),
        sh=_turned_sh(gaussians.sh, new_from_world),
        origin_m=new_from_world @ gaussians.origin_m,
    )


def harmonics(directions: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 16"]:
    """Return the real spherical harmonics of degree 0 to 3, in 3D Gaussian splatting's order.

    Those of the first two degrees are `splat.rendering`'s; KHR_gaussian_splatting lists all of
    them, Condon-Shortley phase included (appendix A).

    Args:
        directions: Of length 1.
    """
    x, y, z = directions.T
    xx, yy, zz = x * x, y * y, z * z
    pi = np.pi
    a2, b2 = np.sqrt(15 / pi) / 2, np.sqrt(5 / pi) / 4
    a3, b3 = np.sqrt(35 / (2 * pi)) / 4, np.sqrt(105 / pi) / 2
    c3, d3 = np.sqrt(21 / (2 * pi)) / 4, np.sqrt(7 / pi) / 4
    columns = [np.full(len(x), C0), -C1 * y, C1 * z, -C1 * x]
    columns += [a2 * x * y, -a2 * y * z, b2 * (2 * zz - xx - yy), -a2 * x * z, a2 / 2 * (xx - yy)]
    columns += [-a3 * y * (3 * xx - yy), b3 * x * y * z, -c3 * y * (4 * zz - xx - yy)]
    columns += [d3 * z * (2 * zz - 3 * xx - 3 * yy), -c3 * x * (4 * zz - xx - yy)]
    columns += [b3 / 2 * z * (xx - yy), -a3 * x * (xx - 3 * yy)]
    return np.stack(columns, axis=1)


def _turned_quaternions(
    quaternions: np.ndarray, rotation: Float64[np.ndarray, "3 3"]
) -> np.ndarray:
    """Return the rotation's quaternion times each (w, x, y, z)."""
    # Of a 4x4 matrix whose largest eigenvector is the quaternion (Bar-Itzhack 2000).
    r = rotation
    k = np.zeros((4, 4))
    k[1:, 1:] = r + r.T - np.trace(r) * np.eye(3)
    k[0, 1:] = k[1:, 0] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    k[0, 0] = np.trace(r)
    w, x, y, z = np.linalg.eigh(k)[1][:, -1]
    times = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return (quaternions.astype(np.float64) @ times.T).astype(np.float32)


def _turned_sh(
    sh: Float32[np.ndarray, "n k 3"], rotation: Float64[np.ndarray, "3 3"]
) -> Float32[np.ndarray, "n k 3"]:
    """Return coefficients that give in a turned direction what these give in the direction.

    Degrees do not mix, so each has a matrix: the one that fits at some directions fits at all.
    """
    directions = np.random.default_rng(0).normal(size=(64, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before, after = harmonics(directions), harmonics(directions @ rotation.T)
    new = sh.copy()
    starts = [0, *NUM_COEFFICIENTS]
    for start, end in pairwise(starts):
        if end <= sh.shape[1]:
            new_from_old = np.linalg.lstsq(after[:, start:end], before[:, start:end], rcond=None)[0]
            band = np.einsum("ij,njc->nic", new_from_old, sh[:, start:end].astype(np.float64))
            new[:, start:end] = band.astype(np.float32)
    return new
