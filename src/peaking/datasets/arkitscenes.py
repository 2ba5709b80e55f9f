"""ARKitScenes' raw scans: pictures, depth, a .pincam per picture and a trajectory.

lowres_wide.traj has, per line, a time, the rotation (axis times angle) and translation from the
world to the camera, OpenCV axes (apple/ARKitScenes, threedod/…/tenFpsDataLoader.py). Depth is 16
bits, millimetres; confidence 0, 1, 2.
"""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np

from peaking.datasets.lens import Lens
from peaking.datasets.posed_frames import PosedFrame, PosedRecording, StoredDepth, StoredPicture
from peaking.datasets.text_tables import counted, in_number_order, matrix_of, nearest, rows_of
from peaking.errors import RecordingError
from peaking.geometry import Cam, Pinhole, Rigid, World

TRAJECTORY = "lowres_wide.traj"
KINDS = ("wide", "vga_wide", "lowres_wide")
"""Folders of pictures, the best first."""
UNIT_M = 0.001
WITHIN_S = 0.005
"""Between a picture, its pose and its depth: the times in names are rounded to 1 ms."""
_TIME = re.compile(r"_([0-9]+(\.[0-9]+)?)$")


def recognises(path: Path) -> bool:
    """Return whether a folder is a raw scan."""
    return (path / TRAJECTORY).is_file()


def open_recording(root: Path, *, confined: bool = False) -> PosedRecording:
    """Open a scan with the largest pictures that it has.

    Args:
        root: The folder that holds lowres_wide.traj.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    within = root if confined else None
    poses = _poses(root / TRAJECTORY, within)
    times_s = sorted(poses)
    kind = next((kind for kind in KINDS if any((root / kind).glob("*.png"))), None)
    if kind is None:
        folders = ", ".join(f"{kind}/" for kind in KINDS)
        raise RecordingError(root, f"has no pictures ({folders})", remedy="download one of these")
    pictures = in_number_order(list((root / kind).glob("*.png")))
    pinholes = _by_time(list((root / f"{kind}_intrinsics").glob("*.pincam")))
    depths = _by_time(list((root / "lowres_depth").glob("*.png")))
    frames: list[PosedFrame] = []
    for path in pictures:
        time_s = _time_of(path)
        at = None if time_s is None else nearest(times_s, time_s, WITHIN_S)
        if time_s is None or at is None:
            continue
        pincam = _at(pinholes, time_s)
        if pincam is None:
            problem = f"there is no file of intrinsics for {path.name}"
            raise RecordingError(
                root / f"{kind}_intrinsics", problem, remedy="download the intrinsics too"
            )
        picture = StoredPicture.at(path, within=within)
        lens = Lens(_pinhole(pincam, within).resized(*picture.size_px), (0.0, 0.0, 0.0, 0.0, 0.0))
        frames.append(
            PosedFrame(
                path.name,
                picture,
                lens,
                poses[times_s[at]],
                depth=_depth(root, _at(depths, time_s), within),
                timestamp_s=time_s,
            )
        )
    if not frames:
        raise RecordingError(
            root / TRAJECTORY,
            "has no pose at the time of any picture",
            remedy="download both",
        )
    notes = counted(len(pictures) - len(frames), f"without a pose in {TRAJECTORY}")
    return PosedRecording(
        root.resolve().name, root, "arkitscenes", tuple(frames), tuple(notes), within
    )


def _poses(path: Path, within: Path | None) -> dict[float, Rigid[World, Cam]]:
    poses: dict[float, Rigid[World, Cam]] = {}
    for row in rows_of(path, within=within):
        numbers = row.numbers(0, 7)
        if np.isfinite(numbers).all():
            rotation, _ = cv2.Rodrigues(numbers[1:4])
            cam_from_world = Rigid[Cam, World](np.asarray(rotation, dtype=np.float64), numbers[4:7])
            poses[float(numbers[0])] = cam_from_world.inverse()
    return poses


def _time_of(path: Path) -> float | None:
    found = _TIME.search(path.stem)
    return None if found is None else float(found[1])


def _by_time(paths: list[Path]) -> tuple[list[float], list[Path]]:
    timed = sorted((time_s, path) for path in paths if (time_s := _time_of(path)) is not None)
    return [time_s for time_s, _ in timed], [path for _, path in timed]


def _at(timed: tuple[list[float], list[Path]], time_s: float) -> Path | None:
    found = nearest(timed[0], time_s, WITHIN_S)
    return None if found is None else timed[1][found]


def _pinhole(path: Path, within: Path | None) -> Pinhole:
    """Return the intrinsics of a .pincam: width, height, fx, fy, cx, cy (integers are centres)."""
    width, height, fx, fy, cx, cy = (float(v) for v in matrix_of(path, 1, 6, within=within)[0])
    try:
        return Pinhole(round(width), round(height), fx, fy, cx + 0.5, cy + 0.5)
    except (ValueError, OverflowError) as error:
        raise RecordingError(path, str(error), remedy="download the intrinsics again") from error


def _depth(root: Path, path: Path | None, within: Path | None) -> StoredDepth | None:
    if path is None:
        return None
    sure = root / "confidence" / path.name
    return StoredDepth.at(path, UNIT_M, confidence=sure if sure.is_file() else None, within=within)
