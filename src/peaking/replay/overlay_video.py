"""Draws the pictures of the overlay video: live | rendering | peaks, and below them the past."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from peaking.replay.records import FrameRecord

BACKGROUND = (17, 19, 23)
RAISED = (28, 31, 37)
LINE = (72, 79, 91)
TEXT = (236, 239, 244)
MUTED = (158, 167, 181)
CURVE = (118, 169, 250)
CURVE_FILL = (38, 52, 78)
PEAK = (255, 99, 86)
PEAK_FILL = (110, 44, 44)
SHUTTER = (250, 204, 92)

MARGIN_PX = 16
GAP_PX = 14
CAPTION_PX = 32
STRIP_PX = 72
FOOT_PX = 30
TEXT_PX = 18
FRAME_PX = 3

MAX_WIDTH_PX = 1920
"""Wider videos are beyond what phones decode."""

MIN_PANEL_WIDTH_PX = 240
"""Captions need this much room; smaller pictures are shown enlarged."""


@dataclass(frozen=True)
class Panels:
    """What is shown side by side: three pictures of one size."""

    live: UInt8[np.ndarray, "h w 3"]
    rendering: UInt8[np.ndarray, "h w 3"]
    peaks: UInt8[np.ndarray, "h w 3"]


class OverlayVideo:
    """Draws the frames of one replay, in order.

    It remembers the curve drawn so far, so that a frame costs the same at any length.
    """

    def __init__(
        self, panel_size_px: tuple[int, int], *, frames: int, threshold_share: float
    ) -> None:
        """Lay the picture out.

        Args:
            panel_size_px: Width and height that every picture that will be shown fits into.
            frames: Frames of the whole replay, for the width of the curve.
            threshold_share: Peaked share beyond which frames are captured.
        """
        if frames < 1:
            raise ValueError(f"need at least 1 frame, got {frames}")
        width, height = panel_size_px
        widest = (MAX_WIDTH_PX - 2 * MARGIN_PX - 2 * GAP_PX) / 3
        scale = min(max(1.0, MIN_PANEL_WIDTH_PX / width), widest / width)
        self.panel_size_px = panel_size_px
        self._shown_px = max(1, round(width * scale)), max(1, round(height * scale))
        self._frames = frames
        self._threshold_share = threshold_share
        # A fixed scale: one that follows the values would move the past about.
        self._top_share = max(0.10, 2.5 * threshold_share)
        self._captured = 0
        self._last_point: tuple[int, float] | None = None

        shown_width, shown_height = self._shown_px
        inner = 3 * shown_width + 2 * GAP_PX
        self._strip_top = CAPTION_PX + shown_height + MARGIN_PX
        self.size_px = (
            _even(inner + 2 * MARGIN_PX),
            _even(self._strip_top + STRIP_PX + FOOT_PX),
        )
        self._empty = np.empty((self.size_px[1], self.size_px[0], 3), dtype=np.uint8)
        self._empty[:] = BACKGROUND
        self._canvas = self._empty.copy()
        self._strip = np.empty((STRIP_PX, inner, 3), dtype=np.uint8)
        self._strip[:] = RAISED

    def draw(self, panels: Panels, record: FrameRecord) -> UInt8[np.ndarray, "height width 3"]:
        """Draw the next frame; the picture is valid until the next call.

        Args:
            panels: The three pictures; those smaller than a panel stand in its middle.
            record: The frame; its index says where it stands on the strip.

        Raises:
            ValueError: A picture is larger than a panel.
        """
        for picture in (panels.live, panels.rendering, panels.peaks):
            (height, width), (most_width, most_height) = picture.shape[:2], self.panel_size_px
            if width > most_width or height > most_height:
                raise ValueError(f"need panels of {self.panel_size_px}, got {width}x{height}")
        if record.captured:
            self._captured += 1
        self._extend_strip(record)
        np.copyto(self._canvas, self._empty)
        self._draw_panels(panels, record)
        self._draw_strip(record)
        self._draw_foot(record)
        return self._canvas

    def _draw_panels(self, panels: Panels, record: FrameRecord) -> None:
        share = record.peaked_share
        captions = (
            ("live", ""),
            ("rendering", "" if share is not None else "no view yet"),
            ("peaks", "" if share is None else f"{100 * share:.1f} %"),
        )
        pictures = (panels.live, panels.rendering, panels.peaks)
        width, height = self._shown_px
        for place, (picture, (caption, note)) in enumerate(zip(pictures, captions, strict=True)):
            left = MARGIN_PX + place * (width + GAP_PX)
            shown = _resized(picture, self._shown_size_px(picture))
            below, beside = (height - shown.shape[0]) // 2, (width - shown.shape[1]) // 2
            panel = self._canvas[CAPTION_PX : CAPTION_PX + height, left : left + width]
            panel[below : below + shown.shape[0], beside : beside + shown.shape[1]] = shown
            after = draw_text(self._canvas, caption, (left, CAPTION_PX // 2), color=MUTED)
            if note:
                high = share is not None and share > self._threshold_share
                draw_text(
                    self._canvas, note, (after + 8, CAPTION_PX // 2), color=PEAK if high else TEXT
                )
        if record.captured:
            corner = (MARGIN_PX - FRAME_PX, CAPTION_PX - FRAME_PX)
            far = (MARGIN_PX + width + FRAME_PX - 1, CAPTION_PX + height + FRAME_PX - 1)
            for inset in range(FRAME_PX):
                cv2.rectangle(
                    self._canvas,
                    (corner[0] + inset, corner[1] + inset),
                    (far[0] - inset, far[1] - inset),
                    SHUTTER,
                )
            words, y = "captured", CAPTION_PX // 2
            x = MARGIN_PX + width - text_width_px(words)
            draw_text(self._canvas, words, (x, y), color=SHUTTER)
            _triangle(self._canvas, (x - 12, y + 1), 6)

    def _shown_size_px(self, picture: UInt8[np.ndarray, "h w 3"]) -> tuple[int, int]:
        """Return the size of a picture in its panel; all are scaled alike."""
        (height, width), (most_width, most_height) = picture.shape[:2], self.panel_size_px
        shown_width, shown_height = self._shown_px
        return (
            max(1, round(width * shown_width / most_width)),
            max(1, round(height * shown_height / most_height)),
        )

    def _extend_strip(self, record: FrameRecord) -> None:
        """Draw what this frame adds to the curve."""
        x = self._x_px(record.index)
        share = record.peaked_share
        if share is not None:
            before_x, before = self._last_point or (x, share)
            for column in range(before_x + (before_x < x), x + 1):
                part = 1.0 if x == before_x else (column - before_x) / (x - before_x)
                self._fill_column(column, before + part * (share - before))
            start, end = (before_x, self._y_px(before)), (x, self._y_px(share))
            cv2.line(self._strip, start, end, CURVE, 1, cv2.LINE_AA)
            self._last_point = (x, share)
        if record.captured:
            cv2.line(self._strip, (x, 12), (x, STRIP_PX - 1), SHUTTER, 1)
            _triangle(self._strip, (x, 6), 5)

    def _fill_column(self, x: int, share: float) -> None:
        top, threshold = self._y_px(share), self._y_px(self._threshold_share)
        self._strip[max(top, threshold) :, x] = CURVE_FILL
        self._strip[top:threshold, x] = PEAK_FILL

    def _draw_strip(self, record: FrameRecord) -> None:
        inner = self._strip.shape[1]
        place = self._canvas[
            self._strip_top : self._strip_top + STRIP_PX, MARGIN_PX : MARGIN_PX + inner
        ]
        place[:] = self._strip
        y = self._y_px(self._threshold_share)
        for left in range(0, inner, 10):
            cv2.line(place, (left, y), (min(left + 4, inner - 1), y), PEAK, 1)
        x = self._x_px(record.index)
        cv2.line(place, (x, 0), (x, STRIP_PX - 1), TEXT, 1)
        if record.peaked_share is not None:
            cv2.circle(place, (x, self._y_px(record.peaked_share)), 3, TEXT, -1, cv2.LINE_AA)

    def _draw_foot(self, record: FrameRecord) -> None:
        y = self._strip_top + STRIP_PX + FOOT_PX // 2
        views = "view" if self._captured == 1 else "views"
        state = f"{self._captured} {views}"
        after = draw_text(
            self._canvas, f"frame {record.index + 1} / {self._frames}", (MARGIN_PX, y), color=MUTED
        )
        _triangle(self._canvas, (after + 25, y + 1), 6)
        draw_text(self._canvas, state, (after + 37, y), color=TEXT)
        words = f"threshold {100 * self._threshold_share:.3g} %"
        left = self.size_px[0] - MARGIN_PX - text_width_px(words)
        draw_text(self._canvas, words, (left, y), color=MUTED)
        for dash in (left - 26, left - 17):
            cv2.line(self._canvas, (dash, y), (dash + 5, y), PEAK, 2)

    def _x_px(self, index: int) -> int:
        inner = self._strip.shape[1]
        # Half a triangle of room at both ends.
        return 6 + round(min(index, self._frames - 1) / max(1, self._frames - 1) * (inner - 13))

    def _y_px(self, share: float) -> int:
        room = STRIP_PX - 16
        return STRIP_PX - 2 - round(min(share / self._top_share, 1.0) * room)


def _resized(
    picture: UInt8[np.ndarray, "h w 3"], size_px: tuple[int, int]
) -> UInt8[np.ndarray, "hh ww 3"]:
    if (picture.shape[1], picture.shape[0]) == size_px:
        return picture
    how = cv2.INTER_AREA if size_px[0] < picture.shape[1] else cv2.INTER_LINEAR
    return cv2.resize(picture, size_px, interpolation=how).astype(np.uint8, copy=False)


def _triangle(picture: UInt8[np.ndarray, "h w 3"], center: tuple[int, int], radius: int) -> None:
    """Draw the sign of the shutter, pointing down."""
    x, y = center
    corners = np.array(
        [[x - radius, y - radius + 1], [x + radius, y - radius + 1], [x, y + radius]]
    )
    cv2.fillPoly(picture, [corners.astype(np.int32)], SHUTTER, cv2.LINE_AA)


def draw_text(
    picture: UInt8[np.ndarray, "h w 3"],
    text: str,
    left_middle: tuple[int, int],
    *,
    color: tuple[int, int, int],
) -> int:
    """Draw a line of text, cut off at the picture's edge; return the x behind it."""
    cover = _cover(text)
    left, middle = left_middle
    left, top = max(left, 0), max(middle - cover.shape[0] // 2, 0)
    place = picture[top : top + cover.shape[0], left : left + cover.shape[1]]
    part = cover[: place.shape[0], : place.shape[1], None]
    place[:] = np.round(place + part * (np.array(color, dtype=np.float32) - place))
    return left + cover.shape[1]


def text_width_px(text: str) -> int:
    """Return how wide `draw_text` will draw it."""
    return _cover(text).shape[1]


@lru_cache(maxsize=512)
def _cover(text: str) -> Float32[np.ndarray, "h w"]:
    """Return how much of each pixel the letters cover, 0…1.

    Drawn at four times the size and averaged: OpenCV's own small letters are ragged. OpenCV 4 and
    5 have different fonts; both come out well this way.
    """
    finer = 4
    font, thickness = cv2.FONT_HERSHEY_SIMPLEX, 2 * finer - 2
    scale = cv2.getFontScaleFromHeight(font, round(TEXT_PX * 0.62) * finer, thickness)
    (width, _), _ = cv2.getTextSize(text, font, scale, thickness)
    height = TEXT_PX + 6
    fine = np.zeros((height * finer, math.ceil(width / finer + 1) * finer), dtype=np.uint8)
    baseline = round(height * 0.71) * finer
    cv2.putText(fine, text, (finer // 2, baseline), font, scale, 255, thickness, cv2.LINE_AA)
    size = (fine.shape[1] // finer, height)
    small = cv2.resize(fine, size, interpolation=cv2.INTER_AREA)
    return small.astype(np.float32) / 255


def _even(size: int) -> int:
    return size + size % 2
