"""The best of some candidates, and what is said of each: of a recording, or of a live session."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float64

from peaking.geometry import Camera
from peaking.options import Options
from peaking.output import encode_jpeg
from peaking.selection.backward_elimination import SAME_PLACE, BackwardElimination
from peaking.selection.blur import relative_to_nearest
from peaking.selection.policy import Candidate, CurvePoint, Worth

LESS_SHARP = 0.8
"""Sharpness relative to frames from nearby below which that is why a frame was left out."""

BLURRED = 0.7
"""The same, below which a frame is called blurred to whoever took it (docs/selecting.md)."""

UNEVEN = 1.3
"""Brightness over that of frames from nearby, or its inverse, at which it is called otherwise
exposed."""

THUMBNAIL_PX = 160
"""Longer side of the small pictures for the report."""

THUMBNAIL_QUALITY = 70

Fault = Literal["blurred", "brighter", "darker"]
"""What is wrong with a frame beside those from nearby."""


@dataclass(frozen=True)
class FrameChoice:
    """What became of a frame.

    Attributes:
        number: Its place in the recording.
        name: Its name there.
        kept: Whether it was chosen.
        reason: Why, or why not.
        sharpness: Relative to frames from nearby; 1 is as sharp as these, None was not looked at.
        worth_db: What a kept view is worth (`Worth.psnr_db`); None where that is not known.
        brightness: Relative to frames from nearby, as `sharpness`.
    """

    number: int
    name: str
    kept: bool
    reason: str
    sharpness: float | None
    worth_db: float | None = None
    brightness: float | None = None

    @property
    def faults(self) -> list[Fault]:
        """What is wrong with the picture."""
        return faults(self.sharpness, self.brightness)


def faults(sharpness: float | None, brightness: float | None) -> list[Fault]:
    """Return what is wrong with a picture that is so sharp and so bright beside its neighbours."""
    found: list[Fault] = []
    if sharpness is not None and sharpness < BLURRED:
        found.append("blurred")
    if brightness is not None and not 1 / UNEVEN < brightness < UNEVEN:
        found.append("brighter" if brightness > 1 else "darker")
    return found


@dataclass(frozen=True)
class Chosen:
    """Which are kept, and how good other numbers of them would be.

    Attributes:
        kept: What each is worth, by number; None where that is not known.
        curve: How good more and more views are.
        same_place: Those that were taken where another was.
    """

    kept: Mapping[int, Worth | None]
    curve: Sequence[CurvePoint]
    same_place: set[int] = field(default_factory=set[int])


def choose_by_pictures(
    numbers: Iterable[int],
    candidate: Callable[[int], Candidate],
    num_views: int | None,
    options: Options,
    looks: Looks,
) -> Chosen:
    """Choose by what view synthesis gets wrong, with our own policy.

    Args:
        numbers: Of the candidates, rising along the path.
        candidate: Returns one of them.
        num_views: How many; None: as many as are worth it.
        options: How views are built and shown.
        looks: Gets a look at each of them.

    Raises:
        ValueError: `num_views` < 1.
    """
    policy = BackwardElimination(num_views, options, with_curve=True)
    same_place: set[int] = set()
    for number in numbers:
        seen = candidate(number)
        if policy.observe(seen).reason == SAME_PLACE:
            same_place.add(number)
        looks.add(seen)
    policy.finish()
    worth = policy.worth
    curve = [point for point in policy.curve if point.num_views > 0]
    return Chosen({number: worth[number] for number in policy.views}, curve, same_place)


class Looks:
    """What is remembered of every candidate that was looked at."""

    def __init__(self, pixels: int, *, with_thumbnails: bool = False) -> None:
        """Look at about so many pixels; keep small pictures too, if asked for."""
        self.thumbnails: dict[int, bytes] = {}
        self._pixels = pixels
        self._with_thumbnails = with_thumbnails
        self._numbers: list[int] = []
        self._cameras: list[Camera] = []
        self._sharpness: list[float] = []
        self._brightness: list[float] = []

    def add(self, candidate: Candidate) -> None:
        """Look at a candidate."""
        frame = candidate.frame(self._pixels)
        if self._with_thumbnails:
            height, width = frame.rgb.shape[:2]
            shrink = min(1.0, THUMBNAIL_PX / max(height, width))
            size_px = max(1, round(width * shrink)), max(1, round(height * shrink))
            small = cv2.resize(frame.rgb, size_px, interpolation=cv2.INTER_AREA)
            jpeg = encode_jpeg(small.astype(np.uint8), quality=THUMBNAIL_QUALITY)
            self.thumbnails[candidate.number] = jpeg
        self._numbers.append(candidate.number)
        self._cameras.append(frame.camera)
        self._sharpness.append(candidate.sharpness())
        self._brightness.append(float(np.mean(frame.rgb)))

    def relative_sharpness(self) -> Float64[np.ndarray, "n"]:
        """Return the sharpness of each over that of those from nearby, in the order of looking."""
        return relative_to_nearest(self._cameras, np.array(self._sharpness))

    def relative_brightness(self) -> Float64[np.ndarray, "n"]:
        """Return the brightness of each over that of those from nearby, in the order of looking."""
        return relative_to_nearest(self._cameras, np.array(self._brightness))

    def choices(self, chosen: Chosen, name: Callable[[int], str]) -> dict[int, FrameChoice]:
        """Return what became of each, by number.

        Args:
            chosen: Which are kept.
            name: Of a number.
        """
        seen = zip(
            self._numbers, self.relative_sharpness(), self.relative_brightness(), strict=True
        )
        return {
            number: _choice(number, name(number), chosen, float(sharp), float(bright))
            for number, sharp, bright in seen
        }


def _choice(number: int, name: str, chosen: Chosen, sharp: float, bright: float) -> FrameChoice:
    if number not in chosen.kept:
        reason = _why_not(sharp, bright, number in chosen.same_place)
        return FrameChoice(number, name, False, reason, sharp, None, bright)
    worth = chosen.kept[number]
    if worth is None:
        return FrameChoice(number, name, True, "covers what no other does", sharp, None, bright)
    return FrameChoice(number, name, True, worth.why, sharp, worth.psnr_db, bright)


def _why_not(sharp: float, bright: float, same_place: bool) -> str:
    if sharp < LESS_SHARP:
        return "less sharp than others from there"
    for wrong in faults(None, bright):
        return f"{wrong} than others from there"
    if same_place:
        return "taken from the same place as another"
    return "the frames kept show the same"
