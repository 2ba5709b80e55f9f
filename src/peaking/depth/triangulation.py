"""Distances from two captured views: matched pixels whose rays meet.

Poses are known in metres (the phone tracks itself), so two views a step apart give distances
without any sensor of depth. Matches are of SIFT features (Lowe 2004), mutual, distinct, and such
that their rays meet.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from peaking.depth.scale_shift import Evidence
from peaking.frame import Frame

FEATURES = 2000
RATIO = 0.8
"""A match must be so much better than the next best (Lowe's ratio)."""

MAX_REPROJECTION_PX = 2.0
MIN_ANGLE_RAD = 0.01
"""Between the two rays; nearly parallel ones meet anywhere."""


def triangulate(frame: Frame, other: Frame) -> Evidence:
    """Return points of `frame` whose distance follows from `other`; often none."""
    points, descriptors = _features(frame.rgb)
    other_points, other_descriptors = _features(other.rgb)
    if min(len(points), len(other_points)) < 2:
        return Evidence.none()
    pairs = _mutual(descriptors, other_descriptors)
    if len(pairs) == 0:
        return Evidence.none()
    return _met(frame, other, points[pairs[:, 0]], other_points[pairs[:, 1]])


def _met(
    frame: Frame,
    other: Frame,
    here_px: Float64[np.ndarray, "n 2"],
    there_px: Float64[np.ndarray, "n 2"],
) -> Evidence:
    """Keep matched points whose rays meet in front of both cameras, at an angle."""
    here, there = frame.camera, other.camera
    starts = here.world_from_cam.translation_m, there.world_from_cam.translation_m
    rays = [
        np.c_[px, np.ones(len(px))]
        @ camera.pinhole.cam_from_px.T
        @ camera.world_from_cam.rotation.T
        for px, camera in ((here_px, here), (there_px, there))
    ]
    # Where the rays are closest: a (r·r) - b (r·s) = r·t and a (r·s) - b (s·s) = s·t.
    r, s = rays
    t = starts[1] - starts[0]
    rr, rs, ss = (r * r).sum(1), (r * s).sum(1), (s * s).sum(1)
    rt, st = r @ t, s @ t
    determinant = rr * ss - rs**2
    with np.errstate(divide="ignore", invalid="ignore"):
        a = (rt * ss - st * rs) / determinant
        b = (rt * rs - st * rr) / determinant
        angle = np.arcsin(np.sqrt(np.clip(determinant / (rr * ss), 0, 1)))
    good = (angle > MIN_ANGLE_RAD) & (a > 1e-3) & (b > 1e-3) & np.isfinite(a) & np.isfinite(b)
    if not good.any():
        return Evidence.none()
    middle = (starts[0] + a[good, None] * r[good] + starts[1] + b[good, None] * s[good]) / 2
    errors = np.maximum(
        _reprojection_px(middle, frame, here_px[good]),
        _reprojection_px(middle, other, there_px[good]),
    )
    kept = errors < MAX_REPROJECTION_PX
    depth_m = here.world_from_cam.inverse().apply(middle[kept])[:, 2]
    return Evidence(here_px[good][kept][depth_m > 0], 1.0 / depth_m[depth_m > 0])


def _reprojection_px(
    points_m: Float64[np.ndarray, "n 3"], frame: Frame, seen_px: Float64[np.ndarray, "n 2"]
) -> Float64[np.ndarray, "n"]:
    """Return how far from where they were seen points project; NaN for those behind."""
    return np.linalg.norm(frame.camera.project(points_m)[0] - seen_px, axis=1)


def _features(
    rgb: UInt8[np.ndarray, "h w 3"],
) -> tuple[Float64[np.ndarray, "n 2"], np.ndarray]:
    """Return where features are (corner origin) and what they look like."""
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    found, descriptors = cv2.SIFT.create(FEATURES).detectAndCompute(grey, np.ones_like(grey))
    if len(found) == 0:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    return np.array([point.pt for point in found]) + 0.5, np.asarray(descriptors, np.float32)


def _mutual(descriptors: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return pairs of indices that choose each other, distinctly."""
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    there = matcher.knnMatch(descriptors, others, k=2)
    back = {m[0].queryIdx: m[0].trainIdx for m in matcher.knnMatch(others, descriptors, k=1) if m}
    pairs = [
        (best.queryIdx, best.trainIdx)
        for best, second in (match for match in there if len(match) == 2)
        if best.distance < RATIO * second.distance and back.get(best.trainIdx) == best.queryIdx
    ]
    return np.array(pairs, dtype=int).reshape(-1, 2)
