"""Faults of a whole recording: axes read as others, intrinsics of another picture or camera.

Each guess is tried on the same points: how far from them pictures see them, at the working size.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
from jaxtyping import Float64

from peaking.audit.geometry_check import rays_of
from peaking.audit.matches import Tracks
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World

POINTS = 300
"""Tracks that guesses are tried on, the longest first."""
ROUNDS = 3
CLEARLY = 0.6
"""A guess has to have less than so much of the error of what is stated."""
LEAST_ERROR_PX = 0.5
"""Below it nothing is guessed: what is stated fits."""
FOCAL = np.geomspace(0.4, 2.5, 41)
"""Factors of the focal length."""
LEAST_FACTOR = 0.03
"""Of the focal length, that is spoken of."""


@dataclass(frozen=True)
class WholeFault:
    """What is wrong with all of a recording.

    Attributes:
        kind: Of what.
        words: What, and what to do.
        error_px: Of points, as stated.
        mended_px: The same after the remedy.
    """

    kind: str
    words: str
    error_px: float
    mended_px: float


def longest(tracks: Tracks, count: int = POINTS) -> Tracks:
    """Return the tracks with most observations."""
    sizes = np.bincount(tracks.track, minlength=tracks.count)
    kept = np.zeros(tracks.count, dtype=bool)
    kept[np.argsort(-sizes, kind="stable")[:count]] = True
    rows = kept[tracks.track]
    numbers = np.cumsum(kept) - 1
    return Tracks(
        numbers[tracks.track[rows]].astype(np.int64),
        tracks.frame[rows],
        tracks.xy_px[rows],
        tracks.luma[rows],
        int(kept.sum()),
    )


def error_px(cameras: Sequence[Camera], tracks: Tracks, px: Float64[np.ndarray, "frames"]) -> float:
    """Return the median distance of points from where pictures see them, at the working size.

    Behind the camera counts as far away.
    """
    rays = rays_of(cameras, tracks)
    across = np.eye(3) - rays.directions[:, :, None] * rays.directions[:, None, :]
    toward = np.einsum("nij,nj->ni", across, rays.origins_m)
    weight = np.ones(len(tracks.track))
    error = np.zeros(len(tracks.track))
    focal = np.array([c.pinhole.fx_px for c in cameras])[tracks.frame] / px[tracks.frame]
    for _ in range(ROUNDS):
        matrix, vector = np.zeros((tracks.count, 3, 3)), np.zeros((tracks.count, 3))
        np.add.at(matrix, tracks.track, across * weight[:, None, None])
        np.add.at(vector, tracks.track, toward * weight[:, None])
        matrix += 1e-9 * np.eye(3)
        points_m = np.linalg.solve(matrix, vector[..., None])[..., 0][tracks.track]
        away = points_m - rays.origins_m
        along = np.einsum("ni,ni->n", away, rays.directions)
        beside = np.linalg.norm(away - along[:, None] * rays.directions, axis=1)
        error = np.where(along > 0, focal * beside / np.maximum(along, 1e-9), 1e3)
        error = np.minimum(error, 1e3)
        weight = 1 / (1 + (error / max(2.0, 2 * float(np.median(error)))) ** 2)
    return float(np.median(error))


def whole_fault(
    cameras: Sequence[Camera], tracks: Tracks, px: Float64[np.ndarray, "frames"]
) -> WholeFault | None:
    """Return what is wrong with all poses, or all intrinsics; None where what is stated fits."""
    some = longest(tracks)
    if some.count < POINTS // 10:
        return None
    stated_px = error_px(cameras, some, px)
    if stated_px < LEAST_ERROR_PX:
        return None
    axes = [(error_px(turned, some, px), words) for turned, words in _other_axes(cameras)]
    best_px, words = min(axes, key=lambda one: one[0])
    if best_px < CLEARLY * stated_px:
        # Other axes may fit by halves; intrinsics are tried first where they fit as well.
        lens = _other_lens(cameras, some, px, stated_px)
        if lens is not None and lens.mended_px < best_px:
            return lens
        return WholeFault("axes", words, stated_px, best_px)
    return _other_lens(cameras, some, px, stated_px)


def _other_lens(
    cameras: Sequence[Camera],
    tracks: Tracks,
    px: Float64[np.ndarray, "frames"],
    stated_px: float,
) -> WholeFault | None:
    """Return which intrinsics fit better, by trying focal lengths and principal points in turn."""

    def tried(change: Float64[np.ndarray, "3"]) -> float:
        return error_px([_with_lens(camera, change) for camera in cameras], tracks, px)

    change = np.array([1.0, 0.0, 0.0])
    best_px = stated_px
    for factor in FOCAL:
        found_px = tried(np.array([factor, 0.0, 0.0]))
        if found_px < best_px:
            best_px, change = found_px, np.array([factor, 0.0, 0.0])
    step = np.array([0.03, 0.04, 0.04])
    while step[0] > 0.002:
        better = False
        for axis, sign in product(range(3), (1.0, -1.0)):
            trial = change.copy()
            trial[axis] += sign * step[axis]
            if not FOCAL[0] <= trial[0] <= FOCAL[-1]:
                continue
            found_px = tried(trial)
            if found_px < best_px * 0.999:
                best_px, change, better = found_px, trial, True
        if not better:
            step = step / 2
    if best_px > CLEARLY * stated_px:
        return None
    said: list[str] = []
    if abs(change[0] - 1) > LEAST_FACTOR:
        said.append(f"the focal length would fit as {change[0]:.2f} times what is stated")
    if max(abs(change[1]), abs(change[2])) > LEAST_FACTOR:
        said.append(
            f"the principal point would fit {100 * change[1]:+.0f} % of the width and "
            f"{100 * change[2]:+.0f} % of the height from where it is stated"
        )
    if not said:
        return None
    words = " and ".join(said) + "; calibrate again, or export the intrinsics of these pictures"
    return WholeFault("intrinsics", words, stated_px, best_px)


def _with_lens(camera: Camera, change: Float64[np.ndarray, "3"]) -> Camera:
    k = camera.pinhole
    pinhole = Pinhole(
        k.width_px,
        k.height_px,
        k.fx_px * float(change[0]),
        k.fy_px * float(change[0]),
        k.cx_px + float(change[1]) * k.width_px,
        k.cy_px + float(change[2]) * k.height_px,
    )
    return replace(camera, pinhole=pinhole)


def _other_axes(cameras: Sequence[Camera]) -> Iterator[tuple[list[Camera], str]]:
    """Yield the cameras with every other reading of their poses, and what was then wrong."""
    for inverted in (False, True):
        poses = [c.world_from_cam for c in cameras]
        if inverted:
            poses = [
                Rigid[World, Cam](p.rotation.T, -p.rotation.T @ p.translation_m) for p in poses
            ]
        for order in permutations(range(3)):
            for signs in product((1.0, -1.0), repeat=3):
                turned = np.eye(3)[:, list(order)] * np.array(signs)
                mirrored = float(np.linalg.det(turned)) < 0
                if not inverted and np.array_equal(turned, np.eye(3)):
                    continue
                world = np.diag([-1.0, 1.0, 1.0]) if mirrored else np.eye(3)
                read = [
                    Camera(
                        camera.pinhole,
                        Rigid(world @ pose.rotation @ turned, world @ pose.translation_m),
                    )
                    for camera, pose in zip(cameras, poses, strict=True)
                ]
                yield read, _axes_in_words(turned, mirrored, inverted)


def _axes_in_words(turned: np.ndarray, mirrored: bool, inverted: bool) -> str:
    names = ("x", "y", "z")
    parts: list[str] = []
    for column in range(3):
        row = int(np.argmax(np.abs(turned[:, column])))
        parts.append(("-" if turned[row, column] < 0 else "+") + names[row])
    said: list[str] = []
    if inverted:
        said.append("poses are world-to-camera where camera-to-world is expected")
    if mirrored:
        said.append("the world is mirrored (left-handed)")
    usual = np.diag([-1.0, 1.0, 1.0]) if mirrored else np.eye(3)
    if not np.array_equal(turned, usual):
        known = np.array_equal(turned, np.diag([1.0, -1.0, -1.0]))
        said.append(
            "cameras have the axes of the other convention (OpenGL for OpenCV)"
            if known
            else f"the cameras' x, y, z would have to be their {', '.join(parts)}"
        )
    return "; ".join(said) + "; export the poses again with the axes of this format"
