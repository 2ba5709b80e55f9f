"""The path of the camera as a map, as SVG.

Nothing tells us which way is up in the world (CONVENTIONS.md), so the cameras do: people hold
them upright on average.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from peaking.replay.charts import MAX_POINTS, marked, nice_at_least
from peaking.replay.records import FrameRecord

MARGIN_PX = 26
FOOT_PX = 34
"""Room below the path for the scale bar."""

WEDGE_PX, NARROW_WEDGE_PX = 17.0, 11.0
"""Length of the wedges in a wide and in a narrow drawing."""

WEDGE_HALF_ANGLE_RAD = math.radians(26)

SMALLEST_EXTENT_M = 0.05
"""A path shorter than this is not enlarged to fill the map; it is somebody standing still."""


@dataclass(frozen=True)
class MapView:
    """The plane that the path is drawn in.

    Attributes:
        axes: The map's x (right) and y (up) as directions in the world, as rows; orthonormal.
        center_m: The point of the world that is the map's origin.
        words: How one looks at the path, to stand after "The path".
    """

    axes: Float64[np.ndarray, "2 3"]
    center_m: Float64[np.ndarray, "3"]
    words: str

    def point_m(self, points_m: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 2"]:
        """Return points in the map's plane, in metres."""
        return (points_m - self.center_m) @ self.axes.T


def map_view(records: Sequence[FrameRecord]) -> MapView:
    """Choose the plane: from above, or from behind the cameras if they moved up and down.

    From above, the longer axis of the path lies across the page, and of the two ways to turn it
    the one in which the cameras look up the page. A light field that is taken like a sheet of
    paper held upright would be a line from above; that is what the other view is for.
    """
    positions_m = np.array([r.position_m for r in records], dtype=np.float64)
    center_m = positions_m.mean(axis=0)
    from_center_m = positions_m - center_m
    up = np.mean([r.up for r in records], axis=0)
    forward = np.mean([r.forward for r in records], axis=0)
    if np.linalg.norm(up) < 0.3:  # turned about in every direction: the plane it is flattest in
        _, vectors = np.linalg.eigh(from_center_m.T @ from_center_m)
        axes = _turned(vectors[:, 2], vectors[:, 1], forward)
        return MapView(axes, center_m, "in the plane in which it is widest")
    up = up / np.linalg.norm(up)

    # The principal axes of the path in the plane across `up`, by way of any basis of that plane.
    basis = np.linalg.svd(up[None])[2][1:]
    flat_m = from_center_m @ basis.T
    spread, vectors = np.linalg.eigh(flat_m.T @ flat_m / len(flat_m))
    minor_m, major_m = np.sqrt(np.maximum(spread, 0.0))
    vertical_m = float(np.std(from_center_m @ up))
    across = np.cross(forward, up)
    looks_one_way = np.linalg.norm(across) > 0.6
    if looks_one_way and vertical_m > 2 * minor_m and vertical_m > 0.35 * major_m:
        across = across / np.linalg.norm(across)
        axes = np.stack([across, np.cross(across, forward / np.linalg.norm(forward))])
        return MapView(axes, center_m, "seen from behind the cameras")
    right = vectors[:, 1] @ basis
    return MapView(_turned(right, np.cross(up, right), forward), center_m, "seen from above")


def _turned(
    right: Float64[np.ndarray, "3"],
    page_up: Float64[np.ndarray, "3"],
    forward: Float64[np.ndarray, "3"],
) -> Float64[np.ndarray, "2 3"]:
    axes = np.stack([right, page_up])
    return -axes if page_up @ forward < 0 else axes


def path_map(records: Sequence[FrameRecord], view: MapView, size_px: tuple[int, int]) -> str:
    """Draw the path, the captured views as wedges in their viewing direction, and a scale bar.

    Args:
        records: The frames, in order; at least one.
        view: The plane, from `map_view`.
        size_px: Width of the drawing, and the most it may be high.

    Returns:
        An <svg> element. It carries its scale in `data-` attributes, for the script.
    """
    points_m = view.point_m(np.array([r.position_m for r in records], dtype=np.float64))
    low_m, high_m = points_m.min(axis=0), points_m.max(axis=0)
    extent_m = np.maximum(high_m - low_m, SMALLEST_EXTENT_M)
    width, most_height = size_px
    inner_width = width - 2 * MARGIN_PX
    inner_height = most_height - 2 * MARGIN_PX - FOOT_PX
    px_per_m = float(min(inner_width / extent_m[0], inner_height / extent_m[1]))
    height = round(min(inner_height, max(110.0, extent_m[1] * px_per_m)) + 2 * MARGIN_PX + FOOT_PX)
    middle_m = (low_m + high_m) / 2
    x0 = width / 2 - middle_m[0] * px_per_m
    y0 = (height - FOOT_PX) / 2 + middle_m[1] * px_per_m

    def point_px(point_m: Float64[np.ndarray, "2"]) -> tuple[float, float]:
        return x0 + point_m[0] * px_per_m, y0 - point_m[1] * px_per_m

    step = math.ceil(len(records) / MAX_POINTS)
    line = "L".join(f"{x:.1f} {y:.1f}" for x, y in map(point_px, points_m[::step]))
    parts = [f'<path class="path" d="M{line}"/>']
    wedge_px = WEDGE_PX if width > 500 else NARROW_WEDGE_PX
    for record in marked(records):
        tip_px = point_px(view.point_m(record.position_m[None])[0])
        title = f"frame {record.index}, captured: {record.name}"
        mark = _wedge(tip_px, view.axes @ record.forward, wedge_px)
        parts.append(f'<g class="view"><title>{html.escape(title)}</title>{mark}</g>')
    parts += _ends([point_px(point_m) for point_m in points_m], width)
    parts.append(_scale_bar(px_per_m, width, height))
    parts.append('<circle class="cursor" r="6" cx="0" cy="0"/>')

    captured = sum(r.captured for r in records)
    words = (
        f"The path {view.words}: {words_of_length(float(high_m[0] - low_m[0]))} by "
        f"{words_of_length(float(high_m[1] - low_m[1]))}, with {captured} captured views."
    )
    return (
        f'<svg class="path-map" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{html.escape(words)}" data-x0="{x0:.2f}" data-y0="{y0:.2f}" '
        f'data-scale="{px_per_m:.4f}">{"".join(parts)}</svg>'
    )


def _wedge(
    tip_px: tuple[float, float], direction: Float64[np.ndarray, "2"], length_px: float
) -> str:
    """Return a little frustum, or a square where the camera looks into the map."""
    x, y = tip_px
    if math.hypot(*direction) < 0.4:
        return f'<path d="M{x - 5:.1f} {y - 4:.1f}h10v8h-10z"/>'
    angle = math.atan2(-direction[1], direction[0])
    reach = length_px / math.cos(WEDGE_HALF_ANGLE_RAD)
    corners = [
        (x + reach * math.cos(angle + turn), y + reach * math.sin(angle + turn))
        for turn in (-WEDGE_HALF_ANGLE_RAD, WEDGE_HALF_ANGLE_RAD)
    ]
    far = "L".join(f"{cx:.1f} {cy:.1f}" for cx, cy in corners)
    tip = f'<circle r="{0.14 * length_px:.1f}" cx="{x:.1f}" cy="{y:.1f}"/>'
    return f'<path d="M{x:.1f} {y:.1f}L{far}Z"/>{tip}'


def _ends(points_px: Sequence[tuple[float, float]], width: int) -> list[str]:
    """Return the marks of the first and the last frame; none for the last if they are as one."""
    (x, y), (end_x, end_y) = points_px[0], points_px[-1]
    parts = [f'<circle class="first" r="5" cx="{x:.1f}" cy="{y:.1f}"/>']
    if math.hypot(end_x - x, end_y - y) > 12:
        parts.append(
            f'<rect class="last" x="{end_x - 5:.1f}" y="{end_y - 5:.1f}" width="10" height="10"/>'
        )
        parts.append(_label("end", (end_x, end_y), width))
    return [*parts, _label("start", (x, y), width)]


def _label(text: str, at_px: tuple[float, float], width: int) -> str:
    x, y = at_px
    right_half = x > width / 2
    side = ' class="end halo"' if right_half else ' class="halo"'
    return f'<text x="{x + (-9 if right_half else 9):.1f}" y="{y + 16:.1f}"{side}>{text}</text>'


def _scale_bar(px_per_m: float, width: int, height: int) -> str:
    length_m = nice_at_least(0.12 * width / px_per_m)
    length_px = length_m * px_per_m
    x, y = MARGIN_PX, height - 12
    return (
        f'<path class="scale-bar" d="M{x} {y - 5}v5h{length_px:.1f}v-5"/>'
        f'<text x="{x + length_px + 8:.1f}" y="{y + 1}">{words_of_length(length_m)}</text>'
    )


def words_of_length(length_m: float) -> str:
    """Return a length in centimetres, or in metres from 2 m on."""
    if length_m >= 1.995:
        return f"{length_m:.3g}\u00a0m"
    return f"{100 * length_m:.3g}\u00a0cm" if length_m >= 0.01 else f"{1000 * length_m:.2g}\u00a0mm"
