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
from peaking.server.session_files import FOLDERS, KEPT, TRANSFORMS, SessionFiles, size_bytes
from peaking.server.session_log import SessionLog
from peaking.server.session_state import FAST, SessionState


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
    problems: list[str] = []
    for capture in list(state.captures.values()):
        problems += _recover_undo(files, state, log, capture, at_s)
        capture = state.capture(capture.id)
        files.place(capture, state.files(capture))
        _find_mpi(files, state, capture)
    return problems


def _highest(files: SessionFiles, folder: str) -> int:
    """Return the highest number of a file: it is never given again, whatever the log lost."""
    numbers = [path.stem for path in (files.folder / folder).iterdir()]
    return max((int(n) for n in numbers if n.isascii() and n.isdigit()), default=0)


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

    They were written before a crash, nobody was told, and the phone sent them again.
    """
    known = {photo_name(capture.number): capture for capture in state.captures.values()}
    photos = [files.photo(capture) for capture in known.values()]
    for path in (files.folder / "images").iterdir():
        if f"images/{path.name}" in known:
            continue
        size = size_bytes(path)
        again = any(size_bytes(p) == size and p.read_bytes() == path.read_bytes() for p in photos)
        if size and again:
            path.unlink()
            for name in (depth_name(int(path.stem)), points_name(int(path.stem))):
                (files.folder / name).unlink(missing_ok=True)


def _recover_undo(
    files: SessionFiles, state: SessionState, log: SessionLog, capture: wire.Capture, at_s: float
) -> list[str]:
    """Believe the photo's place where the line about it is lost."""
    name = photo_name(capture.number)
    there, aside = (files.folder / name).exists(), (files.folder / "removed" / name).exists()
    if capture.removed or there:
        state.change(capture.id, restorable=capture.restorable and (there or aside))
    elif aside:
        undone = session_log.CaptureRemoved(at_s, id=capture.id)
        log.append(undone)
        state.apply(undone)
    else:
        state.change(capture.id, removed=True, ending="erased", restorable=False)
        return [f"{files.folder / name}: is missing"]
    return []


def _find_mpi(files: SessionFiles, state: SessionState, capture: wire.Capture) -> None:
    """Take the newest MPI on the disk; when it is gone, or of an old format, it is made again.

    Its version stays what it was, so that an address never means something else.
    """
    version = max(capture.mpi_version, 1)
    mpi = files.mpi(capture, version)
    if capture.ending != "erased" and is_current(mpi):
        state.change(
            capture.id,
            state="ready",
            mpi_bytes=mpi.stat().st_size,
            mpi_version=version,
            generator=capture.generator or FAST,
        )
