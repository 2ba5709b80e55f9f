"""TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt; also ETH3D's, Bonn's and ICL-NUIM's sequences.

Pictures have no poses of their own: each gets one between those of groundtruth.txt before and after
it, and the depth map nearest in time (vision.in.tum.de/data/datasets/rgbd-dataset/file_formats).
Depth is 16 bits, 5000 to the metre, registered to the picture. Intrinsics are not in the format:
those of calibration.txt, if there is one (`fx fy cx cy`), or of the Kinect named by the folder.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float64

from peaking.datasets.lens import Lens
from peaking.datasets.posed_frames import PosedFrame, PosedRecording, StoredDepth, StoredPicture
from peaking.datasets.text_tables import Row, counted, nearest, pose_of_quaternion, rows_of
from peaking.errors import RecordingError
from peaking.geometry import Cam, Pinhole, Rigid, World

PICTURES, DEPTHS, POSES, CALIBRATION = "rgb.txt", "depth.txt", "groundtruth.txt", "calibration.txt"
UNIT_M = 1 / 5000
DEPTH_WITHIN_S = 0.02
"""Between a picture and its depth map, as TUM's associate.py has it."""
POSES_WITHIN_S = 0.1
"""Between the two poses that a picture's is taken from."""

_KINECTS: dict[str, tuple[tuple[float, ...], tuple[float, float, float, float, float]]] = {
    "freiburg1": (
        (517.306408, 516.469215, 318.643040, 255.313989),
        (0.262383, -0.953104, -0.005358, 0.002628, 1.163314),
    ),
    "freiburg2": (
        (520.908620, 521.007327, 325.141442, 249.701764),
        (0.231222, -0.784899, -0.003257, -0.000105, 0.917205),
    ),
    "freiburg3": ((535.4, 539.2, 320.1, 247.6), (0.0, 0.0, 0.0, 0.0, 0.0)),
}
"""fx, fy, cx, cy (OpenCV's pixel origin) and k1, k2, p1, p2, k3 at 640x480, as TUM states them."""
_ANY = ((525.0, 525.0, 319.5, 239.5), (0.0, 0.0, 0.0, 0.0, 0.0))
"""ROS's default for a Kinect, which TUM recommends."""
_KINECT_PX = (640, 480)


def recognises(path: Path) -> bool:
    """Return whether a folder holds the lists of pictures and poses."""
    return (path / PICTURES).is_file() and (path / POSES).is_file()


def open_recording(root: Path, *, confined: bool = False) -> PosedRecording:
    """Open a sequence.

    Args:
        root: The folder.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    within = root if confined else None
    pictures, backwards = _listed(root / PICTURES, within)
    has_depth = (root / DEPTHS).is_file()
    depths, depths_backwards = _listed(root / DEPTHS, within) if has_depth else ([], False)
    poses = _poses(root / POSES, within)
    pose_times, depth_times = [time for time, _ in poses], [time for time, _ in depths]
    calibrated, note = _calibration(root, within)
    frames: list[PosedFrame] = []
    for time_s, name in pictures:
        world_from_cam = _between(poses, pose_times, time_s)
        if world_from_cam is None:
            continue
        picture = StoredPicture.at(_inside(root, PICTURES, name), within=within)
        found = nearest(depth_times, time_s, DEPTH_WITHIN_S)
        depth = None
        if found is not None:
            path = _inside(root, DEPTHS, depths[found][1])
            depth = StoredDepth.at(path, UNIT_M, within=within)
        lens = _lens(calibrated, picture.size_px)
        frames.append(
            PosedFrame(
                Path(name).name, picture, lens, world_from_cam, depth=depth, timestamp_s=time_s
            )
        )
    if not frames:
        raise RecordingError(
            root / POSES, "has no pose at the time of any picture", remedy="check the clocks"
        )
    notes = counted(len(pictures) - len(frames), f"without a pose in {POSES}")
    if backwards or depths_backwards:
        notes.append("time runs backwards in the lists of files: put in order")
    return PosedRecording(root.resolve().name, root, "tum", tuple(frames), (note, *notes), within)


def _listed(path: Path, within: Path | None) -> tuple[list[tuple[float, str]], bool]:
    """Return times and file names in order of time, and whether they had to be put in order."""
    rows = list(rows_of(path, within=within))
    listed = [(_time(row), _word(row, 1)) for row in rows]
    if not listed:
        raise RecordingError(path, "lists no file", remedy="export the sequence again")
    in_order = sorted(listed, key=lambda one: one[0])
    return in_order, in_order != listed


def _time(row: Row) -> float:
    (time_s,) = row.numbers(0, 1)
    if not math.isfinite(time_s):
        raise row.wrong(f"need a time in seconds, got {row.words[0]}")
    return float(time_s)


def _word(row: Row, index: int) -> str:
    if len(row.words) <= index:
        raise row.wrong(f"need {index + 1} values, got {len(row.words)}")
    return row.words[index]


def _inside(root: Path, listed_in: str, name: str) -> Path:
    if name.startswith(("/", "\\")) or ".." in Path(name).parts:
        problem = f"points outside the recording: {name!r}"
        raise RecordingError(root / listed_in, problem, remedy="name files inside the folder")
    return root / name


def _poses(path: Path, within: Path | None) -> list[tuple[float, Rigid[World, Cam]]]:
    poses: list[tuple[float, Rigid[World, Cam]]] = []
    for row in rows_of(path, within=within):
        found = pose_of_quaternion(row, row.numbers(1, 3), row.numbers(4, 4))
        if found is not None:
            poses.append((_time(row), found))
    return sorted(poses, key=lambda pose: pose[0])


def _between(
    poses: Sequence[tuple[float, Rigid[World, Cam]]], times_s: Sequence[float], at_s: float
) -> Rigid[World, Cam] | None:
    """Return the pose at a time, on the way between those before and after it."""
    found = nearest(times_s, at_s, POSES_WITHIN_S)
    if found is None:
        return None
    other = found + 1 if times_s[found] < at_s else found - 1
    (here_s, here), gap_s = poses[found], 0.0
    if 0 <= other < len(poses):
        gap_s = poses[other][0] - here_s
    if gap_s == 0 or abs(gap_s) > POSES_WITHIN_S:
        return here if abs(here_s - at_s) <= DEPTH_WITHIN_S else None
    share, there = (at_s - here_s) / gap_s, poses[other][1]
    turn, _ = cv2.Rodrigues(here.rotation.T @ there.rotation)
    rotation, _ = cv2.Rodrigues(np.asarray(turn, dtype=np.float64) * share)
    position_m = here.translation_m + share * (there.translation_m - here.translation_m)
    return Rigid(here.rotation @ np.asarray(rotation, dtype=np.float64), position_m)


def _calibration(root: Path, within: Path | None) -> tuple[Float64[np.ndarray, "9"] | None, str]:
    """Return fx, fy, cx, cy and five coefficients, or None for the Kinect's; and a note."""
    path = root / CALIBRATION
    if path.is_file():
        for row in rows_of(path, within=within):
            numbers = row.numbers(0, len(row.words))
            if len(numbers) in (4, 8, 9):
                return np.pad(numbers, (0, 9 - len(numbers))), f"intrinsics are {CALIBRATION}'s"
            raise row.wrong("need fx fy cx cy and perhaps k1 k2 p1 p2 k3")
    known = next((name for name in _KINECTS if name in root.resolve().name), None)
    if known is not None:
        k, bends = _KINECTS[known]
        return np.array([*k, *bends]), f"intrinsics are those of {known}'s Kinect"
    return None, (
        "intrinsics are not in the recording: a Kinect's are taken (525 px at 640x480); write "
        f"fx fy cx cy into {CALIBRATION} if they are others"
    )


def _lens(calibrated: Float64[np.ndarray, "9"] | None, size_px: tuple[int, int]) -> Lens:
    numbers = np.array([*_ANY[0], *_ANY[1]]) if calibrated is None else calibrated
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = (float(number) for number in numbers)
    if calibrated is None:
        at = Pinhole(*_KINECT_PX, fx, fy, cx + 0.5, cy + 0.5)
        return Lens(at.resized(*size_px), (k1, k2, p1, p2, k3))
    return Lens(Pinhole(*size_px, fx, fy, cx + 0.5, cy + 0.5), (k1, k2, p1, p2, k3))
