"""What killed the server while it made an MPI: looked at from afar, then not tried again.

A file beside the MPIs counts how often one was begun and not ended. It is not waited for until it
is on the disk: a process that dies leaves it there all the same.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator
from pathlib import Path

from peaking.errors import PeakingError
from peaking.pictures.decoding import decode_elsewhere

MAX_DEATHS = 2


class GaveUp(PeakingError):
    """Making an MPI ended the server before: it is not tried again."""


class Attempts:
    """The attempts of this process to make MPIs. May be used from several threads."""

    def __init__(self) -> None:
        """Begin without any."""
        self._begun: dict[object, Callable[[], Path]] = {}

    @contextlib.contextmanager
    def counted(self, marker: Callable[[], Path], photo: Path) -> Generator[None]:
        """Make an MPI in this block.

        After the server died in it once, the photo is first decoded in a process that may take only
        so much memory and time.

        Args:
            marker: Returns the file that counts, also when its folder was moved meanwhile.
            photo: What the MPI is made of.

        Raises:
            GaveUp: The server died in it twice, or the photo cannot be decoded with bounded memory.
        """
        deaths = _deaths(marker())
        if deaths >= MAX_DEATHS or (deaths and not _can_be_decoded(photo)):
            raise GaveUp(
                "The server stopped when it made this MPI, so it is not tried again. The photo is "
                "saved; undo this view and take another."
            )
        with contextlib.suppress(OSError):  # a full disk is told of by what needs it
            marker().write_bytes(b"x" * (deaths + 1))
        key = object()
        self._begun[key] = marker
        try:
            yield
        finally:
            del self._begun[key]
            marker().unlink(missing_ok=True)

    def forget(self) -> None:
        """Do not count those that are going on: the server ends because it is asked to."""
        for marker in list(self._begun.values()):
            marker().unlink(missing_ok=True)


def _deaths(marker: Path) -> int:
    try:
        return marker.stat().st_size
    except OSError:
        return 0


def _can_be_decoded(photo: Path) -> bool:
    try:
        decode_elsewhere(photo.read_bytes())
    except (OSError, ValueError):
        return False
    return True
