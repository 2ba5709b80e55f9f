"""The same points found in several pictures, whatever their poses say."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from peaking.frame import Frame
from peaking.geometry import Camera

SIDE_PX = 560
"""Longer side at which features are looked for."""
FEATURES = 700
"""Of a picture, at most."""
PARTNERS = 8
"""Pictures that one is matched with, by place; the ones before and after it come on top."""
IN_ORDER = (1, 2)
"""Steps in the order of taking to pictures that one is matched with."""
MOST_TURNED = 0.85
"""Least cosine between the directions of partners."""
FARTHEST = 0.5
"""Of partners, over the distance to what is seen."""
RATIO = 0.8
"""Lowe's: of the distances to the best and the second best match."""
WITHIN_PX = 2.0
"""Of an epipolar line, at the size that features are looked for at."""
LEAST_MATCHES = 15
METRES_PER_RAD = 1.0


@dataclass(frozen=True)
class Features:
    """Features of a picture.

    Attributes:
        xy_px: In pixels of the full-size picture.
        descriptors: RootSIFT.
        luma: Brightness around each, 0…255.
        px: What one pixel of the working size is in full-size pixels.
    """

    xy_px: Float64[np.ndarray, "n 2"]
    descriptors: Float32[np.ndarray, "n 128"]
    luma: Float64[np.ndarray, "n"]
    px: float


@dataclass(frozen=True)
class Pair:
    """Two pictures, and which features of them are the same point."""

    first: int
    second: int
    indices: Int64[np.ndarray, "n 2"]


def features_of(frame: Frame) -> Features:
    """Find features in a picture, where its mask lets."""
    height, width = frame.rgb.shape[:2]
    shrink = min(1.0, SIDE_PX / max(height, width))
    size_px = max(1, round(width * shrink)), max(1, round(height * shrink))
    small = (
        cv2.resize(frame.rgb, size_px, interpolation=cv2.INTER_AREA) if shrink < 1 else frame.rgb
    )
    gray = cv2.cvtColor(small, cv2.COLOR_RGB2GRAY)
    mask = None
    if frame.mask is not None:
        mask = cv2.resize(frame.mask.astype(np.uint8), size_px, interpolation=cv2.INTER_NEAREST)
    keypoints, described = cv2.SIFT_create(FEATURES).detectAndCompute(gray, mask)  # pyright: ignore
    found = cast("Sequence[cv2.KeyPoint]", keypoints)
    if len(found) == 0:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32), np.zeros(0), 1 / shrink)
    xy = np.array([point.pt for point in found], dtype=np.float64)
    descriptors = np.asarray(described, dtype=np.float32)
    root = np.sqrt(descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9))
    smooth = cv2.blur(gray, (9, 9))
    columns, rows = np.clip(xy.round().astype(int), 0, np.array(size_px) - 1).T
    return Features(
        (xy + 0.5) * (width / size_px[0], height / size_px[1]),
        root.astype(np.float32),
        smooth[rows, columns].astype(np.float64),
        1 / shrink,
    )


def matched(first: int, second: int, a: Features, b: Features) -> Pair | None:
    """Match two pictures: both ways, by Lowe's ratio, and along epipolar lines of their own.

    Returns:
        None where too little is found.
    """
    if min(len(a.xy_px), len(b.xy_px)) < LEAST_MATCHES:
        return None
    alike = a.descriptors @ b.descriptors.T
    best = alike.argmax(axis=1)
    rows = np.arange(len(best))
    top = alike[rows, best]
    alike[rows, best] = -1.0
    second_best = alike.max(axis=1)
    alike[rows, best] = top
    back = alike.argmax(axis=0)
    # Distances of unit vectors: 2 - 2 cos.
    clear = (2 - 2 * top) < RATIO**2 * (2 - 2 * second_best)
    kept = np.flatnonzero(clear & (back[best] == rows))
    if len(kept) < LEAST_MATCHES:
        return None
    px = max(a.px, b.px)
    kept = kept[_along_epipolar_lines(a.xy_px[kept] / px, b.xy_px[best[kept]] / px)]
    if len(kept) < LEAST_MATCHES:
        return None
    return Pair(first, second, np.stack([kept, best[kept]], axis=1).astype(np.int64))


def _along_epipolar_lines(
    one: Float64[np.ndarray, "n 2"], other: Float64[np.ndarray, "n 2"]
) -> Bool[np.ndarray, "n"]:
    """Return which matches fit to one motion between two pictures."""
    try:
        _, inliers = cv2.findFundamentalMat(  # pyright: ignore
            one, other, cv2.USAC_MAGSAC, WITHIN_PX, 0.999, 2000
        )
    except cv2.error:  # the pictures are from the same place: there is no line
        return np.linalg.norm(one - other, axis=1) < WITHIN_PX
    chosen = np.asarray(inliers).ravel()
    if len(chosen) != len(one):  # none was found
        return np.zeros(len(one), dtype=np.bool_)
    return chosen.astype(np.bool_)


def partners(cameras: Sequence[Camera], distance_m: float | None) -> list[tuple[int, int]]:
    """Return which pictures to match: spread over those near by place, and in the order of taking.

    Args:
        cameras: In the order of taking.
        distance_m: To what is seen; None where it is not known.
    """
    places = np.array([camera.position_m for camera in cameras])
    forwards = np.array([camera.forward for camera in cameras])
    far_m = FARTHEST * distance_m if distance_m else np.inf
    chosen: set[tuple[int, int]] = set()
    for i in range(len(cameras)):
        away_m = np.linalg.norm(places - places[i], axis=1)
        alike = forwards @ forwards[i]
        metric = away_m + METRES_PER_RAD * np.arccos(np.clip(alike, -1, 1)) * (distance_m or 1.0)
        near = np.flatnonzero((alike > MOST_TURNED) & (away_m < far_m))
        near = near[near != i]
        if len(near) < 3:
            near = np.argsort(metric)[1 : PARTNERS + 1]
        near = near[np.argsort(metric[near])]
        places_in = np.unique(np.linspace(0, len(near) - 1, min(PARTNERS, len(near))).astype(int))
        others = {int(near[place]) for place in places_in}
        others |= {i + step for step in IN_ORDER if i + step < len(cameras)}
        chosen |= {(min(i, other), max(i, other)) for other in others if other != i}
    return sorted(chosen)


@dataclass(frozen=True)
class Tracks:
    """Points that were found in several pictures, an observation a row.

    Attributes:
        track: Which point, 0 … count - 1.
        frame: In which picture.
        xy_px: Where, in pixels of the full-size picture.
        luma: How bright it is there, 0…255.
        count: Of points.
    """

    track: Int64[np.ndarray, "n"]
    frame: Int64[np.ndarray, "n"]
    xy_px: Float64[np.ndarray, "n 2"]
    luma: Float64[np.ndarray, "n"]
    count: int


def joined(features: Sequence[Features], pairs: Iterable[Pair]) -> Tracks:
    """Join matches to tracks; a track that has two points in one picture is left out."""
    starts = np.concatenate([[0], np.cumsum([len(f.xy_px) for f in features])]).astype(np.int64)
    parent = np.arange(int(starts[-1]), dtype=np.int64)

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = int(parent[node])
        return node

    for pair in pairs:
        for a, b in pair.indices:
            one, other = root(int(starts[pair.first] + a)), root(int(starts[pair.second] + b))
            if one != other:
                parent[max(one, other)] = min(one, other)
    roots = np.array([root(node) for node in range(len(parent))], dtype=np.int64)
    frames = np.repeat(np.arange(len(features)), np.diff(starts))
    names, track, sizes = np.unique(roots, return_inverse=True, return_counts=True)
    twice = np.zeros(len(names), dtype=bool)
    order = np.lexsort((frames, track))
    same = (np.diff(track[order]) == 0) & (np.diff(frames[order]) == 0)
    twice[track[order][1:][same]] = True
    good = (sizes[track] > 1) & ~twice[track]
    kept, numbers = np.unique(track[good], return_inverse=True)
    xy_px = np.concatenate([f.xy_px for f in features])
    luma = np.concatenate([f.luma for f in features])
    return Tracks(
        numbers.astype(np.int64), frames[good].astype(np.int64), xy_px[good], luma[good], len(kept)
    )
