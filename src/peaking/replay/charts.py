"""The peaked share over the frames, as SVG.

Colours and fonts come from the page's style sheet by class names (`page.css`, `report.css`).
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

from peaking.replay.records import FrameRecord

LEFT_PX, RIGHT_PX, TOP_PX, BOTTOM_PX = 46, 14, 26, 44
"""Room around the plot for the axes' numbers and the shutter marks."""

MAX_POINTS = 2000
"""A curve of more frames than this is thinned out; no screen has more columns."""

MAX_MARKS = 600
"""Of more captured frames than this only every second, third … is marked, for the same reason."""


def percent(share: float | None) -> str:
    """Return a share in percent with a no-break space, or a dash."""
    if share is None:
        return "–"
    digits = 1 if share >= 0.0995 else 2
    return f"{100 * share:.{digits}f}\u00a0%"


def share_chart(
    records: Sequence[FrameRecord], size_px: tuple[int, int], *, threshold_share: float
) -> str:
    """Draw the peaked share of every frame, the threshold, and what was captured.

    Args:
        records: The frames, in order.
        size_px: Width and height of the drawing.
        threshold_share: A frame with a greater peaked share is captured.

    Returns:
        An <svg> element. It carries the place of its plot in `data-` attributes, for the script.
    """
    width, height = size_px
    left, right = LEFT_PX, width - RIGHT_PX
    top, bottom = TOP_PX, height - BOTTOM_PX
    last = max((r.index for r in records), default=0)
    highest = max((r.peaked_share or 0.0 for r in records), default=0.0)
    step_share, top_share = _percent_axis(max(highest, 1.3 * threshold_share))

    def x_px(index: int) -> float:
        return left + (right - left) * index / max(1, last)

    def y_px(share: float) -> float:
        return bottom - (bottom - top) * share / top_share

    parts: list[str] = []
    for tick in range(round(top_share / step_share) + 1):
        share = tick * step_share
        y = y_px(share)
        parts.append(f'<line class="grid" x1="{left}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{left - 8}" y="{y + 4:.1f}" class="end">{100 * share:g}</text>')
    for index in index_ticks(last, max(2, width // 110)):
        x = x_px(index)
        parts.append(f'<text x="{x:.1f}" y="{bottom + 18}" class="mid">{index}</text>')
    parts.append(f'<text x="{left - 8}" y="12" class="end">%</text>')
    parts.append(f'<text x="{right}" y="{height - 6}" class="end">frame</text>')

    half = 5.0 if width > 500 else 3.6
    for r in marked(records):
        x = x_px(r.index)
        title = f"frame {r.index}, captured, {percent(r.peaked_share)} peaked"
        parts.append(
            f'<g class="shutter"><title>{html.escape(title)}</title>'
            f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{bottom}"/>'
            f'<path d="M{x - half:.1f} {top - 14}h{2 * half:.1f}'
            f'l{-half:.1f} {1.8 * half:.1f}z"/></g>'
        )

    runs = _runs(records)
    threshold_y = y_px(threshold_share)
    clip = f"above-{width}"
    parts.append(
        f'<clipPath id="{clip}"><rect x="0" y="0" width="{width}" '
        f'height="{max(0.0, threshold_y):.1f}"/></clipPath>'
    )
    for run in runs:
        points = [(x_px(r.index), y_px(r.peaked_share or 0.0)) for r in run]
        line = _polyline(points)
        area = f"{line}L{points[-1][0]:.1f} {bottom}L{points[0][0]:.1f} {bottom}Z"
        parts.append(f'<path class="area" d="{area}"/>')
        parts.append(f'<path class="area-above" clip-path="url(#{clip})" d="{area}"/>')
        parts.append(f'<path class="curve" d="{line}"/>')
        unseen = [(x_px(r.index), y_px(r.unseen_share)) for r in run if r.unseen_share is not None]
        if unseen:
            parts.append(f'<path class="unseen" d="{_polyline(unseen)}"/>')
    parts.append(
        f'<line class="threshold" x1="{left}" x2="{right}" '
        f'y1="{threshold_y:.1f}" y2="{threshold_y:.1f}"/>'
    )
    parts.append(f'<line class="cursor" x1="0" x2="0" y1="{top}" y2="{bottom}"/>')

    captured = sum(r.captured for r in records)
    words = (
        f"Peaked share of {len(records)} frames, at most {percent(highest)}; the threshold is "
        f"{percent(threshold_share)}; {captured} frames were captured."
    )
    return (
        f'<svg class="share-chart" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{html.escape(words)}" data-left="{left}" data-right="{right}" '
        f'data-last="{last}">{"".join(parts)}</svg>'
    )


def marked(records: Sequence[FrameRecord]) -> list[FrameRecord]:
    """Return the captured frames that get a mark."""
    captured = [r for r in records if r.captured]
    return captured[:: math.ceil(len(captured) / MAX_MARKS) or 1]


def index_ticks(last: int, most: int) -> list[int]:
    """Return round frame numbers from 0 to `last`, about `most` of them."""
    step = max(1, math.ceil(nice_at_least(max(1, last) / most)))
    return list(range(0, last + 1, step))


def nice_at_least(number: float) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten that is not smaller.

    Raises:
        ValueError: The number is not positive.
    """
    if not number > 0:
        raise ValueError(f"need a number > 0, got {number}")
    power = 10.0 ** math.floor(math.log10(number))
    # The last is for numbers like 9.999999 that rounding moves over a power.
    return next(n * power for n in (1, 2, 5, 10, 20) if n * power >= number * (1 - 1e-9))


def _percent_axis(highest_share: float) -> tuple[float, float]:
    """Return step and end of an axis with four or five steps."""
    step = nice_at_least(max(highest_share, 0.004) / 5)
    return step, step * math.ceil(max(highest_share, 0.004) / step - 1e-9)


def _runs(records: Sequence[FrameRecord]) -> list[list[FrameRecord]]:
    """Return the stretches of frames that have a share, thinned out to what a screen can show."""
    runs: list[list[FrameRecord]] = [[]]
    for record in records:
        if record.peaked_share is None:
            runs.append([])
        else:
            runs[-1].append(record)
    keep = math.ceil(len(records) / MAX_POINTS)
    return [_thinned(run, keep) for run in runs if run]


def _thinned(run: list[FrameRecord], keep: int) -> list[FrameRecord]:
    """Keep the highest of every `keep` frames: peaks are what the curve is for."""
    if keep <= 1:
        return run
    buckets = (run[start : start + keep] for start in range(0, len(run), keep))
    return [max(bucket, key=lambda r: r.peaked_share or 0.0) for bucket in buckets]


def _polyline(points: Sequence[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
