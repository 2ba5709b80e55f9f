"""The formats of recordings, and which one a path is of."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from peaking.datasets import (
    archive,
    arkitscenes,
    colmap,
    llff,
    metashape,
    nerfstudio,
    photo_folder,
    polycam,
    realityscan,
    record3d,
    scannet,
    stray,
    tum,
    video,
)
from peaking.datasets.archived import ArchivedRecording, named_in
from peaking.datasets.recording import Recording
from peaking.errors import RecordingError

_DEPTH = 3
"""Folders that an archive may have around its recording."""
_MOST_FILES = 1000
"""Of an archive without a folder that is a recording: so many are looked at."""


@dataclass(frozen=True)
class Reading:
    """How a recording is to be read, where looking at the path does not tell.

    Attributes:
        format: Its format's name (`FORMATS`); None: the first that recognises it.
        images: The folder of its pictures, for formats whose pictures may lie elsewhere (COLMAP).
    """

    format: str | None = None
    images: Path | None = None


AS_FOUND = Reading()


@dataclass(frozen=True)
class Format:
    """A format that can be read.

    Attributes:
        name: What people call it, in lower case.
        looks_like: What one sees of it on disk, for who asks why a path is of no format.
        recognises: Whether a path looks like it, at a glance; never raises.
        open: Opens a recording, confined or not; raises `RecordingError` with file, field and
            remedy.
    """

    name: str
    looks_like: str
    recognises: Callable[[Path], bool]
    open: Callable[[Path, Reading, bool], Recording]


def _looked_at(opener: Callable[..., Recording]) -> Callable[[Path, Reading, bool], Recording]:
    """Return how a format is opened that needs nothing but the path."""
    return lambda root, _, confined: opener(root, confined=confined)


FORMATS: Sequence[Format] = (
    Format(
        "nerfstudio",
        "a folder with transforms.json",
        nerfstudio.recognises,
        _looked_at(nerfstudio.open_recording),
    ),
    Format(
        "colmap",
        "a folder with a model, cameras and images, .bin or .txt, perhaps in sparse/0",
        colmap.recognises,
        lambda root, reading, confined: colmap.open_recording(
            root, reading.images, confined=confined
        ),
    ),
    Format(
        "llff",
        "a folder with poses_bounds.npy",
        llff.recognises,
        lambda root, reading, confined: llff.open_recording(
            root, images=reading.images, confined=confined
        ),
    ),
    Format(
        "record3d",
        "an .r3d file",
        record3d.recognises,
        _looked_at(record3d.open_recording),
    ),
    Format(
        "polycam",
        "raw data with keyframes/",
        polycam.recognises,
        _looked_at(polycam.open_recording),
    ),
    Format(
        "stray",
        "a scan of Stray Scanner with rgb.mp4 and odometry.csv",
        stray.recognises,
        _looked_at(stray.open_recording),
    ),
    Format(
        "tum",
        "a folder with rgb.txt and groundtruth.txt",
        tum.recognises,
        _looked_at(tum.open_recording),
    ),
    Format(
        "scannet",
        "an exported scene with color/, depth/, pose/, intrinsic/",
        scannet.recognises,
        _looked_at(scannet.open_recording),
    ),
    Format(
        "7-scenes",
        "a sequence with frame-000000.color.png",
        scannet.recognises_seven_scenes,
        _looked_at(scannet.open_seven_scenes),
    ),
    Format(
        "arkitscenes",
        "a raw scan with lowres_wide.traj",
        arkitscenes.recognises,
        _looked_at(arkitscenes.open_recording),
    ),
    Format(
        "metashape",
        "cameras exported as XML, beside their pictures",
        metashape.recognises,
        lambda root, reading, confined: metashape.open_recording(
            root, images=reading.images, confined=confined
        ),
    ),
    Format(
        "realityscan",
        "camera parameters as CSV beside their pictures, or pictures with .xmp files",
        realityscan.recognises,
        lambda root, reading, confined: realityscan.open_recording(
            root, images=reading.images, confined=confined
        ),
    ),
    Format(
        "video",
        f"a file named {', '.join(video.ENDINGS)}",
        video.recognises,
        _looked_at(video.open_recording),
    ),
    Format(
        "photos",
        "a folder of photos",
        photo_folder.recognises,
        _looked_at(photo_folder.open_recording),
    ),
)
"""Asked in this order."""

NAMES: Sequence[str] = tuple(known.name for known in FORMATS)


def open_recording(
    path: Path | str, reading: Reading = AS_FOUND, *, confined: bool = False
) -> Recording:
    """Open a recording of any format: a folder, a zip of one, or a file.

    Args:
        path: Where it lies.
        reading: How, where looking at the path does not tell.
        confined: Read no file through a link that leaves the recording, now and later: for what is
            handed on to others.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    given = Path(path)
    if not os.path.lexists(given):
        raise RecordingError(given, "does not exist", remedy="name a recording")
    named = _named(given, reading.format)
    if archive.is_archive(given):
        inside = archive.unpacked(given)
        found = _found(inside, named)
        if found is None:
            raise _unknown(given, "holds no recording of a format that is known")
        known, root = found
        with named_in(given, inside):
            return ArchivedRecording(known.open(root, reading, confined), given, inside)
    known = named or _format_of(given)
    if known is None:
        raise _unknown(given, "is no recording of a format that is known")
    return known.open(given, reading, confined)


def _format_of(path: Path) -> Format | None:
    return next((known for known in FORMATS if known.recognises(path)), None)


def _named(path: Path, name: str | None) -> Format | None:
    if name is None:
        return None
    known = next((known for known in FORMATS if known.name == name), None)
    if known is None:
        problem = f"is to be read as {name!r}, which is no format"
        raise RecordingError(path, problem, remedy=f"give one of {', '.join(NAMES)}")
    return known


def _found(inside: Path, named: Format | None) -> tuple[Format, Path] | None:
    """Return the first recording in an unpacked archive: a folder, or else a file that is one."""
    folders = _folders(inside)
    files = [
        file
        for folder in folders
        for file in sorted(folder.iterdir())
        if file.is_file() and not file.name.startswith(".")
    ]
    for path in [*folders, *files[:_MOST_FILES]]:
        known = named or _format_of(path)
        if known is not None and known.recognises(path):
            return known, path
    return None


def _folders(root: Path) -> list[Path]:
    """Return a folder and those in it, the upper ones first, as deep as is looked."""
    found, level = [root], [root]
    for _ in range(_DEPTH):
        level = [below for above in level for below in sorted(above.iterdir()) if below.is_dir()]
        found += level
    return found


def _unknown(path: Path, problem: str) -> RecordingError:
    kinds = "; ".join(f"{known.name} ({known.looks_like})" for known in FORMATS)
    return RecordingError(path, problem, remedy=f"give one of these: {kinds}")
