"""The bound, measured: two views of a scene of two planes, rendered by the project's own renderer.

Both surfaces lie half a slab from the plane that they are put on, which is the worst case, and wear
stripes. Midway between the views both are rendered and blended; where their stripes no longer fall
on each other the contrast falls. docs/plenoptic.md predicts by how much.

    .venv/bin/python tests/guidance/two_planes.py

draws docs/images/plenoptic.svg.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.guidance import PlenopticBound
from peaking.guidance.viewing import Viewing, extended_bound
from peaking.mpi import Mpi
from peaking.rendering import Backend, render
from peaking.rendering.blending import blend

WIDTH_PX, HEIGHT_PX = 420, 12
"""The upper half is the near surface, the lower half the far one."""

AMPLITUDE = 100


@dataclass(frozen=True)
class Blended:
    """What is left of the stripes of one surface midway between two views."""

    apart_px: float
    """How far the stripes of the two renderings are apart."""
    contrast: float
    """Of the blend, as a part of the mean contrast of the two renderings."""


def blended(
    bound: PlenopticBound, spacing_m: float, period_px: float, *, backend: Backend = "numpy"
) -> tuple[Blended, Blended]:
    """Return what is left of stripes of this period on the near and on the far surface."""
    left, right = -spacing_m / 2, spacing_m / 2
    middle = _camera(bound, 0.0)
    seen = [render(_mpi(bound, at_m, period_px), middle, backend=backend) for at_m in (left, right)]
    both = blend(
        np.stack([view.rgba for view in seen]),
        np.stack([view.depth_m for view in seen]),
        [0.5, 0.5],
        opacity="seen",
        backend=backend,
    )
    found: list[Blended] = []
    for rows in (slice(1, HEIGHT_PX // 2 - 1), slice(HEIGHT_PX // 2 + 1, HEIGHT_PX - 1)):
        a, b, blend_ab = (
            _stripes(picture[rows, :, 0].mean(axis=0), period_px)
            for picture in (seen[0].rgba, seen[1].rgba, both.rgba)
        )
        apart_px = abs(np.angle(a * np.conj(b))) * period_px / (2 * np.pi)
        found.append(Blended(float(apart_px), float(abs(blend_ab) / ((abs(a) + abs(b)) / 2))))
    return found[0], found[1]


def _camera(bound: PlenopticBound, x_m: float) -> Camera:
    f_px = bound.focal_px
    pinhole = Pinhole(WIDTH_PX, HEIGHT_PX, f_px, f_px, WIDTH_PX / 2, HEIGHT_PX / 2)
    return Camera(pinhole, Rigid(np.eye(3), np.array([x_m, 0.0, 0.0])))


def _mpi(bound: PlenopticBound, x_m: float, period_px: float) -> Mpi:
    """Photograph the scene from `x_m` and put each surface on the plane behind it."""
    count = bound.num_planes
    # Slabs of equal disparity from infinity to z_min, each with a plane in its middle.
    plane_depths_m = count * bound.z_min_m / (np.arange(count) + 0.5)
    planes = np.zeros((count, HEIGHT_PX, WIDTH_PX, 4), np.uint8)
    camera = _camera(bound, x_m)
    ray_x = camera.pinhole.rays()[0, :, 0]
    half = HEIGHT_PX // 2
    for rows, slab in ((slice(0, half), count), (slice(half, HEIGHT_PX), count // 4)):
        depth_m = count * bound.z_min_m / slab  # the border of two slabs
        on_surface_px = bound.focal_px * (x_m + depth_m * ray_x) / depth_m
        stripes = 128 + AMPLITUDE * np.sin(2 * np.pi * on_surface_px / period_px)
        planes[slab - 1, rows, :, :3] = np.round(stripes)[:, None]
        planes[slab - 1, rows, :, 3] = 255
    return Mpi.from_dense(planes, plane_depths_m, camera)


def _stripes(row: np.ndarray, period_px: float) -> complex:
    """Return the complex amplitude of the stripes, away from the rims that a view leaves empty."""
    x = np.arange(WIDTH_PX) + 0.5
    inside = slice(WIDTH_PX // 4, -WIDTH_PX // 4)
    phase = 2 * np.pi * x[inside] / period_px
    basis = np.stack([np.cos(phase), np.sin(phase), np.ones_like(phase)], axis=-1)
    cosine, sine, _ = np.linalg.lstsq(basis, row[inside].astype(np.float64), rcond=None)[0]
    return complex(cosine, -sine)


FIGURE = Path(__file__).parents[2] / "docs" / "images" / "plenoptic.svg"
SHOWN = (
    ("eyes at 1.6 m", "#8a5a00", Viewing(eye_m=1.6)),
    (
        "a screen of 40 pixels per inch",
        "#1d5fc4",
        Viewing(display_ppi=40.0, display_width_px=100.0),
    ),
    ("20 cm/s", "#7a3fb0", Viewing(speed_m_per_s=0.2)),
)
"""What limits, its colour, and how."""

STYLE = """
text { font: 13px system-ui, "Segoe UI", Roboto, "Liberation Sans", sans-serif; fill: #4a5462; }
.grid { stroke: #dde1e7; } .law { fill: none; stroke: #14181f; stroke-width: 2; }
.bound { stroke: #14181f; stroke-dasharray: 6 4; fill: none; }"""


def figure() -> str:
    """Draw what is left of the finest detail over the spacing: predicted and rendered."""
    left, right, top, bottom, most = 56.0, 620.0, 24.0, 330.0, 3.0

    def x_px(share: float) -> float:
        return left + (right - left) * share / most

    def y_px(contrast: float) -> float:
        return bottom - (bottom - top) * contrast

    parts: list[str] = []
    for tick in (0.0, 0.25, 0.5, 0.75, 1.0):
        parts.append(f'<path class="grid" d="M{left:g} {y_px(tick):.1f}H{right:g}"/>')
        parts.append(
            f'<text x="{left - 8:g}" y="{y_px(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>'
        )
    parts += [
        f'<text x="{x_px(share):.1f}" y="{bottom + 18:g}" text-anchor="middle">{share:g}</text>'
        for share in (0.0, 1.0, 2.0, 3.0)
    ]
    parts.append(
        f'<path class="bound" d="M{x_px(1):.1f} {bottom:g}V{y_px(math.sqrt(0.5)):.1f}H{left:g}"/>'
        f'<text x="{right:g}" y="{bottom + 38:g}" text-anchor="end">spacing / spacing of the '
        f'extended bound</text><text x="8" y="14">contrast that is left of the finest detail</text>'
    )
    shares = np.linspace(0, most, 121)
    law = [f"{x_px(s):.1f} {y_px(abs(math.cos(math.pi / 4 * s))):.1f}" for s in shares.tolist()]
    parts.append(f'<path class="law" d="M{"L".join(law)}"/>')
    fine = replace(PlenopticBound(), num_planes=8, width_px=4 * PlenopticBound().width_px)
    for line, (words, colour, viewing) in enumerate(SHOWN):
        bound = extended_bound(fine, viewing)
        for share in (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25):
            near, far = blended(bound, share * bound.spacing_m, 2 * bound.detail_px)
            for surface, fill in ((near, colour), (far, "#fff")):
                parts.append(
                    f'<circle cx="{x_px(share):.1f}" cy="{y_px(surface.contrast):.1f}" '
                    f'r="{6.5 - 1.5 * line:g}" fill="{fill}" stroke="{colour}" stroke-width="1.6" '
                    f'fill-opacity="0.5"/>'
                )
        y = top + 18 + 20 * line
        parts.append(f'<circle cx="400" cy="{y - 4:g}" r="5" fill="{colour}"/>')
        parts.append(f'<text x="412" y="{y:g}">{words}</text>')
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 640 376" width="640" height="376">'
        f'<style>{STYLE}</style><rect width="640" height="376" fill="#fff"/>'
        f"{''.join(parts)}</svg>\n"
    )


if __name__ == "__main__":
    FIGURE.write_text(figure())
