"""Pictures that stand for a replay: its worst frames and some ordinary ones."""

from __future__ import annotations

import heapq
import statistics
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from jaxtyping import UInt8

from peaking.output import encode_jpeg
from peaking.replay.overlay_video import Panels
from peaking.replay.records import FrameRecord

JPEG_STEPS = ((640, 88), (640, 78), (512, 72), (400, 65), (320, 55), (240, 45))
"""Longer side in pixels and quality, tried in this order until the pictures fit the report."""

CANDIDATES = 12
"""Ordinary frames kept while walking; up to twice as many in between."""

SPARE = 3
"""Bad frames kept for every one that is picked, to pick such that do not look the same."""

GAP_SHARE = 0.05
"""Part of the recording that is to lie between two of the worst, where there are enough."""


@dataclass(frozen=True)
class Still:
    """What was shown for one frame; all three of the same size."""

    index: int
    live: UInt8[np.ndarray, "h w 3"]
    rendering: UInt8[np.ndarray, "h w 3"]
    peaks: UInt8[np.ndarray, "h w 3"]
    kind: Literal["worst", "typical"]


_Kept = tuple[float, int, Panels]
"""Share, minus the index, pictures."""


class StillPicker:
    """Picks stills while the frames go by, keeping few of them in memory.

    The worst are those of the greatest peaked share, typical ones those nearest to its median.
    The median is known at the end only, so frames at even distances are kept, and every second
    of them is dropped when there are too many.
    """

    def __init__(self, *, worst: int = 4, typical: int = 2) -> None:
        """Say how many to pick."""
        self._num_worst = worst
        self._num_typical = typical
        self._shares: list[float] = []
        self._worst: list[_Kept] = []
        self._ordinary: list[_Kept] = []
        self._every = 1

    def offer(self, record: FrameRecord, panels: Panels) -> None:
        """Look at the next frame; its pictures are copied if they are kept."""
        share = record.peaked_share
        if share is None:
            return
        keep = SPARE * self._num_worst
        is_bad = keep > 0 and (len(self._worst) < keep or share > self._worst[0][0])
        is_due = len(self._shares) % self._every == 0
        self._shares.append(share)
        if not (is_bad or is_due):
            return
        # Of equal frames the earlier is the worse: the heap compares no further than -index.
        kept = (share, -record.index, _copied(panels))
        if is_bad:
            heapq.heappush(self._worst, kept)
            if len(self._worst) > keep:
                heapq.heappop(self._worst)
        if is_due:
            self._ordinary.append(kept)
            if len(self._ordinary) > 2 * CANDIDATES:
                self._ordinary = self._ordinary[::2]
                self._every *= 2

    def stills(self) -> list[Still]:
        """Return the worst, worst first, and then the typical, in the order of the recording."""
        if not self._shares:
            return []
        median = statistics.median(self._shares)
        worst = self._apart(sorted(self._worst, reverse=True))
        taken = {index for _, index, _ in worst}
        ordinary = [entry for entry in self._ordinary if entry[1] not in taken]
        ordinary.sort(key=lambda entry: (abs(entry[0] - median), -entry[1]))
        typical = sorted(ordinary[: self._num_typical], key=lambda entry: -entry[1])
        return [_still(entry, "worst") for entry in worst] + [
            _still(entry, "typical") for entry in typical
        ]

    def _apart(self, candidates: list[_Kept]) -> list[_Kept]:
        """Take the worst first, but prefer such that are not neighbours of one taken."""
        gap = GAP_SHARE * len(self._shares)
        taken: list[_Kept] = []
        for candidate in candidates:
            if all(abs(candidate[1] - other[1]) >= gap for other in taken):
                taken.append(candidate)
        indices = {entry[1] for entry in taken}
        taken += [entry for entry in candidates if entry[1] not in indices]
        return sorted(taken[: self._num_worst], reverse=True)


def _copied(panels: Panels) -> Panels:
    return Panels(panels.live.copy(), panels.rendering.copy(), panels.peaks.copy())


def _still(entry: _Kept, kind: Literal["worst", "typical"]) -> Still:
    _, index, panels = entry
    return Still(-index, panels.live, panels.rendering, panels.peaks, kind)


def encode_stills(stills: list[Still], *, most_bytes: int) -> list[tuple[bytes, bytes, bytes]]:
    """Return live, rendering and peaks of each as JPEG, together at most about `most_bytes`.

    The pictures get smaller and coarser until they fit; the last step is taken as it comes.
    """
    encoded: list[tuple[bytes, bytes, bytes]] = []
    for longer_px, quality in JPEG_STEPS:
        encoded = [
            (
                _jpeg(still.live, longer_px, quality),
                _jpeg(still.rendering, longer_px, quality),
                _jpeg(still.peaks, longer_px, quality),
            )
            for still in stills
        ]
        if sum(len(jpeg) for three in encoded for jpeg in three) <= most_bytes:
            break
    return encoded


def _jpeg(picture: UInt8[np.ndarray, "h w 3"], longer_px: int, quality: int) -> bytes:
    height, width = picture.shape[:2]
    scale = longer_px / max(width, height)
    if scale < 1:
        size = max(1, round(width * scale)), max(1, round(height * scale))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    return encode_jpeg(picture, quality=quality)
