"""What a place is called, unless somebody says otherwise."""

from __future__ import annotations

from pathlib import Path

from peaking.datasets import Recording
from peaking.server.session_log import FILE_NAME, SessionBegun, SessionLog, SessionNamed


def title_of(recording: Recording) -> str:
    """Return a recording's name, or what people called it where it is a session of the server."""
    folder: Path = recording.path if recording.path.is_dir() else recording.path.parent
    title = recording.name
    if not (folder / FILE_NAME).is_file():
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
