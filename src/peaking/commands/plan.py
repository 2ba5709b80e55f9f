"""`peaking plan`."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from peaking.guidance.plenoptic import PlenopticBound
    from peaking.guidance.viewing import Viewing

BAR_CHARS = 24


@dataclass(frozen=True)
class Plan:
    """Say how many views plenoptic sampling asks for, how far apart, and what limits.

    Without options it is the paper's set-up: its phone and its MPI, a square of 15 cm, the nearest
    thing at 50 cm. docs/plenoptic.md derives the bound.

    Examples:
      peaking plan
      peaking plan --zmin 0.5 --area 0.15 --display-ppi 460 --eye 0.35 --plot plan.svg
      peaking plan --width-px 588 --speed 0.1
    """

    zmin: float = 0.5
    """Metres to the nearest thing."""
    area: float = 0.15
    """Side in metres of the square in which views are taken, S."""
    num_planes: int = 32
    """Planes of an MPI, D."""
    width_px: float = 294.0
    """Pixels of an MPI along the axis of the field of view, W."""
    fov_deg: float = 45.93
    """Field of view along that axis, θ."""
    cap_disparity: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Use min(D, W/2, 64) in place of D, as LLFF does; the paper does not."""
    display_ppi: float = 460.0
    """Pixels of the screen per inch."""
    display_px: float = 1179.0
    """Pixels of the screen that the picture's width covers."""
    eye: float = 0.35
    """Metres from the eyes to the screen."""
    acuity_arcmin: float = 1.0
    """The finest detail that the eyes resolve; 1 is 20/20."""
    speed: float = 0.0
    """Metres per second that the camera moves sideways while one looks; 0 is held still."""
    fps: float = 30.0
    """Pictures per second on the screen."""
    plot: Path | None = None
    """An .svg or .png file to draw the number of views over the distance of the eyes into. For PNG:
    pip install 'peaking[study]'"""

    def run(self) -> None:
        """Print the plan."""
        from peaking.guidance.plan_chart import NAMES
        from peaking.guidance.plenoptic import PlenopticBound
        from peaking.guidance.viewing import Viewing, limits
        from peaking.output import write_atomically

        if self.plot is not None and self.plot.suffix not in (".svg", ".png"):
            raise ValueError(f"need a name that ends in .svg or .png as --plot, got {self.plot}")
        bound = PlenopticBound(
            area_side_m=self.area,
            z_min_m=self.zmin,
            num_planes=self.num_planes,
            width_px=self.width_px,
            fov_rad=math.radians(self.fov_deg),
            cap_disparity=self.cap_disparity,
        )
        viewing = Viewing(
            display_ppi=self.display_ppi,
            display_width_px=self.display_px,
            eye_m=self.eye,
            acuity_arcmin=self.acuity_arcmin,
            speed_m_per_s=self.speed,
            frames_per_s=self.fps,
        )
        drawing = None if self.plot is None else _drawn(self.plot, bound, viewing)
        found = limits(bound, viewing)
        limiting = found[0]
        print(
            f"{self.width_px:g} px over {self.fov_deg:g}°, {self.num_planes} planes, nearest thing "
            f"at {self.zmin:g} m, square of {100 * self.area:g} cm"
        )
        print(f"plenoptic bound   {_in_words(bound)}")
        print(f"as it is seen     {_in_words(replace(bound, detail_px=limiting.detail_px))}")
        print(f"what limits       {NAMES[limiting.factor]}\n")
        print(
            "finest detail        on screen   for the eye    of an MPI   views if it alone limits"
        )
        for limit in found:
            views = replace(bound, detail_px=limit.detail_px).num_views_exact
            bar = "█" * max(1, round(BAR_CHARS * limit.on_display_m / limiting.on_display_m))
            print(
                f"  {NAMES[limit.factor]:14} {1000 * limit.on_display_m:10.3f} mm "
                f"{limit.arcmin:10.2f}' {limit.detail_px:10.2f} px {views:9.1f}  {bar}"
            )
        if limiting.factor == "mpi":
            finer = found[1]
            width_px = self.width_px / finer.detail_px
            print(
                f"\nAn MPI of {width_px:.0f} px would show all that the {NAMES[finer.factor]} lets "
                f"through, and ask for N = {bound.num_views_exact / finer.detail_px**2:.1f}."
            )
        if self.plot is not None and drawing is not None:
            write_atomically(self.plot, drawing)
            print(f"\nplot: {self.plot.resolve()}")


def _drawn(path: Path, bound: PlenopticBound, viewing: Viewing) -> bytes:
    """Return the chart as the ending of the path asks for."""
    from peaking.errors import ToolMissing
    from peaking.guidance.plan_chart import plan_chart

    if path.suffix == ".svg":
        return plan_chart(bound, viewing).encode()
    try:
        from peaking.guidance.plan_picture import plan_picture
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        raise ToolMissing(
            f"a plot as PNG needs matplotlib: pip install 'peaking[study]', or name it "
            f"{path.with_suffix('.svg').name}"
        ) from error
    return plan_picture(bound, viewing)


def _in_words(bound: PlenopticBound) -> str:
    side = bound.views_per_side
    return (
        f"N = {bound.num_views_exact:.2f}: {bound.num_views} views, at most "
        f"{1000 * bound.spacing_m:.1f} mm apart; as a square grid {side} × {side} = {side**2}, "
        f"{1000 * bound.pitch_m:.1f} mm apart"
    )
