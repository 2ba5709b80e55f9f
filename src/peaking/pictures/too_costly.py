"""The refusal of pictures that would take too much memory or time."""

from __future__ import annotations

from peaking.limits import MAX_PIXELS


class TooCostly(ValueError):
    """Decoding a picture would take too much memory or time: the problem, and what to do."""

    def __init__(self, problem: str, *, remedy: str) -> None:
        """Keep both."""
        super().__init__(problem)
        self.remedy = remedy


def check_pixels(width_px: int, height_px: int) -> None:
    """Refuse a picture that is too large.

    Raises:
        TooCostly: It has more than `MAX_PIXELS`.
    """
    if width_px * height_px > MAX_PIXELS:
        raise TooCostly(
            f"has {width_px}x{height_px} pixels, and at most {MAX_PIXELS:,} are read",
            remedy="make it smaller",
        )
