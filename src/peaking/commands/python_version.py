"""Whether this Python has the fixes that a server needs."""

from __future__ import annotations

import sys
from collections.abc import Mapping

from peaking.terminal import say

COOKIES = "a cookie keeps it busy (CVE-2024-7592)"
UNREAD = "whoever does not read what is sent fills its memory (CVE-2024-12254)"
NEEDED: Mapping[tuple[int, int], tuple[int, str]] = {
    (3, 11): (10, COOKIES),
    (3, 12): (9, UNREAD),
    (3, 13): (2, UNREAD),
}
"""The patch level that a server needs, and what goes wrong below it: gh-123067, gh-127655."""


def say_when_outdated(version: tuple[int, int, int] | None = None) -> None:
    """Print a warning when this Python lacks a fix that matters."""
    major, minor, patch = version or sys.version_info[:3]
    needed, reason = NEEDED.get((major, minor), (0, ""))
    if patch < needed:
        say(
            f"Note: Python {major}.{minor}.{patch} lacks fixes of {major}.{minor}.{needed}: "
            f"{reason}. Update Python.",
            problem=True,
        )
