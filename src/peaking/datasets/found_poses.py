"""Recordings of pictures without poses: these are found once, and kept in the user's cache."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import cv2
import msgspec
import numpy as np
from jaxtyping import Float64, UInt8

from peaking.datasets.lens import Lens
from peaking.datasets.posed_frames import PictureSource, PosedFrame, PosedRecording, StoredDepth
from peaking.errors import CamerasNotFound, RecordingError
from peaking.frame import Frame, working_size_px
from peaking.geometry import Cam, Pinhole, Rigid, World
from peaking.output import depth_mm, encode_png
from peaking.poses.structure import Photograph, Placed, Progress, Structure, find_structure

Kept = TypeVar("Kept")

FEATURE_PIXELS = 540 * 960
"""Features are looked for in pictures no larger than this."""
MEDIAN_DEPTH_M = 1.5
"""Pictures do not tell how large things are: what they show is put so far away, in the median."""
LEAST_POINTS = 20
"""A picture that shows fewer points has no place."""
NAMED = 5
DEPTH_PIXELS, DEPTH_UNIT_M = 16_000, 0.001
FOUND, DEPTHS = "found.json", "depths"
AGAIN = (
    "take at least 10 overlapping pictures of one thing with texture, and move sideways between "
    "them instead of turning on the spot"
)


Source = Callable[["FoundFrame"], PictureSource]


class FoundFrame(msgspec.Struct, frozen=True):
    """A picture that was placed, as it is kept."""

    name: str
    size_px: tuple[int, int]
    fx_fy_cx_cy: tuple[float, float, float, float]
    k1_k2_p1_p2_k3: tuple[float, float, float, float, float]
    world_from_cam: list[list[float]]
    points: list[tuple[float, float, float]]
    time_s: float | None = None
    orientation: int = 1
    depth: bool = False
    """Whether a depth map is kept beside it."""


class Found(msgspec.Struct, frozen=True):
    """All that was found, as it is kept."""

    frames: list[FoundFrame]
    notes: list[str]


@dataclass(frozen=True)
class Unplaced:
    """A picture before it is placed.

    Attributes:
        name: Of its file.
        photograph: What is known of it.
        time_s: When it was taken, None: unknown.
        orientation: EXIF's turn of the stored picture.
    """

    name: str
    photograph: Photograph
    time_s: float | None = None
    orientation: int = 1


def find_once(
    folder: Path,
    path: Path,
    pictures: Sequence[Unplaced],
    source: Source,
    *,
    in_order: bool,
) -> None:
    """Place pictures, sweep planes for their depth, and keep both in a folder.

    Args:
        folder: Where; `recording_in` reads it.
        path: The recording, for errors.
        pictures: In the order in which they were taken, or sorted by name.
        source: Returns where the pixels of a picture come from.
        in_order: Neighbours were taken one after the other.

    Raises:
        BackendUnavailable: pycolmap is not installed.
        RecordingError: They cannot be joined.
    """
    from peaking.depth.plane_sweep import plane_sweep_depths_m  # which imports the compiler

    with shown_progress() as progress:
        found = find_poses(path, pictures, in_order=in_order, progress=progress)
        progress("depth", 0, len(found.frames))
        placed = _recording(folder, path, "", found, source)
        (folder / DEPTHS).mkdir()
        kept: list[FoundFrame] = []
        for one, depth_m in zip(found.frames, plane_sweep_depths_m(_small(placed)), strict=True):
            if depth_m.any():
                path = folder / DEPTHS / f"{one.name}.png"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(encode_png(depth_mm(depth_m)))
            kept.append(msgspec.structs.replace(one, depth=bool(depth_m.any())))
    (folder / FOUND).write_bytes(msgspec.json.encode(Found(kept, found.notes)))


def recording_in(
    folder: Path, path: Path, format_name: str, source: Source, *, within: Path | None = None
) -> PosedRecording:
    """Return the recording of pictures whose poses are kept in a folder.

    Args:
        folder: Where.
        path: What errors name.
        format_name: Of the format.
        source: Returns where the pixels of a picture come from.
        within: The folder that no link may lead out of, where files are handed on.

    Raises:
        RecordingError: The folder was damaged.
    """
    found = read_kept(folder / FOUND, Found)
    return replace(_recording(folder, path, format_name, found, source), within=within)


def find_poses(
    path: Path, pictures: Sequence[Unplaced], *, in_order: bool, progress: Progress
) -> Found:
    """Place pictures, at a scale at which what they show is at a sensible distance.

    Args:
        path: The recording, for errors.
        pictures: In the order in which they were taken, or sorted by name.
        in_order: Neighbours were taken one after the other.
        progress: Told how far it is.

    Raises:
        BackendUnavailable: pycolmap is not installed.
        RecordingError: They cannot be joined.
    """
    if len(pictures) < 3:
        problem = f"holds {len(pictures)} pictures from different places; need at least 3"
        raise RecordingError(path, problem, remedy=AGAIN)
    try:
        structure = find_structure(
            [picture.photograph for picture in pictures], in_order=in_order, progress=progress
        )
    except CamerasNotFound as error:
        raise RecordingError(path, f"has no poses, and {error}", remedy=AGAIN) from error
    placed = [
        (picture, place)
        for picture, place in zip(pictures, structure.placed, strict=True)
        if place is not None and _is_sound(place)
    ]
    if len(placed) < 3:
        problem = (
            f"has no poses, and only {len(placed)} of {len(pictures)} pictures could be placed"
        )
        raise RecordingError(path, problem, remedy=AGAIN)
    scale = MEDIAN_DEPTH_M / float(np.median(np.concatenate([_depths(p) for _, p in placed])))
    names = {picture.name for picture, _ in placed}
    lost = [picture.name for picture in pictures if picture.name not in names]
    return Found(
        [_kept(picture, place, scale) for picture, place in placed],
        _notes(lost, len(pictures), structure),
    )


def read_kept(path: Path, kind: type[Kept]) -> Kept:
    """Return what is kept in a file.

    Raises:
        RecordingError: It was damaged.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except (OSError, msgspec.MsgspecError) as error:
        problem = "was damaged in peaking's cache"
        raise RecordingError(path, problem, remedy="remove the folder it is in") from error


def for_features(rgb: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    """Return a picture at the size at which features are looked for, if it is larger."""
    height, width = rgb.shape[:2]
    if width * height <= FEATURE_PIXELS:
        return rgb
    size = working_size_px(width, height, pixels=FEATURE_PIXELS)
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)


@contextlib.contextmanager
def shown_progress() -> Generator[Progress]:
    """Yield what shows in a terminal how far it is, and nothing elsewhere."""
    from tqdm import tqdm

    with tqdm(desc="reading", disable=None, leave=False) as bar:

        def show(what: str, done: int, total: int) -> None:
            bar.set_description(what, refresh=False)
            bar.total = total
            bar.n = done
            bar.refresh()

        yield show


def _recording(
    folder: Path, path: Path, format_name: str, found: Found, source: Source
) -> PosedRecording:
    frames: list[PosedFrame] = []
    for kept in found.frames:
        lens = Lens(Pinhole(*kept.size_px, *kept.fx_fy_cx_cy), kept.k1_k2_p1_p2_k3)
        frames.append(
            PosedFrame(
                kept.name,
                source(kept),
                lens,
                Rigid[World, Cam].from_matrix(np.array(kept.world_from_cam)),
                depth=_depth(folder, kept, lens) if kept.depth else None,
                points_m=_points_of(kept),
                timestamp_s=kept.time_s,
            )
        )
    name = path.resolve().stem if path.is_file() else path.resolve().name
    return PosedRecording(name, path, format_name, tuple(frames), tuple(found.notes))


def _depth(folder: Path, kept: FoundFrame, lens: Lens) -> StoredDepth:
    """Return where a depth map is; it shows what the straight picture shows."""
    size_px = working_size_px(*kept.size_px, pixels=DEPTH_PIXELS)
    path = folder / DEPTHS / f"{kept.name}.png"
    return StoredDepth(path, DEPTH_UNIT_M, size_px, pinhole=lens.pinhole.resized(*size_px))


def _small(recording: PosedRecording) -> list[Frame]:
    return [
        frame.resized(*working_size_px(*frame.camera.pinhole.size_px, pixels=DEPTH_PIXELS))
        for frame in map(recording.read, range(len(recording)))
    ]


def _points_of(kept: FoundFrame) -> Callable[[], Float64[np.ndarray, "n 3"]]:
    return lambda: np.array(kept.points, np.float64).reshape(-1, 3)


def _is_sound(place: Placed) -> bool:
    if Lens(place.pinhole, place.k1_k2_p1_p2_k3).fault is not None:
        return False
    return len(place.points) >= LEAST_POINTS and bool((_depths(place) > 0).mean() > 0.5)


def _depths(place: Placed) -> Float64[np.ndarray, "n"]:
    return place.world_from_cam.inverse().apply(place.points)[:, 2]


def _kept(picture: Unplaced, place: Placed, scale: float) -> FoundFrame:
    k = place.pinhole
    pose = Rigid[World, Cam](
        place.world_from_cam.rotation, scale * place.world_from_cam.translation_m
    )
    return FoundFrame(
        picture.name,
        k.size_px,
        (k.fx_px, k.fy_px, k.cx_px, k.cy_px),
        place.k1_k2_p1_p2_k3,
        pose.matrix().tolist(),
        [(float(x), float(y), float(z)) for x, y, z in scale * place.points],
        picture.time_s,
        picture.orientation,
    )


def _notes(lost: Sequence[str], count: int, structure: Structure) -> list[str]:
    notes = [
        f"poses were found from the pictures ({structure.error_px:.2f} px); their scale is "
        f"unknown: what they show is taken to be {MEDIAN_DEPTH_M} m away in the median, and depth "
        "comes from a plane sweep"
    ]
    if lost:
        more = f" and {len(lost) - NAMED} more" if len(lost) > NAMED else ""
        named = ", ".join(lost[:NAMED]) + more
        notes.append(f"{len(lost)} of {count} pictures could not be placed: {named}")
    return notes
