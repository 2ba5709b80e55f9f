"""Charts of an evaluation, as SVG: quality against number of views, and differences with intervals.

Colours come from the page's style sheet by class names (`evaluation.css`): `s0`, `s1`, … for the
strategies that are compared with the reference, `ours` for the reference itself. Every strategy has
a mark of its own too, so that nothing hangs on colour alone.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Mapping, Sequence

from peaking.experiments.results import CaseResult, Difference
from peaking.replay.charts import nice_at_least

CURVE_METRICS = {
    "psnr_mean": "Mean PSNR, dB",
    "psnr_p5": "PSNR of the worst views (5th percentile), dB",
    "ssim_mean": "Mean SSIM",
    "flip_mean": "Mean FLIP (less is better)",
}
"""Rows of `CaseResult.row` that have a curve, and its heading."""

MARKS = (
    "M-4-4H4V4H-4Z",
    "M0-5.5L5 4H-5Z",
    "M0-5.5L5.5 0L0 5.5L-5.5 0Z",
    "M0 5.5L5-4H-5Z",
    "M-5-1.6H-1.6V-5H1.6V-1.6H5V1.6H1.6V5H-1.6V1.6H-5Z",
    "M-3-5H3L5.5 0L3 5H-3L-5.5 0Z",
)
"""Square, triangle, diamond, triangle upside down, cross, hexagon, around the origin."""

OURS_MARK = "M-5 0A5 5 0 1 0 5 0A5 5 0 1 0-5 0Z"

LABEL_STEP_PX = 15.0
"""Labels at the ends of curves are at least this far apart."""

ROW_PX, GAP_PX = 21, 11
"""Height of a row of the interval plot, and of the gap between two strategies."""

SIDE_SHARE = 0.2
"""Part of the extent that is shown at least on either side of no difference."""


def curve_points(results: Sequence[CaseResult], metric: str) -> dict[str, list[tuple[int, float]]]:
    """Return strategy → (number of views, value), the seeds averaged, in order of the numbers.

    Args:
        results: Of one scene, reconstruction and choice of test views.
        metric: A key of `CURVE_METRICS`.
    """
    seeds: dict[str, dict[int, list[float]]] = {}
    for result in results:
        value = result.row()[metric]
        if isinstance(value, float):
            case = result.case
            seeds.setdefault(case.strategy, {}).setdefault(case.n_views, []).append(value)
    return {
        strategy: [(n, sum(values) / len(values)) for n, values in sorted(by_count.items())]
        for strategy, by_count in seeds.items()
    }


def strategy_class(strategy: str, strategies: Sequence[str], reference: str) -> str:
    """Return the class name that gives a strategy its colour."""
    return "ours" if strategy == reference else f"s{strategies.index(strategy) % len(MARKS)}"


def strategy_mark(strategy: str, strategies: Sequence[str], reference: str) -> str:
    """Return the outline of a strategy's mark."""
    return OURS_MARK if strategy == reference else MARKS[strategies.index(strategy) % len(MARKS)]


def quality_chart(
    points: Mapping[str, Sequence[tuple[int, float]]],
    size_px: tuple[int, int],
    *,
    strategies: Sequence[str],
    reference: str,
    label: str,
) -> str:
    """Draw a metric against the number of views, one line per strategy, named at its end.

    A strategy that only has more views than the reference ever has (`all`) is a level line.

    Args:
        points: From `curve_points`.
        size_px: Width and height of the drawing.
        strategies: All of the evaluation in their order, which gives colours and marks.
        reference: Drawn last and strongest.
        label: What is drawn, for those who do not see it.

    Returns:
        An <svg> element.
    """
    width, height = size_px
    left, right, top, bottom = 44, width - 84, 12, height - 38
    budgets = [n for n, _ in points.get(reference, [])] or [
        n for p in points.values() for n, _ in p
    ]
    first, last = min(budgets, default=0), max(budgets, default=1)
    values = [value for some in points.values() for _, value in some] or [0.0]
    ticks = _ticks(min(values), max(values), 5)

    def x_px(n: int) -> float:
        share = 0.5 if first == last else (n - first) / (last - first)
        return left + 10 + (right - left - 20) * share

    def y_px(value: float) -> float:
        return bottom - (bottom - top) * (value - ticks[0]) / (ticks[-1] - ticks[0])

    parts = [
        f'<line class="grid" x1="{left}" x2="{right}" y1="{y_px(t):.1f}" y2="{y_px(t):.1f}"/>'
        f'<text x="{left - 8}" y="{y_px(t) + 4:.1f}" class="end">{_plain_number(t, ticks)}</text>'
        for t in ticks
    ]
    parts += [
        f'<text x="{x_px(n):.1f}" y="{bottom + 18}" class="mid">{n}</text>'
        for n in _legible(sorted(set(budgets)), x_px)
    ]
    parts.append(f'<text x="{right}" y="{height - 4}" class="end">views</text>')

    ends: list[tuple[float, str, str]] = []
    for strategy in [s for s in strategies if points.get(s)]:
        own = points[strategy]
        name = strategy_class(strategy, strategies, reference)
        mark = strategy_mark(strategy, strategies, reference)
        within = [(n, value) for n, value in own if first <= n <= last]
        title = html.escape("; ".join(f"{strategy}, {n} views: {v:.4g}" for n, v in own))
        if within:
            line = "L".join(f"{x_px(n):.1f} {y_px(v):.1f}" for n, v in within)
            dots = "".join(
                f'<path class="mark" d="{mark}" '
                f'transform="translate({x_px(n):.1f} {y_px(v):.1f})"/>'
                for n, v in within
            )
            drawing = f'<path class="line" d="M{line}"/>{dots}'
            end_y, words = y_px(within[-1][1]), strategy
        else:
            end_y, words = y_px(own[-1][1]), f"{strategy} ({own[-1][0]})"
            drawing = f'<path class="line level" d="M{left} {end_y:.1f}H{right}"/>'
        parts.append(f'<g class="series {name}"><title>{title}</title>{drawing}</g>')
        ends.append((end_y, words, name))
    for y, (_, words, name) in zip(_pushed_apart(sorted(ends), height), sorted(ends), strict=True):
        parts.append(
            f'<text class="name {name}" x="{right + 6}" y="{y + 4:.1f}">{html.escape(words)}</text>'
        )
    return (
        f'<svg class="quality-chart" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{html.escape(label)}">{"".join(parts)}</svg>'
    )


def interval_chart(
    differences: Sequence[Difference],
    width_px: int,
    *,
    extent: tuple[float, float],
    label: str,
) -> str:
    """Draw each difference as a dot with its interval, and the line of no difference.

    Args:
        differences: Of one scene, reconstruction, choice of test views and metric, in the order
            of rows; rows of the same other strategy stand together.
        width_px: Width of the drawing; its height follows from the rows.
        extent: Least and greatest value of the axis; the same for charts to be compared.
        label: What is drawn, for those who do not see it.

    Returns:
        An <svg> element. Rows have the class `better`, `worse` or `same`.
    """
    left, right, top = 128, width_px - 58, 26
    low, high = min(0.0, extent[0]), max(0.0, extent[1])
    room = SIDE_SHARE * (high - low)  # on either side of the line, for its words
    ticks = _ticks(min(low, -room), max(high, room), 7)

    def x_px(value: float) -> float:
        return left + (right - left) * (value - ticks[0]) / (ticks[-1] - ticks[0])

    rows: list[str] = []
    y, previous = float(top), ""
    for d in differences:
        if d.b != previous:
            y += GAP_PX
            rows.append(
                f'<text class="row" x="0" y="{y + ROW_PX / 2 + 4:.1f}">{html.escape(d.b)}</text>'
            )
            previous = d.b
        middle = y + ROW_PX / 2
        values = f"{signed(d.difference)}, {signed(d.low)} to {signed(d.high)}"
        words = f"{d.a} minus {d.b}, {d.n_views} views: {values}"
        rows.append(
            f'<g class="interval {verdict(d)}"><title>{html.escape(words)}</title>'
            f'<text x="{left - 10}" y="{middle + 4:.1f}" class="end">{d.n_views}</text>'
            f'<line x1="{x_px(d.low):.1f}" x2="{x_px(d.high):.1f}" '
            f'y1="{middle:.1f}" y2="{middle:.1f}"/>'
            f'<circle cx="{x_px(d.difference):.1f}" cy="{middle:.1f}" r="4.5"/>'
            f'<text x="{width_px}" y="{middle + 4:.1f}" class="end value">'
            f"{signed(d.difference)}</text></g>"
        )
        y += ROW_PX
    bottom = y + 8
    zero = x_px(0.0)
    axis = "".join(
        f'<line class="grid" x1="{x_px(t):.1f}" x2="{x_px(t):.1f}" y1="{top}" y2="{bottom:.1f}"/>'
        f'<text x="{x_px(t):.1f}" y="{bottom + 17:.1f}" class="mid">'
        f"{_plain_number(t, ticks)}</text>"
        for t in ticks
    )
    sides = (
        f'<text class="end" x="{zero - 8:.1f}" y="14">worse</text>'
        f'<text x="{zero + 8:.1f}" y="14">better</text>'
        f'<text class="end" x="{left - 22}" y="{bottom + 17:.1f}">views</text>'
        f'<text class="end" x="{width_px}" y="14">dB</text>'
    )
    line = f'<line class="zero" x1="{zero:.1f}" x2="{zero:.1f}" y1="{top - 22}" y2="{bottom:.1f}"/>'
    return (
        f'<svg class="interval-chart" viewBox="0 0 {width_px} {bottom + 22:.0f}" role="img" '
        f'aria-label="{html.escape(label)}">{axis}{line}{sides}{"".join(rows)}</svg>'
    )


def verdict(difference: Difference, *, less_is_better: bool = False) -> str:
    """Return `better`, `worse` or `same` (the interval has 0 in it), said of strategy a."""
    if difference.low <= 0 <= difference.high:
        return "same"
    return "better" if (difference.low > 0) != less_is_better else "worse"


def signed(number: float, digits: int = 2) -> str:
    """Return "+0.42" or "−0.42", with a true minus."""
    return f"{number:+.{digits}f}".replace("-", "−")


def _ticks(low: float, high: float, most: int) -> list[float]:
    """Return round numbers, two at least, from below `low` to above `high`."""
    step = nice_at_least(max(high - low, 1e-3) / most)
    start, stop = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [step * k for k in range(start, max(stop, start + 1) + 1)]


def _plain_number(tick: float, ticks: Sequence[float]) -> str:
    digits = max(0, -math.floor(math.log10(ticks[1] - ticks[0]) + 1e-9))
    return f"{tick + 0.0:.{digits}f}".replace("-", "−")


def _legible(numbers: Sequence[int], x_px: Callable[[int], float]) -> list[int]:
    """Leave out numbers that would touch the one before."""
    kept: list[int] = []
    for n in numbers:
        if not kept or x_px(n) - x_px(kept[-1]) > 24:
            kept.append(n)
    return kept


def _pushed_apart(ends: Sequence[tuple[float, str, str]], height: int) -> list[float]:
    """Return places for labels, in the same order, that do not overlap."""
    places: list[float] = []
    for y, _, _ in ends:
        places.append(max(y, places[-1] + LABEL_STEP_PX) if places else max(y, 8.0))
    lowest = height - 8.0
    for k in range(len(places) - 1, -1, -1):
        places[k] = min(places[k], lowest)
        lowest = places[k] - LABEL_STEP_PX
    return places
