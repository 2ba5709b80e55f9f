"""Full disks, explained to the photographer; writing itself is `peaking.output`'s."""

from __future__ import annotations

import contextlib
from collections.abc import Generator

from peaking.errors import OutputError, PeakingError
from peaking.output import NO_ROOM


class DiskFull(PeakingError):
    """There is no room on the server's disk; nothing was kept."""


@contextlib.contextmanager
def room_explained() -> Generator[None, None, None]:
    """Turn "no space left" into a sentence for the photographer.

    Raises:
        DiskFull: The block failed for want of room.
    """
    try:
        yield
    except (OSError, OutputError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        if isinstance(cause, OSError) and cause.errno in NO_ROOM:
            raise DiskFull(
                "The server's disk is full; nothing of this was kept there. Free some space: the "
                "phone holds the capture until then."
            ) from error
        raise
