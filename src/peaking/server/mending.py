"""Finishes, when a session is opened, what a crash interrupted, and finds what a damaged log lost.

The log says what was acknowledged. Where lines of it are lost, the place of a photo and
transforms.json tell the same.
"""

from __future__ import annotations

import contextlib

from peaking.errors import PeakingError
from peaking.mpi_file import is_current
from peaking.server import session_log, wire
from peaking.server.dataset import depth_name, photo_name, points_name
from peaking.server.recovery import recovered_captures
from peaking.server.session_files import (
    FOLDERS,
    KEPT,
    TRANSFORMS,
    SessionFiles,
    number_in,
    size_bytes,
)
from peaking.server.session_log import SessionLog
from peaking.server.session_state import SessionState


def mend(
    files: SessionFiles, state: SessionState, log: SessionLog, *, at_s: float, damaged: bool
) -> list[str]:
    """Make the folder of a session and what is known of it agree.

    Args:
        files: The folder.
        state: What its log says; changed to what is so.
        log: What is found out is noted there.
        at_s: The time now, seconds since 1970.
        damaged: Lines of the log were left out.

    Returns:
        A sentence for each thing that is lost.
    """
    for folder in ("", *FOLDERS):
        (files.folder / folder).mkdir(parents=True, exist_ok=True)
        for leftover in (files.folder / folder).glob(".*.partial*"):
            leftover.unlink()
    state.number = max(state.number, *(_highest(files, f) for f in (*KEPT, "removed/images")))
    if damaged or state.number > len(state.captures):
        _recover_captures(files, state, log, at_s)
        _drop_sent_again(files, state)
    problems = _unknown_photos(files, state)
    for capture in list(state.captures.values()):
        problems += _recover_ending(files, state, log, capture, at_s=at_s, damaged=damaged)
        capture = state.capture(capture.id)
        files.place(capture, state.files(capture))
        _find_mpi(files, state, capture)
    return problems


def _highest(files: SessionFiles, folder: str) -> int:
    """Return the highest number of a file: it is never given again, whatever the log lost."""
    return max((number_in(path) or 0 for path in (files.folder / folder).iterdir()), default=0)


def _recover_captures(
    files: SessionFiles, state: SessionState, log: SessionLog, at_s: float
) -> None:
    """Note captures again whose line in the log is lost, as transforms.json still has them."""
    for stored in recovered_captures(files.folder / TRANSFORMS, at_s=at_s):
        photo = files.folder / photo_name(stored.number)
        if stored.id in state.captures or not photo.exists():
            continue
        with contextlib.suppress(PeakingError, ValueError):
            state.check(stored)
            log.append(stored)
            state.apply(stored)


def _drop_sent_again(files: SessionFiles, state: SessionState) -> None:
    """Delete photos that no capture has and that are another's to the byte.

    They were written before a crash, and the phone sent them again.
    """
    known = {photo_name(capture.number): capture for capture in state.captures.values()}
    photos = [files.photo(capture) for capture in known.values()]
    for path in (files.folder / "images").iterdir():
        number = number_in(path) or 0
        if photo_name(number) in known or photo_name(number) != f"images/{path.name}":
            continue
        size = size_bytes(path)
        again = any(size_bytes(p) == size and p.read_bytes() == path.read_bytes() for p in photos)
        if size and again:
            path.unlink()
            for name in (depth_name(number), points_name(number)):
                (files.folder / name).unlink(missing_ok=True)


def _unknown_photos(files: SessionFiles, state: SessionState) -> list[str]:
    """Return a sentence for each photo whose capture is lost.

    The last one may be of an upload that was cut off, and that the phone sends again.
    """
    numbers = {capture.number for capture in state.captures.values()}
    return [
        f"{path}: the log knows nothing of this photo; it is kept, and not used"
        for path in sorted((files.folder / "images").iterdir())
        if 0 < (number_in(path) or 0) < max(numbers, default=0) and number_in(path) not in numbers
    ]


def _recover_ending(
    files: SessionFiles,
    state: SessionState,
    log: SessionLog,
    capture: wire.Capture,
    *,
    at_s: float,
    damaged: bool,
) -> list[str]:
    """Believe the photo's place where the line about it is lost."""
    name = photo_name(capture.number)
    there, aside = (files.folder / name).exists(), (files.folder / "removed" / name).exists()
    found: session_log.AnyEvent | None = None
    if damaged and capture.restorable and there and not aside:
        found = session_log.CaptureRestored(at_s, id=capture.id)
    elif not capture.removed and aside and not there:
        found = session_log.CaptureRemoved(at_s, id=capture.id)
    if found is not None:
        log.append(found)
        state.apply(found)
    elif capture.restorable and not (there or aside):
        state.change(capture.id, restorable=False)
    elif not capture.removed and not there:
        problem = "The photo is missing on the server's disk."
        state.change(capture.id, removed=True, state="failed", problem=problem)
        return [f"{files.folder / name}: is missing"]
    return []


def _find_mpi(files: SessionFiles, state: SessionState, capture: wire.Capture) -> None:
    """Take the newest MPI of the log; when it is gone, or of an old format, it is made again.

    So is one that the log does not know, since it may be a guess; and it gets another number, so
    that an address never means something else.
    """
    version = capture.mpi_version
    mpi = files.mpi(capture, version)
    if version and capture.ending != "erased" and is_current(mpi):
        state.change(capture.id, state="ready", mpi_bytes=mpi.stat().st_size)
    while files.mpi(state.capture(capture.id), version + 1).exists():
        version += 1
        state.change(capture.id, mpi_version=version)
