"""`peaking plan`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.guidance.plenoptic import PlenopticBound
    from peaking.guidance.viewing import Limit, Viewing

BAR_CHARS = 24


@dataclass(frozen=True)
class Plan:
    """Compute how many views plenoptic sampling needs, their spacing, and what limits the detail.

    The defaults are the paper's set-up: its phone and its MPI, a square of 15 cm, the nearest
    surface at 50 cm. docs/plenoptic.md derives the bound.

    Examples:
      peaking plan
      peaking plan --z-min-m 0.5 --area-m 0.15 --display-ppi 460 --eye-m 0.35 --plot plan.svg
      peaking plan --width-px 588 --speed-m-per-s 0.1
    """

    z_min_m: float = 0.5
    """Distance (m) to the nearest surface, z_min."""
    area_m: float = 0.15
    """Side (m) of the square in which views are taken, S."""
    num_planes: int = 32
    """Planes of an MPI, D."""
    width_px: float = 294.0
    """Pixels of an MPI along the axis of the field of view, W."""
    fov_deg: float = 45.93
    """Field of view (degrees) along that axis, θ."""
    cap_disparity: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Use min(D, W/2, 64) in place of D, as LLFF does; the paper does not."""
    display_ppi: float = 460.0
    """Pixels per inch of the screen."""
    display_px: float = 1179.0
    """Pixels of the screen that the width of the picture covers."""
    eye_m: float = 0.35
    """Distance (m) from the eyes to the screen."""
    acuity_arcmin: float = 1.0
    """The finest detail (arc minutes) that the eyes resolve; 1 is 20/20 vision."""
    speed_m_per_s: float = 0.0
    """Sideways speed (m/s) of the camera while the user looks; 0: held still."""
    fps: float = 30.0
    """Pictures per second on the screen."""
    plot: Path | None = None
    """Draw the number of views over the viewing distance into this .svg or .png file. PNG needs:
    pip install 'peaking[study]'"""
    json: Path | None = None
    """Also write the results to this file, as JSON."""

    def run(self) -> None:
        """Print the plan."""
        from peaking.commands.arguments import ArgumentError, checked_arguments
        from peaking.commands.results import write_results
        from peaking.guidance.plan_svg import NAMES
        from peaking.guidance.plenoptic import PlenopticBound
        from peaking.guidance.viewing import Viewing, limits
        from peaking.output import write_atomically

        if self.plot is not None and self.plot.suffix not in (".svg", ".png"):
            raise ArgumentError(
                f"need a file name ending in .svg or .png for --plot, got {self.plot}"
            )
        with checked_arguments():
            bound = PlenopticBound(
                area_side_m=self.area_m,
                z_min_m=self.z_min_m,
                num_planes=self.num_planes,
                width_px=self.width_px,
                fov_rad=math.radians(self.fov_deg),
                cap_disparity=self.cap_disparity,
            )
            viewing = Viewing(
                display_ppi=self.display_ppi,
                display_width_px=self.display_px,
                eye_m=self.eye_m,
                acuity_arcmin=self.acuity_arcmin,
                speed_m_per_s=self.speed_m_per_s,
                frames_per_s=self.fps,
            )
        drawing = None if self.plot is None else _drawn(self.plot, bound, viewing)
        found = limits(bound, viewing)
        limiting = found[0]
        seen = replace(bound, detail_px=limiting.detail_px)
        say(
            f"MPIs of {self.width_px:g} px over {self.fov_deg:g}°, {self.num_planes} planes; "
            f"nearest surface at {self.z_min_m:g} m; square of {100 * self.area_m:g} cm"
        )
        say(f"plenoptic bound   {_in_words(bound)}")
        say(f"visible detail    {_in_words(seen)}")
        say(f"limited by        {NAMES[limiting.factor]}", "")
        say("finest detail        on screen   at the eye     in an MPI   views if only this limits")
        for limit in found:
            views = replace(bound, detail_px=limit.detail_px).num_views_exact
            bar = "█" * max(1, round(BAR_CHARS * limit.on_display_m / limiting.on_display_m))
            say(
                f"  {NAMES[limit.factor]:14} {1000 * limit.on_display_m:10.3f} mm "
                f"{limit.arcmin:10.2f}' {limit.detail_px:10.2f} px {views:9.1f}  {bar}"
            )
        if limiting.factor == "mpi":
            finer = found[1]
            width_px = self.width_px / finer.detail_px
            say(
                "",
                f"The {NAMES[finer.factor]} resolves more: an MPI of {width_px:.0f} px would use "
                f"that, and need N = {bound.num_views_exact / finer.detail_px**2:.1f}.",
            )
        if self.plot is not None and drawing is not None:
            write_atomically(self.plot, drawing)
            say("", f"plot: {self.plot.resolve()}")
        write_results(
            self,
            {
                "plenoptic_bound": _as_dict(bound),
                "visible_detail": _as_dict(seen),
                "limited_by": limiting.factor,
                "limits": _limits_as_dicts(bound, found),
            },
        )


def _drawn(path: Path, bound: PlenopticBound, viewing: Viewing) -> bytes:
    """Return the chart in the format of the file name."""
    from peaking.errors import ToolMissing
    from peaking.guidance.plan_svg import plan_chart

    if path.suffix == ".svg":
        return plan_chart(bound, viewing).encode()
    try:
        from peaking.guidance.plan_png import plan_picture
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


def _as_dict(bound: PlenopticBound) -> dict[str, float]:
    return {
        "num_views_exact": bound.num_views_exact,
        "num_views": bound.num_views,
        "spacing_m": bound.spacing_m,
        "views_per_side": bound.views_per_side,
        "pitch_m": bound.pitch_m,
        "detail_px": bound.detail_px,
    }


def _limits_as_dicts(bound: PlenopticBound, limits: Sequence[Limit]) -> list[dict[str, object]]:
    return [
        {
            **asdict(limit),
            "num_views_exact": replace(bound, detail_px=limit.detail_px).num_views_exact,
        }
        for limit in limits
    ]
