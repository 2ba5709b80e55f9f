"""Whether pictures fit to poses and intrinsics, by points found in several pictures.

Where a point lies is told by the rays of all pictures but the one that is asked about: the point
nearest to them in the least-squares sense. How far from it the picture sees the point is its error,
and where the picture has to be moved to see it right is told by PnP.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float64

from peaking.audit.matches import Tracks
from peaking.geometry import Cam, Camera, Rigid, World

ROUNDS = 6
"""Of weighting observations by how well they fit."""
LEAST_PARALLAX = 4e-4
"""Of rays that tell a point: the least eigenvalue of the sum of (I - d dᵀ). Two rays under 1.6°."""
LEAST_POINTS = 15
"""That tell where a picture was taken."""
PNP_PX = 3.0
SCALE_PX = 1.0
"""Errors of about this many pixels of the working size are usual."""


@dataclass(frozen=True)
class FramePose:
    """What the points say of one picture.

    Attributes:
        points: How many tell something.
        error_px: Median distance of points from where the picture sees them, at the working size.
        corrected_px: The same from where PnP puts the picture; None where it puts it nowhere.
        world_from_cam: Where PnP puts it.
        halves: Where PnP puts it by each half of the points: how far apart they are tells how sure
            it is; None where one puts it nowhere.
        moved_m: How far from the recorded pose that is.
        turned_deg: How far turned.
    """

    points: int
    error_px: float | None
    corrected_px: float | None
    world_from_cam: Rigid[World, Cam] | None
    halves: tuple[Rigid[World, Cam], Rigid[World, Cam]] | None
    moved_m: float | None
    turned_deg: float | None


@dataclass(frozen=True)
class Rays:
    """The rays of observations in the world, and what their pixels are worth."""

    origins_m: Float64[np.ndarray, "n 3"]
    directions: Float64[np.ndarray, "n 3"]


def rays_of(cameras: Sequence[Camera], tracks: Tracks) -> Rays:
    """Return where each observation looks."""
    rotations = np.array([c.world_from_cam.rotation for c in cameras])[tracks.frame]
    origins_m = np.array([c.position_m for c in cameras])[tracks.frame]
    k = np.array([[p.fx_px, p.fy_px, p.cx_px, p.cy_px] for p in (c.pinhole for c in cameras)])
    own = k[tracks.frame]
    xy = (tracks.xy_px - own[:, 2:]) / own[:, :2]
    d = np.concatenate([xy, np.ones((len(xy), 1))], axis=1)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return Rays(origins_m, np.einsum("nij,nj->ni", rotations, d))


@dataclass(frozen=True)
class Points:
    """Where the points are, by all rays and, for every observation, by all others.

    Attributes:
        others_m: By the other observations of the point, a row for each observation.
        known: Whether these tell it.
        error_px: Distance of the observation from it, at the working size; NaN where not known.
    """

    others_m: Float64[np.ndarray, "n 3"]
    known: Bool[np.ndarray, "n"]
    error_px: Float64[np.ndarray, "n"]


def points_of(
    cameras: Sequence[Camera], tracks: Tracks, px: Float64[np.ndarray, "frames"]
) -> Points:
    """Find the points, with less weight for observations and pictures that do not fit.

    Args:
        cameras: Of all pictures.
        tracks: What was seen where.
        px: What one pixel of the working size is in full-size pixels, by picture.
    """
    rays = rays_of(cameras, tracks)
    across = np.eye(3) - rays.directions[:, :, None] * rays.directions[:, None, :]
    toward = np.einsum("nij,nj->ni", across, rays.origins_m)
    weight = np.ones(len(tracks.track))
    points = Points(np.zeros((0, 3)), np.zeros(0, bool), np.zeros(0))
    for _ in range(ROUNDS):
        points = _others(cameras, tracks, px, across, toward, weight)
        usual = np.full(len(cameras), np.nan)
        for frame in np.unique(tracks.frame):
            own = points.error_px[(tracks.frame == frame) & points.known]
            usual[frame] = np.median(own) if len(own) >= LEAST_POINTS else np.nan
        middle = max(SCALE_PX, float(np.nanmedian(usual))) if np.isfinite(usual).any() else SCALE_PX
        of_frame = np.where(np.isfinite(usual), usual, middle)[tracks.frame]
        fits = 1 / (1 + (np.nan_to_num(points.error_px, nan=4 * middle) / (2 * middle)) ** 2)
        weight = np.maximum(fits / (1 + (of_frame / (2 * middle)) ** 4), 1e-6)
    return points


def _others(
    cameras: Sequence[Camera],
    tracks: Tracks,
    px: Float64[np.ndarray, "frames"],
    across: Float64[np.ndarray, "n 3 3"],
    toward: Float64[np.ndarray, "n 3"],
    weight: Float64[np.ndarray, "n"],
) -> Points:
    matrix = np.zeros((tracks.count, 3, 3))
    vector = np.zeros((tracks.count, 3))
    np.add.at(matrix, tracks.track, across * weight[:, None, None])
    np.add.at(vector, tracks.track, toward * weight[:, None])
    rest = matrix[tracks.track] - across * weight[:, None, None]
    summed = np.zeros(tracks.count)
    np.add.at(summed, tracks.track, weight)
    most = np.zeros(tracks.count)
    np.maximum.at(most, tracks.track, weight)
    scale = np.maximum(summed[tracks.track] - weight, 1e-9)
    parallax = np.linalg.eigvalsh(rest)[:, 0] / scale * 2
    known = (parallax > LEAST_PARALLAX) & (scale > 0.2 * most[tracks.track])
    safe = np.where(known[:, None, None], rest, np.eye(3))
    others_m = np.linalg.solve(safe, (vector[tracks.track] - toward * weight[:, None])[..., None])[
        ..., 0
    ]
    error_px = _errors_px(cameras, tracks, others_m) / px[tracks.frame]
    known &= np.isfinite(error_px)
    return Points(others_m, known, np.where(known, error_px, np.nan))


def _errors_px(
    cameras: Sequence[Camera], tracks: Tracks, points_m: Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n"]:
    """Return how far points are from where they are seen; NaN behind the camera."""
    rotations = np.array([c.world_from_cam.rotation for c in cameras])[tracks.frame]
    origins_m = np.array([c.position_m for c in cameras])[tracks.frame]
    k = np.array([[p.fx_px, p.fy_px, p.cx_px, p.cy_px] for p in (c.pinhole for c in cameras)])
    own = k[tracks.frame]
    in_cam = np.einsum("nji,nj->ni", rotations, points_m - origins_m)
    z = np.where(in_cam[:, 2] > 0, in_cam[:, 2], np.nan)
    xy = in_cam[:, :2] / z[:, None] * own[:, :2] + own[:, 2:]
    return np.linalg.norm(xy - tracks.xy_px, axis=1)


def pose_of(
    camera: Camera,
    points_m: Float64[np.ndarray, "n 3"],
    xy_px: Float64[np.ndarray, "n 2"],
    px: float,
) -> tuple[Rigid[World, Cam], float] | None:
    """Return where a picture was taken by points that it sees, and their median error there.

    Args:
        camera: Its intrinsics, and its recorded pose.
        points_m: In the world.
        xy_px: Where it sees them.
        px: What one pixel of the working size is.
    """
    if len(points_m) < LEAST_POINTS:
        return None
    center_m = points_m.mean(axis=0)
    k = camera.pinhole.px_from_cam
    found, axis, moved, chosen = cv2.solvePnPRansac(  # pyright: ignore
        points_m - center_m, xy_px, k, None, iterationsCount=300, reprojectionError=PNP_PX * px
    )
    kept = np.zeros(0, np.int64) if not found else np.asarray(chosen, dtype=np.int64).ravel()
    if len(kept) < max(LEAST_POINTS, 0.3 * len(points_m)):
        return None
    axis, moved = cv2.solvePnPRefineLM(  # pyright: ignore
        points_m[kept] - center_m, xy_px[kept], k, None, axis, moved
    )
    rotation = np.asarray(cv2.Rodrigues(axis)[0], dtype=np.float64)
    cam_from_world = Rigid[Cam, World](rotation, np.ravel(moved) - rotation @ center_m)
    world_from_cam = cam_from_world.inverse()
    projected, _ = Camera(camera.pinhole, world_from_cam).project(points_m)
    return world_from_cam, float(np.nanmedian(np.linalg.norm(projected - xy_px, axis=1)) / px)


def frame_poses(
    cameras: Sequence[Camera], tracks: Tracks, px: Float64[np.ndarray, "frames"]
) -> list[FramePose]:
    """Return what the points say of every picture."""
    points = points_of(cameras, tracks, px)
    found: list[FramePose] = []
    for frame, camera in enumerate(cameras):
        own = np.flatnonzero((tracks.frame == frame) & points.known)
        if len(own) < LEAST_POINTS:
            found.append(FramePose(len(own), None, None, None, None, None, None))
            continue
        error_px = float(np.median(points.error_px[own]))
        placed = pose_of(camera, points.others_m[own], tracks.xy_px[own], float(px[frame]))
        if placed is None:
            found.append(FramePose(len(own), error_px, None, None, None, None, None))
            continue
        world_from_cam, corrected_px = placed
        one, other = (
            pose_of(camera, points.others_m[half], tracks.xy_px[half], float(px[frame]))
            for half in (own[::2], own[1::2])
        )
        apart = camera.world_from_cam.inverse() @ world_from_cam
        angle = np.arccos(np.clip((np.trace(apart.rotation) - 1) / 2, -1, 1))
        moved_m = float(np.linalg.norm(apart.translation_m))
        found.append(
            FramePose(
                len(own),
                error_px,
                corrected_px,
                world_from_cam,
                None if one is None or other is None else (one[0], other[0]),
                moved_m,
                float(np.degrees(angle)),
            )
        )
    return found


NEIGHBOURS = 6
"""Pictures from nearby whose corrections tell what is usual there: recorded poses drift slowly."""
