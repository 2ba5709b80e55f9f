"""The data set that a session's folder is: transforms.json, and all of it as a zip."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Collection, Generator, Iterable, Iterator
from contextlib import closing
from itertools import chain
from pathlib import Path

import numpy as np

from peaking.errors import RecordingError
from peaking.geometry import OPENCV_FROM_OPENGL
from peaking.pictures.metadata import has_metadata, without_metadata
from peaking.server import wire
from peaking.server.file_answers import OpenFile

EPOCH = (1980, 1, 1, 0, 0, 0)
"""Zip files cannot say less; the same session always gives the same bytes."""


def photo_name(number: int) -> str:
    """Return where the photo of a capture lies, relative to the session's folder."""
    return f"images/{number:06d}.jpg"


def depth_name(number: int) -> str:
    """Return where its depth lies: 16-bit PNG, millimetres."""
    return f"depth/{number:06d}.png"


def points_name(number: int) -> str:
    """Return where its tracked points lie: .ply, metres of the world."""
    return f"points/{number:06d}.ply"


def transforms_json(frames: Iterable[str]) -> bytes:
    """Return nerfstudio's transforms.json of frames as `frame_json` gives them."""
    top = '{\n "camera_model": "OPENCV",\n "depth_unit_scale_factor": 0.001,\n "frames": [\n'
    return (top + ",\n".join(frames) + "\n ]\n}\n").encode()


def frame_json(capture: wire.Capture, files: Collection[str]) -> str:
    """Return a capture, which has these files, as an entry of transforms.json; never changes."""
    frame = _frame(capture)
    number = capture.number
    asides = {"depth_file_path": depth_name(number), "ply_file_path": points_name(number)}
    return json.dumps(frame | {key: name for key, name in asides.items() if name in files})


def _frame(capture: wire.Capture) -> dict[str, object]:
    k = capture.camera.pinhole
    corrected = capture.corrected_world_from_cam
    return {
        "file_path": photo_name(capture.number),
        "w": k.width_px,
        "h": k.height_px,
        "fl_x": k.fx_px,
        "fl_y": k.fy_px,
        "cx": k.cx_px,
        "cy": k.cy_px,
        "transform_matrix": _matrix_opengl(capture.camera.world_from_cam),
        **({} if corrected is None else {"corrected_transform_matrix": _matrix_opengl(corrected)}),
        "timestamp": capture.time_s,
        "capture_id": capture.id,
    }


def _matrix_opengl(world_from_cam: wire.Pose) -> list[list[float]]:
    matrix = np.eye(4)
    matrix[:3] = np.array(world_from_cam).reshape(3, 4)
    return (matrix @ OPENCV_FROM_OPENGL).tolist()


class Outbox(io.RawIOBase):
    """A file that can only be written on, and emptied."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def writable(self) -> bool:
        """Return that it can be written on."""
        return True

    def write(self, data: object, /) -> int:
        """Keep some bytes until they are taken."""
        part = bytes(data)  # type: ignore[call-overload]
        self._parts.append(part)
        return len(part)

    def taken(self) -> bytes:
        """Return what was written since it was last asked."""
        parts, self._parts = self._parts, []
        return b"".join(parts)


def zip_stream(
    files: Iterable[tuple[str, Path | bytes]], folder: Path, *, keep_exif: bool = False
) -> Generator[bytes]:
    """Yield a zip of files, stored as they are: photos do not get smaller.

    A file that vanished meanwhile (an undo) is left out, and so is one that a link leads to from
    outside, and a photo that is so damaged that its metadata cannot be found.

    Args:
        files: Names and contents.
        folder: All of them lie in it.
        keep_exif: Keep the metadata of photos that an earlier version stored with it.
    """
    outbox = Outbox()
    with zipfile.ZipFile(outbox, "w", zipfile.ZIP_STORED) as archive:
        for name, content in files:
            strips = name.endswith(".jpg") and not keep_exif
            parts = _parts(content, folder, strips=strips)
            try:
                first = next(parts, b"")
            except (RecordingError, ValueError):
                continue
            with archive.open(zipfile.ZipInfo(name, EPOCH), "w") as entry:
                for part in chain([first], parts):
                    entry.write(part)
                    yield outbox.taken()
    yield outbox.taken()


def without_stored_metadata(file: OpenFile) -> bytes | None:
    """Return a photo without the metadata that an earlier version stored; None if it has none.

    Raises:
        ValueError: It is damaged.
    """
    stored = file.read()
    return without_metadata(stored) if has_metadata(stored) else None


def _parts(content: Path | bytes, folder: Path, *, strips: bool) -> Iterator[bytes]:
    if isinstance(content, bytes):
        yield content
        return
    with closing(OpenFile(content, within=folder)) as file:
        bare = without_stored_metadata(file) if strips else None
        if bare is None:
            yield from file.parts()
        else:
            yield bare
