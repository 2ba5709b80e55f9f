"""Which pictures of a recording are not as they should be, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float64

from peaking.audit.contents_check import Surprise, surprises
from peaking.audit.geometry_check import NEIGHBOURS, FramePose, frame_poses
from peaking.audit.matches import Features, Pair, features_of, joined, matched, partners
from peaking.audit.pictures_check import DARK, DARK_BRIGHTEST, Look, gains, look_at, twins
from peaking.audit.whole_recording import WholeFault, whole_fault
from peaking.best_frames.choosing import BLURRED
from peaking.datasets import Recording
from peaking.datasets.depth_unit import typical_distance
from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Rigid, World
from peaking.selection.blur import relative_to_nearest

UNEVEN = 1.25
"""Brightness of points over that in other pictures, or its inverse."""
CLIPPED_SHARE, CLIPPED_MORE = 0.12, 3.0
"""Of a picture that is white; and over what is usual in the recording."""
UNLIKE = 9.0
"""A pose is off when it differs from those nearby by so many times what is usual."""
LEAST_OFF_PX = 0.8
"""And moves things by so many pixels of the working size."""
FLOOR_PX, FLOOR_OF_ERROR = 0.12, 0.11
"""Usual differences are taken to be at least this large, or this part of the usual error of points:
recorded poses whose points do not fit well tell less."""
SWAPPED_WITHIN = 0.2
"""Of the way between two pictures' poses: nearer to the other's one counts as there."""
BLOB_SHARE, BLOB_MORE = 0.01, 3.0
"""Of a picture that others do not show, in one patch; and over the 75th percentile of all."""
ASKED_AGAIN = 40
"""Pictures, at even steps, that one is matched with that fits nowhere."""

UNMATCHABLE = ("blurred", "dark", "clipped")
"""Pictures of which one need not say that they match no other."""

Progress = Callable[[Sequence[int], str], Iterable[int]]


@dataclass(frozen=True)
class Finding:
    """What is wrong with a picture.

    Attributes:
        frame: Its number.
        kind: In a word: blurred, dark, clipped, exposure, pose, swapped, lost, moved, duplicate.
        words: What, with figures, and what it means.
        severity: How far beyond the limit; 1 is at it.
    """

    frame: int
    kind: str
    words: str
    severity: float


@dataclass(frozen=True)
class Examination:
    """What was found.

    Attributes:
        findings: About single pictures, in their order.
        whole: About all of the recording; None where nothing is.
        not_checked: Sentences about what could not be looked at.
        poses: What points say of every picture's pose.
        surprises: What others do not show of each picture, by number.
    """

    findings: Sequence[Finding]
    whole: WholeFault | None
    not_checked: Sequence[str] = ()
    poses: Sequence[FramePose] = ()
    surprises: Mapping[int, Surprise] = field(default_factory=dict[int, Surprise])

    def of(self, frame: int) -> list[Finding]:
        """Return what is wrong with one picture."""
        return [finding for finding in self.findings if finding.frame == frame]


def _quietly(numbers: Sequence[int], _: str) -> Iterable[int]:
    return numbers


def examine(recording: Recording, *, progress: Progress = _quietly) -> Examination:
    """Look at every picture of a recording.

    Args:
        recording: Of any format, with or without depth.
        progress: Is given numbers of frames and what is done with them, and yields them.

    Raises:
        RecordingError: A frame cannot be read.
    """
    read = lru_cache(maxsize=4)(recording.read)
    looks: list[Look] = []
    features: list[Features] = []
    for number in progress(range(len(recording)), "looking"):
        frame: Frame = read(number)
        looks.append(look_at(frame))
        features.append(features_of(frame))
    cameras = recording.cameras
    px = np.array([found.px for found in features])
    distance_m = typical_distance(cameras, read) if len(cameras) > 1 else None
    asked = partners(cameras, distance_m)
    pairs = _matched_all(features, asked, lambda numbers: progress(numbers, "matching"))
    tracks = joined(features, pairs)
    whole = whole_fault(cameras, tracks, px)
    not_checked: list[str] = []
    poses: list[FramePose] = []
    findings = _looks(cameras, looks, gains(tracks, len(cameras)))
    if whole is not None:
        not_checked.append("single poses and contents: first mend what is wrong with all")
        return Examination(_in_order(findings), whole, not_checked)
    distance_m = distance_m or _spread_m(cameras)
    poses = frame_poses(cameras, tracks, px)
    astray = _astray(cameras, poses, distance_m, px)
    asking = sorted({*astray, *(i for i, pose in enumerate(poses) if pose.halves is None)})
    if asking:
        more = _asked_again(asking, len(cameras), set(asked))
        pairs += _matched_all(features, more, lambda numbers: progress(numbers, "matching again"))
        tracks = joined(features, pairs)
        poses = frame_poses(cameras, tracks, px)
        again = _astray(cameras, poses, distance_m, px)
        astray = {frame: again.get(frame, off) for frame, off in astray.items()} | again
    findings += _poses(recording, poses, astray, distance_m)
    dim = {finding.frame for finding in findings if finding.kind in UNMATCHABLE}
    alone = set(range(len(cameras))) - {i for pair in pairs for i in (pair.first, pair.second)}
    if len(alone) < len(cameras) / 2:
        words = "lost: nothing in it is found in any other picture"
        findings += [Finding(i, "lost", words, 1.0) for i in sorted(alone - dim)]
    shown: dict[int, Surprise] = {}
    spoilt = {finding.frame for finding in findings if finding.kind != "duplicate"}
    if any(recording.has_depth):
        shown = surprises(
            recording, spoilt, progress=lambda numbers: progress(numbers, "predicting")
        )
        explained = {f.frame for f in findings if f.kind != "exposure"}
        unlike = _unlike({i: one for i, one in shown.items() if i not in explained})
        # What moved in one picture is not shown by it where it was before, in others: those that
        # are unlike only for that are like again when it predicts none.
        shown |= surprises(recording, spoilt | set(unlike), only=unlike)
        rest = {i: one for i, one in shown.items() if i not in explained}
        findings += [_moved(i, shown[i]) for i in _unlike(rest) if i in unlike]
    else:
        not_checked.append("whether something moved: that needs depth")
    return Examination(_in_order(findings), None, not_checked, poses, shown)


def _matched_all(
    features: Sequence[Features],
    asked: Sequence[tuple[int, int]],
    progress: Callable[[Sequence[int]], Iterable[int]],
) -> list[Pair]:
    """Match pairs of pictures, and return those that share something."""
    tried = (
        matched(*asked[number], *(features[i] for i in asked[number]))
        for number in progress(range(len(asked)))
    )
    return [pair for pair in tried if pair is not None]


def _in_order(findings: Sequence[Finding]) -> list[Finding]:
    return sorted(findings, key=lambda finding: (finding.frame, finding.kind))


def _spread_m(cameras: Sequence[Camera]) -> float:
    places = np.array([camera.position_m for camera in cameras])
    return max(1e-6, float(np.linalg.norm(np.ptp(places, axis=0))))


def _looks(
    cameras: Sequence[Camera], looks: Sequence[Look], gain: Float64[np.ndarray, "n"]
) -> list[Finding]:
    """Return what is wrong with pictures by themselves."""
    found: list[Finding] = []
    sharp = relative_to_nearest(cameras, np.array([look.sharpness for look in looks]))
    bright = relative_to_nearest(cameras, np.array([max(look.median, 1.0) for look in looks]))
    usual_clipped = float(np.median([look.clipped_share for look in looks]))
    for i, look in enumerate(looks):
        dark = look.median < DARK and look.brightest < DARK_BRIGHTEST
        if dark:
            words = f"too dark: half of it is below {look.median:.0f} of 255"
            found.append(Finding(i, "dark", words, DARK / max(look.median, 1.0)))
        if look.clipped_share > max(CLIPPED_SHARE, CLIPPED_MORE * usual_clipped):
            words = f"over-exposed: {look.clipped_share:.0%} of it is white"
            found.append(Finding(i, "clipped", words, look.clipped_share / CLIPPED_SHARE))
        # By points that others see too; where these are too few, by the whole picture.
        by = float(gain[i]) if np.isfinite(gain[i]) else float(bright[i])
        if not 1 / UNEVEN < by < UNEVEN:
            word = "brighter" if by > 1 else "darker"
            words = f"exposure: the same things are {word} than in other pictures ({by:.2f} times)"
            found.append(Finding(i, "exposure", words, max(by, 1 / by) / UNEVEN))
        if sharp[i] < BLURRED and not dark:
            words = f"blurred: {sharp[i]:.2f} times as sharp as pictures from nearby"
            found.append(Finding(i, "blurred", words, BLURRED / max(float(sharp[i]), 1e-3)))
    for i, other in twins(cameras, looks).items():
        words = f"shows the same as picture {other}, from the same place"
        found.append(Finding(i, "duplicate", words, 1.0))
    return found


def _astray(
    cameras: Sequence[Camera],
    poses: Sequence[FramePose],
    distance_m: float,
    px: Float64[np.ndarray, "frames"],
) -> dict[int, float]:
    """Return the pictures whose poses do not fit as those nearby do, and by how many times."""
    own, beside = _corrections(cameras, poses, distance_m)
    # What is off as all pictures nearby are is drift; what is right where these are off, is right.
    off = np.minimum(np.abs(own), np.abs(beside))
    focal_px = np.array([c.pinhole.fx_px for c in cameras]) / px
    # Across the picture a turn and a step sideways look alike, at the usual distance: their sum is
    # seen everywhere, a roll or a step forward at the edges, a step sideways by parallax.
    seen_px = np.array([1.0, 1.0, 0.3, 0.3, 0.3, 0.3]) * focal_px[:, None] * off
    usual_px = np.nanmedian(seen_px, axis=0) if np.isfinite(seen_px).any() else np.ones(6)
    errors_px = [pose.error_px for pose in poses if pose.error_px is not None]
    floor_px = max(FLOOR_PX, FLOOR_OF_ERROR * float(np.median(errors_px or [0.0])))
    times = seen_px / np.maximum(usual_px, floor_px)
    return {
        i: float(times[i].max() / UNLIKE)
        for i in range(len(poses))
        if np.isfinite(off[i]).all() and times[i].max() > UNLIKE and seen_px[i].max() > LEAST_OFF_PX
    }


def _corrections(
    cameras: Sequence[Camera], poses: Sequence[FramePose], distance_m: float
) -> tuple[Float64[np.ndarray, "frames 6"], Float64[np.ndarray, "frames 6"]]:
    """Return how each pose is off, and how much more than those from nearby.

    Turn about y with step along x, turn about x with step along y, roll, step forward, steps along
    x and y; radians, or shares of the distance to what is seen, without what both halves of the
    points do not agree on; NaN where it is not known.
    """
    off = np.full((len(cameras), 6), np.nan)
    unsure = np.full((len(cameras), 6), np.nan)
    for i, (camera, pose) in enumerate(zip(cameras, poses, strict=True)):
        if pose.world_from_cam is not None and pose.halves is not None:
            off[i] = _apart(camera, pose.world_from_cam, distance_m)
            one, other = (_apart(camera, half, distance_m) for half in pose.halves)
            unsure[i] = np.abs(one - other)
    places = np.array([camera.position_m for camera in cameras]) / distance_m
    forwards = np.array([camera.forward for camera in cameras])
    beside = off.copy()
    known = np.flatnonzero(np.isfinite(off[:, 0]))
    for i in known:
        away = np.linalg.norm(places[known] - places[i], axis=1)
        away += np.linalg.norm(forwards[known] - forwards[i], axis=1)
        near = known[np.argsort(away, kind="stable")[1 : NEIGHBOURS + 1]]
        if len(near) >= 3:
            beside[i] -= np.median(off[near], axis=0)
    return np.maximum(np.abs(off) - unsure, 0.0), np.maximum(np.abs(beside) - unsure, 0.0)


def _apart(camera: Camera, pose: Rigid[World, Cam], distance_m: float) -> Float64[np.ndarray, "6"]:
    """Return how a camera is off from a pose, as `_corrections` has it."""
    apart = camera.world_from_cam.inverse() @ pose
    x, y, z = np.ravel(cv2.Rodrigues(apart.rotation)[0])
    right, down, on = apart.translation_m / distance_m
    return np.array([y + right, down - x, z, on, right, down])


def _asked_again(
    astray: Sequence[int], count: int, asked: set[tuple[int, int]]
) -> list[tuple[int, int]]:
    """Return pairs of pictures that fit nowhere with others from all over the recording."""
    spread = np.unique(np.linspace(0, count - 1, min(count, ASKED_AGAIN)).round().astype(int))
    near_others = [other + step for other in astray for step in (-2, -1, 1, 2)]
    others = sorted({int(k) for k in spread} | {k for k in near_others if 0 <= k < count})
    pairs = {(min(i, k), max(i, k)) for i in astray[:ASKED_AGAIN] for k in others if i != k}
    return sorted(pairs - asked)


def _poses(
    recording: Recording,
    poses: Sequence[FramePose],
    astray: Mapping[int, float],
    distance_m: float,
) -> list[Finding]:
    """Return what is said of pictures whose poses do not fit."""
    cameras, names = recording.cameras, recording.names
    found: list[Finding] = []
    swapped = _swapped(cameras, poses, astray, distance_m)
    for i, times in astray.items():
        pose = poses[i]
        if i in swapped:
            words = f"swapped with {names[swapped[i]]}: each was taken from the other's pose"
            found.append(Finding(i, "swapped", words, times))
        elif pose.moved_m is not None and pose.turned_deg is not None:
            words = f"pose: was taken {pose.moved_m:.3g} m and {pose.turned_deg:.1f}° from there"
            found.append(Finding(i, "pose", words, times))
    return found


def _swapped(
    cameras: Sequence[Camera],
    poses: Sequence[FramePose],
    astray: Mapping[int, float],
    distance_m: float,
) -> dict[int, int]:
    """Return the pictures that were taken from one another's poses."""

    def apart(one: Camera, pose: FramePose) -> float:
        if pose.world_from_cam is None:
            return np.inf
        away = np.linalg.norm(one.position_m - pose.world_from_cam.translation_m) / distance_m
        return float(away + np.linalg.norm(one.forward - pose.world_from_cam.rotation[:, 2]))

    found: dict[int, int] = {}
    for i in astray:
        own = apart(cameras[i], poses[i])
        for j in astray:
            if j != i and apart(cameras[j], poses[i]) < SWAPPED_WITHIN * own:
                back = apart(cameras[j], poses[j])
                if apart(cameras[i], poses[j]) < SWAPPED_WITHIN * back:
                    found[i] = j
    return found


def _unlike(shown: Mapping[int, Surprise]) -> list[int]:
    """Return the pictures of which others do not show a patch."""
    if not shown:
        return []
    usual = float(np.percentile([surprise.blob_share for surprise in shown.values()], 75))
    limit = max(BLOB_SHARE, BLOB_MORE * usual)
    return [i for i in sorted(shown) if shown[i].blob_share > limit]


def _moved(frame: int, surprise: Surprise) -> Finding:
    words = f"something moved or stood in the way: others do not show {surprise.blob_share:.1%}"
    return Finding(frame, "moved", words, surprise.blob_share / BLOB_SHARE)
