"""Recordings of cameras that a file names, with the pictures that are found by these names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from peaking.datasets.lens import Lens
from peaking.datasets.picture_files import FOLDERS, found_pictures, in_order, mask_of, offset_of
from peaking.datasets.posed_frames import PosedFrame, PosedRecording, StoredPicture
from peaking.datasets.text_tables import counted
from peaking.errors import RecordingError
from peaking.geometry import Cam, Rigid, World


@dataclass(frozen=True)
class NamedCamera:
    """A camera as a file names it.

    Attributes:
        name: Of its picture, perhaps without an ending, or with folders of another machine.
        lens_at: Returns the lens for a picture of some size; raises `RecordingError`.
        world_from_cam: Its pose.
    """

    name: str
    lens_at: Callable[[tuple[int, int]], Lens]
    world_from_cam: Rigid[World, Cam]


@dataclass(frozen=True)
class NamedCameras:
    """What a file says.

    Attributes:
        path: The file.
        format: What people call its format.
        cameras: Those that have poses.
        notes: Sentences about what was left out or guessed.
        tool: What exports such files, for who is to do it again.
    """

    path: Path
    format: str
    cameras: Sequence[NamedCamera]
    notes: Sequence[str]
    tool: str


def recording_of(
    named: NamedCameras, root: Path, images: Path | None, *, confined: bool
) -> PosedRecording:
    """Return the recording of the cameras whose pictures are there.

    Args:
        named: What the file says.
        root: The folder that the file lies in.
        images: The folder of the pictures; else the one in the folder, or itself, that has most.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: No camera has a pose, no picture is there, or one does not fit its camera.
    """
    again = f"export the cameras again from {named.tool}"
    if not named.cameras:
        raise RecordingError(named.path, "has no camera with a pose", remedy=again)
    if images is not None and not images.is_dir():
        raise RecordingError(images, "is not a folder", remedy="name the folder of the pictures")
    folders = [root / name for name in FOLDERS] if images is None else [images]
    names = [camera.name for camera in named.cameras]
    pictures, found = found_pictures(named.path, names, folders)
    kept = [(one, at) for one, at in zip(named.cameras, found, strict=True) if at is not None]
    if not kept:
        problem = f"names {names[0]!r}, and neither it nor any other of its pictures is there"
        remedy = "put them beside it, or name their folder by --images"
        raise RecordingError(named.path, problem, remedy=remedy)
    within = (root if images is None else images) if confined else None
    frames: list[PosedFrame] = []
    for camera, at in kept:
        picture = StoredPicture.at(at, within=within)
        frames.append(
            PosedFrame(
                str(at.relative_to(pictures)),
                picture,
                camera.lens_at(picture.size_px),
                camera.world_from_cam,
                mask=mask_of(at, pictures, [root, *([] if confined else [pictures.parent])]),
            )
        )
    offset_m, said = offset_of([frame.camera for frame in frames])
    moved = [
        replace(frame, world_from_cam=frame.camera.relative_to(offset_m).world_from_cam)
        for frame in frames
    ]
    lost = counted(len(names) - len(kept), f"whose picture is not in {pictures}")
    is_inside = pictures.resolve().is_relative_to(root.resolve())
    return PosedRecording(
        root.resolve().name,
        root,
        named.format,
        in_order(moved),
        (*named.notes, *lost, *said),
        root if confined else None,
        None if is_inside else pictures,
    )
