"""The chart of the number of views by viewing distance, one line per factor, as SVG."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from peaking.guidance.plenoptic import PlenopticBound
from peaking.guidance.viewing import Factor, Viewing, extended_bound, limits

NAMES: dict[Factor, str] = {
    "mpi": "MPI pixel",
    "display": "screen pixel",
    "eye": "eye",
    "motion": "motion",
}

EYES_M = (0.1, 3.0)
"""Distances of the eyes that are drawn."""

COLOURS: dict[Factor, str] = {
    "mpi": "#1d5fc4",
    "display": "#6b7684",
    "eye": "#8a5a00",
    "motion": "#7a3fb0",
}

STYLE = """
text { font: 13px system-ui, "Segoe UI", Roboto, "Liberation Sans", sans-serif; fill: #4a5462; }
.grid { stroke: #dde1e7; } .each { fill: none; stroke-width: 1.6; stroke-dasharray: 6 4; }
.all { fill: none; stroke: #14181f; stroke-width: 2.6; } .here { fill: #14181f; }
.strong { fill: #14181f; font-weight: 600; }
"""

LEFT_PX, RIGHT_PX, TOP_PX, BOTTOM_PX = 58.0, 118.0, 40.0, 48.0


@dataclass(frozen=True)
class PlanCurves:
    """What is drawn: N over the distance of the eyes."""

    eyes_m: list[float]
    alone: dict[Factor, list[float]]
    """N at each distance if one factor alone were to limit."""
    together: list[float]
    views_range: tuple[float, float]
    """Lowest and highest N that is shown."""
    planned: PlenopticBound
    """At the distance that was asked about."""

    @property
    def words(self) -> str:
        """What the plan comes to."""
        return (
            f"N = {self.planned.num_views_exact:.1f}, {1000 * self.planned.spacing_m:.1f} mm apart"
        )


def plan_curves(bound: PlenopticBound, viewing: Viewing) -> PlanCurves:
    """Return N over the distance of the eyes: what each factor alone asks for, and all together."""
    eyes_m = _spread(*EYES_M, 80)
    placed = [replace(viewing, eye_m=eye_m) for eye_m in eyes_m]
    alone: dict[Factor, list[float]] = {
        limit.factor: [_views(bound, each, limit.factor) for each in placed]
        for limit in limits(bound, viewing)
    }
    together = [extended_bound(bound, each).num_views_exact for each in placed]
    planned = extended_bound(bound, viewing)
    most = 2.0 * max(planned.num_views_exact, *alone["mpi"])
    most = max(most, *(2.0 * _views(bound, viewing, factor) for factor in alone))
    return PlanCurves(eyes_m, alone, together, (0.8 * min(1.0, *together), most), planned)


def plan_chart(
    bound: PlenopticBound, viewing: Viewing, size_px: tuple[int, int] = (760, 420)
) -> str:
    """Draw N over the distance of the eyes.

    Returns:
        An SVG file on a white ground.
    """
    curves = plan_curves(bound, viewing)
    axes = _Axes(size_px, EYES_M, curves.views_range)
    parts = [*axes.grid()]
    for factor, views in curves.alone.items():
        path = axes.curve(curves.eyes_m, views)
        parts.append(f'<path class="each" stroke="{COLOURS[factor]}" d="{path}"/>')
    parts.append(f'<path class="all" d="{axes.curve(curves.eyes_m, curves.together)}"/>')
    ends: dict[Factor, float] = {
        factor: axes.y_px(views[-1]) for factor, views in curves.alone.items()
    }
    for factor, y in apart(ends, least=16.0).items():
        parts.append(
            f'<text x="{axes.right + 8:g}" y="{y + 4:.1f}" style="fill:{COLOURS[factor]}">'
            f"{html.escape(NAMES[factor])}</text>"
        )
    x, y = axes.x_px(viewing.eye_m), axes.y_px(curves.planned.num_views_exact)
    parts.append(f'<circle class="here" cx="{x:.1f}" cy="{y:.1f}" r="5"/>')
    parts.append(
        f'<text class="strong" x="{x + 9:.1f}" y="{y + 24:.1f}">{html.escape(curves.words)}</text>'
    )
    width, height = size_px
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" role="img" aria-label="Number of views over the '
        f'distance of the eyes"><style>{STYLE}</style>'
        f'<rect width="{width}" height="{height}" fill="#fff"/>{"".join(parts)}</svg>\n'
    )


def _views(bound: PlenopticBound, viewing: Viewing, factor: Factor) -> float:
    """Return N if this factor alone were to limit."""
    limit = next(each for each in limits(bound, viewing) if each.factor == factor)
    return replace(bound, detail_px=limit.detail_px).num_views_exact


@dataclass(frozen=True)
class _Axes:
    """Two logarithmic axes."""

    size_px: tuple[int, int]
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    @property
    def right(self) -> float:
        return self.size_px[0] - RIGHT_PX

    @property
    def bottom(self) -> float:
        return self.size_px[1] - BOTTOM_PX

    def x_px(self, x: float) -> float:
        return LEFT_PX + (self.right - LEFT_PX) * _share(x, *self.x_range)

    def y_px(self, y: float) -> float:
        return self.bottom - (self.bottom - TOP_PX) * _share(y, *self.y_range)

    def curve(self, xs: Sequence[float], ys: Sequence[float]) -> str:
        """Return a path; what is above the plot is left out."""
        points = [
            f"{self.x_px(x):.1f} {self.y_px(y):.1f}"
            for x, y in zip(xs, ys, strict=True)
            if y <= self.y_range[1]
        ]
        return "M" + "L".join(points) if points else ""

    def grid(self) -> list[str]:
        parts: list[str] = []
        for y in ticks(*self.y_range):
            at = f"{self.y_px(y):.1f}"
            parts.append(f'<path class="grid" d="M{LEFT_PX:g} {at}H{self.right:g}"/>')
            parts.append(_text(LEFT_PX - 8, self.y_px(y) + 4, f"{y:g}", "end"))
        for x in ticks(*self.x_range):
            at = f"{self.x_px(x):.1f}"
            parts.append(f'<path class="grid" d="M{at} {TOP_PX:g}V{self.bottom:g}"/>')
            parts.append(_text(self.x_px(x), self.bottom + 18, f"{x:g}", "middle"))
        parts.append(_text(LEFT_PX - 40, 20.0, "views, N", "start"))
        parts.append(_text(self.right, self.bottom + 38, "eyes to screen, m", "end"))
        return parts


def _text(x: float, y: float, words: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{html.escape(words)}</text>'


def _share(value: float, low: float, high: float) -> float:
    return math.log(value / low) / math.log(high / low)


def _spread(low: float, high: float, count: int) -> list[float]:
    return [low * (high / low) ** (i / (count - 1)) for i in range(count)]


def ticks(low: float, high: float) -> list[float]:
    """Return 1, 2, 5 times the powers of ten within a range."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    all_ticks = [float(f"{digit}e{power}") for power in powers for digit in (1, 2, 5)]
    return [tick for tick in all_ticks if low <= tick <= high]


def apart(ends: dict[Factor, float], *, least: float) -> dict[Factor, float]:
    """Move labels down (towards larger numbers) until they are `least` apart."""
    placed: dict[Factor, float] = {}
    below = -math.inf
    for factor, y in sorted(ends.items(), key=lambda end: end[1]):
        below = max(y, below + least)
        placed[factor] = below
    return placed
