"""The data set of a session in a format that others read, as a zip."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Generator, Iterable
from functools import partial
from pathlib import Path

from peaking.datasets.lens import Lens
from peaking.datasets.point_cloud import read_points
from peaking.datasets.posed_frames import PosedFrame, PosedRecording, StoredDepth, StoredPicture
from peaking.errors import OutputError, RecordingError
from peaking.export.datasets import write_dataset
from peaking.export.material import Material
from peaking.export.names import DatasetFormat
from peaking.server.dataset import (
    EPOCH,
    Outbox,
    depth_name,
    photo_name,
    points_name,
)
from peaking.server.open_session import OpenSession
from peaking.server.upload import BadUpload, camera_of_wire

NOTES = "notes.txt"
PART_BYTES = 1 << 16


def converted(
    session: OpenSession,
    files: Iterable[tuple[str, Path | bytes]],
    to: DatasetFormat,
    *,
    keep_exif: bool = False,
) -> tempfile.TemporaryDirectory[str]:
    """Write the captures of a data set in another format, into a folder that is to be removed.

    Captures whose files vanished meanwhile or are damaged are left out.

    Args:
        session: Of the captures.
        files: Of the data set, as `OpenSession.dataset_files` names them.
        to: The format.
        keep_exif: Keep metadata of photos.

    Raises:
        BadUpload: None is left, or the format needs what they have not.
    """
    paths = {name: path for name, path in files if isinstance(path, Path)}
    rest = [(name, data) for name, data in files if name == "selection.csv"]
    frames = _frames(session, paths)
    if not frames:
        raise BadUpload("There is no view to convert.", status=409)
    recording = PosedRecording(
        session.folder.name, session.folder, "session", frames, within=session.folder
    )
    folder = tempfile.TemporaryDirectory(prefix="peaking-download-")
    out = Path(folder.name) / "dataset"
    try:
        material = Material(recording, range(len(recording)), keep_exif=keep_exif)
        exported = write_dataset(material, out, to)
        for name, data in rest:
            if isinstance(data, bytes):
                (out / name).write_bytes(data)
        if exported.notes:
            text = "".join(f"{note}\n" for note in exported.notes)
            (out / NOTES).write_text(text, encoding="utf-8")
    except RecordingError as error:
        folder.cleanup()
        raise BadUpload(f"A view {error.problem}: {error.remedy}.", status=409) from error
    except OutputError as error:
        folder.cleanup()
        raise BadUpload("The server has no room to convert it.", status=507) from error
    except BaseException:
        folder.cleanup()
        raise
    return folder


def zipped_folder(folder: tempfile.TemporaryDirectory[str]) -> Generator[bytes]:
    """Return the parts of a zip of what `converted` wrote; closing them removes that."""
    parts = _zipped(folder)
    next(parts)  # from here on closing it removes the folder
    return parts


def _zipped(folder: tempfile.TemporaryDirectory[str]) -> Generator[bytes]:
    """Yield nothing, then the zip."""
    outbox = Outbox()
    root = Path(folder.name) / "dataset"
    try:
        yield b""
        with zipfile.ZipFile(outbox, "w", zipfile.ZIP_STORED) as archive:
            for path in sorted(one for one in root.rglob("*") if one.is_file()):
                entry_of = zipfile.ZipInfo(path.relative_to(root).as_posix(), EPOCH)
                with (
                    path.open("rb") as file,
                    archive.open(entry_of, "w", force_zip64=True) as entry,
                ):
                    while part := file.read(PART_BYTES):
                        entry.write(part)
                        yield outbox.taken()
        yield outbox.taken()
    finally:
        folder.cleanup()


def _frames(session: OpenSession, paths: dict[str, Path]) -> tuple[PosedFrame, ...]:
    """Return the captures that can be read."""
    frames: list[PosedFrame] = []
    within = session.folder
    for capture in session.captures:
        photo = paths.get(photo_name(capture.number))
        if photo is None:
            continue
        depth = paths.get(depth_name(capture.number))
        points = paths.get(points_name(capture.number))
        camera = camera_of_wire(capture.camera)
        seen = None if points is None else partial(read_points, points, within=within)
        try:
            frames.append(
                PosedFrame(
                    photo.name,
                    StoredPicture.at(photo, within=within),
                    Lens(camera.pinhole, (0.0, 0.0, 0.0, 0.0, 0.0)),
                    camera.world_from_cam,
                    depth=None if depth is None else StoredDepth.at(depth, 0.001, within=within),
                    points_m=seen,
                    timestamp_s=float(capture.time_s),
                )
            )
        except RecordingError:
            continue
    return tuple(frames)
