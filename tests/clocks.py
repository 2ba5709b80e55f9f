"""A clock that tests set."""

from __future__ import annotations


class Clock:
    """Says what it was set to, in seconds since 1970."""

    now_s = 1_700_000_000.0

    def __call__(self) -> float:
        """Return the time."""
        return self.now_s
