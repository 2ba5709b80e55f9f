"""What is shown of a capture, as it lies on the disk; all of this is for threads."""

from __future__ import annotations

import contextlib
import logging
import zlib

from starlette.exceptions import HTTPException

from peaking.errors import RecordingError
from peaking.mpi_file import is_sound
from peaking.server import wire
from peaking.server.dataset import without_stored_metadata
from peaking.server.file_answers import OpenFile, Picture
from peaking.server.open_session import OpenSession
from peaking.server.thumbnails import thumbnail

_log = logging.getLogger("peaking.server")


def sound_mpi(session: OpenSession, capture_id: str, version: int) -> OpenFile | None:
    """Open an MPI whose checksum is right; None where it is gone or damaged.

    Raises:
        UnknownCapture: The capture is not here, or was undone meanwhile.
    """
    session.shown_capture(capture_id)
    try:
        file = OpenFile(session.mpi_path(capture_id, version), within=session.folder)
    except RecordingError:
        return None
    try:
        if is_sound(file.parts(), file.size):
            return file
    except OSError:
        _log.warning("the MPI of capture %s cannot be read", capture_id, exc_info=True)
    except BaseException:
        file.close()
        raise
    file.close()
    return None


def shown_photo(session: OpenSession, capture: wire.Capture, keep_exif: bool) -> Picture:
    """Open a photo.

    One that an earlier version stored with metadata loses it here, in memory.

    Raises:
        HTTPException: It is not there, or damaged.
        RecordingError: It cannot be read.
    """
    path = session.photo_path(capture)
    if not path.is_file():
        raise HTTPException(404, "There is no such file.")
    file = OpenFile(path, within=session.folder)
    with contextlib.ExitStack() as unless_shown:
        unless_shown.callback(file.close)
        try:
            bare = None if keep_exif else without_stored_metadata(file)
        except ValueError as error:
            raise HTTPException(500, f"The photo is damaged on the disk: {error}.") from error
        if bare is not None:
            return Picture(bare, zlib.crc32(bare))
        shown = Picture(file, file.checksum())
        unless_shown.pop_all()
        return shown


def shown_thumbnail(session: OpenSession, capture_id: str) -> Picture:
    """Return a capture's thumbnail.

    Raises:
        UnknownCapture: The capture is not here, or was undone.
        RecordingError: Its photo cannot be read.
    """
    data = thumbnail(session, capture_id)
    return Picture(data, zlib.crc32(data))
