"""What a session of the server has beside pictures: its name, Gaussians trained on it."""

from __future__ import annotations

from pathlib import Path

import msgspec

from peaking.datasets import Recording
from peaking.datasets.foreign_files import open_file, read_bytes
from peaking.errors import RecordingError
from peaking.server import wire
from peaking.server.session_log import FILE_NAME, SessionBegun, SessionLog, SessionNamed
from peaking.server.training import FOLDER, STATUS


class _Status(msgspec.Struct):
    training: wire.Training


def title_of(recording: Recording) -> str:
    """Return a recording's name, or what people called it where it is a session of the server."""
    title, folder = recording.name, _session(recording)
    if folder is None:
        return title
    try:
        events, _ = SessionLog(folder / FILE_NAME).read()
    except OSError:
        return title
    for event in events:
        if isinstance(event, SessionBegun):
            title = event.session.name
        elif isinstance(event, SessionNamed):
            title = event.name
    return title


def trained_in(recording: Recording) -> Path | None:
    """Return the Gaussians that the server trained on a session to the end, if it did.

    Links that lead out of the folder are not followed: the server makes none.
    """
    folder = _session(recording)
    if folder is None:
        return None
    try:
        data = read_bytes(folder / FOLDER / STATUS, within=folder)
        training = msgspec.json.decode(data, type=_Status).training
        path = folder / FOLDER / f"splat-{training.splat_version}.{training.splat_format}"
        open_file(path, within=folder).close()
    except (RecordingError, OSError, msgspec.MsgspecError):
        return None
    return path if training.state == "done" else None


def _session(recording: Recording) -> Path | None:
    """Return the folder of a session; None where the recording is none."""
    folder = recording.path if recording.path.is_dir() else recording.path.parent
    return folder if (folder / FILE_NAME).is_file() else None
