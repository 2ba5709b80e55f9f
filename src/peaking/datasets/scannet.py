"""ScanNet as SensReader exports it, and 7-Scenes: a picture, a depth map and a pose of one number.

Poses are camera-to-world, OpenCV axes; where tracking was lost they are infinite, and the frame is
left out (ScanNet/SensReader/python/SensorData.py). The depth camera has intrinsics of its own.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float64

from peaking.datasets.lens import Lens
from peaking.datasets.posed_frames import PosedFrame, PosedRecording, StoredDepth, StoredPicture
from peaking.datasets.text_tables import counted, in_number_order, matrix_of, pose_of_matrix
from peaking.errors import RecordingError
from peaking.geometry import Cam, Pinhole, Rigid, World

NO_BEND = (0.0, 0.0, 0.0, 0.0, 0.0)
UNIT_M = 0.001
_INFINITE = "without a finite pose"
_COLOUR_FROM_DEPTH: Rigid[Cam, Cam] = Rigid(np.eye(3), np.array([-0.024, 0.0, 0.0]))
"""Of 7-Scenes' Kinect: its two cameras are 24 mm apart."""
_SEVEN_SCENES_PX = (640, 480)
_COLOUR_FOCAL_PX, _DEPTH_FOCAL_PX = 525.0, 585.0
"""7-Scenes states 585 for both, which is the depth camera's; pictures fit to 525 (measured on
redkitchen, 525 ± 1)."""


def recognises(path: Path) -> bool:
    """Return whether a folder is an exported scene of ScanNet."""
    return (path / "intrinsic/intrinsic_color.txt").is_file() and (path / "pose").is_dir()


def open_recording(root: Path, *, confined: bool = False) -> PosedRecording:
    """Open an exported scene: color/, depth/, pose/, intrinsic/.

    Args:
        root: The folder.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    within = root if confined else None
    colour = _intrinsics(root / "intrinsic/intrinsic_color.txt", within)
    depth_path = root / "intrinsic/intrinsic_depth.txt"
    depth_k = _intrinsics(depth_path, within) if depth_path.is_file() else None
    pictures = in_number_order([*(root / "color").glob("*.jpg"), *(root / "color").glob("*.png")])
    frames: list[PosedFrame] = []
    for path in pictures:
        pose_path = root / "pose" / f"{path.stem}.txt"
        pose = pose_of_matrix(pose_path, matrix_of(pose_path, 4, 4, within=within))
        if pose is None:
            continue
        picture = StoredPicture.at(path, within=within)
        lens = Lens(_pinhole(colour, picture.size_px), NO_BEND)
        depth = _depth(root / "depth" / f"{path.stem}.png", depth_k, within)
        frames.append(PosedFrame(path.name, picture, lens, pose, depth=depth))
    return _recording(root, "scannet", frames, len(pictures), within)


def recognises_seven_scenes(path: Path) -> bool:
    """Return whether a folder is a sequence of 7-Scenes."""
    return (path / "frame-000000.color.png").is_file() and (
        path / "frame-000000.pose.txt"
    ).is_file()


def open_seven_scenes(root: Path, *, confined: bool = False) -> PosedRecording:
    """Open a sequence: frame-N.color.png, .depth.png and .pose.txt.

    Its poses and depth are the depth camera's; both are moved to the colour camera.

    Args:
        root: The folder.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    within = root if confined else None
    pictures = in_number_order(list(root.glob("frame-*.color.png")))
    width, height = _SEVEN_SCENES_PX
    depth_k = Pinhole(width, height, _DEPTH_FOCAL_PX, _DEPTH_FOCAL_PX, width / 2, height / 2)
    colour_k = Pinhole(width, height, _COLOUR_FOCAL_PX, _COLOUR_FOCAL_PX, width / 2, height / 2)
    frames: list[PosedFrame] = []
    for path in pictures:
        stem = path.name.removesuffix(".color.png")
        pose_path = root / f"{stem}.pose.txt"
        pose = pose_of_matrix(pose_path, matrix_of(pose_path, 4, 4, within=within))
        if pose is None:
            continue
        picture = StoredPicture.at(path, within=within)
        depth_path = root / f"{stem}.depth.png"
        depth = None
        if depth_path.is_file():
            found = StoredDepth.at(depth_path, UNIT_M, within=within)
            depth = StoredDepth.at(
                depth_path,
                UNIT_M,
                pinhole=depth_k.resized(*found.size_px),
                picture_from_depth=_COLOUR_FROM_DEPTH,
                within=within,
            )
        world_from_colour: Rigid[World, Cam] = pose @ _COLOUR_FROM_DEPTH.inverse()
        lens = Lens(colour_k.resized(*picture.size_px), NO_BEND)
        frames.append(PosedFrame(f"{stem}.png", picture, lens, world_from_colour, depth=depth))
    return _recording(root, "7-scenes", frames, len(pictures), within)


def _recording(
    root: Path, name: str, frames: list[PosedFrame], count: int, within: Path | None
) -> PosedRecording:
    if not frames:
        problem = "has no picture" if count == 0 else "has no frame with a finite pose"
        raise RecordingError(root, problem, remedy="export the scene again, with both")
    notes = counted(count - len(frames), _INFINITE)
    return PosedRecording(root.resolve().name, root, name, tuple(frames), tuple(notes), within)


def _intrinsics(path: Path, within: Path | None) -> Float64[np.ndarray, "4"]:
    """Return fx, fy, cx, cy of a 4×4 or 3×3 matrix."""
    try:
        k = matrix_of(path, 4, 4, within=within)
    except RecordingError:
        k = matrix_of(path, 3, 3, within=within)
    if not np.isfinite(k).all() or k[0, 0] <= 0 or k[1, 1] <= 0:
        problem = "need focal lengths > 0"
        raise RecordingError(path, problem, remedy="export the scene again")
    return np.array([k[0, 0], k[1, 1], k[0, 2], k[1, 2]])


def _pinhole(k: Float64[np.ndarray, "4"], size_px: tuple[int, int]) -> Pinhole:
    fx, fy, cx, cy = (float(number) for number in k)
    return Pinhole(*size_px, fx, fy, cx + 0.5, cy + 0.5)  # centres of pixels are at integers


def _depth(
    path: Path, k: Float64[np.ndarray, "4"] | None, within: Path | None
) -> StoredDepth | None:
    if not path.is_file():
        return None
    depth = StoredDepth.at(path, UNIT_M, within=within)
    if k is None:
        return depth
    own = _pinhole(k, depth.size_px)
    return StoredDepth.at(path, UNIT_M, pinhole=own, within=within)
