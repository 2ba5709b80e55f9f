"""What an evaluation finds: a score per test view, a row per data set, and paired comparisons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

LOWEST_PERCENT = 5.0
"""The percentile of PSNR that stands for the worst views."""


@dataclass(frozen=True)
class Measure:
    """How a number of `ViewScore` is averaged, compared and shown."""

    title: str
    less_is_better: bool = False


MEASURES: Mapping[str, Measure] = {
    "psnr": Measure("PSNR"),
    "psnr_p5": Measure("PSNR, 5th percentile"),
    "ssim": Measure("SSIM"),
    "flip": Measure("FLIP", less_is_better=True),
    "lpips": Measure("LPIPS", less_is_better=True),
    "st_lpips": Measure("ST-LPIPS", less_is_better=True),
}
"""By the name of the field; a metric of one's own is a field of `ViewScore` and a line here.

`psnr_p5` is the percentile of the field `psnr`, the others are means.
"""


@dataclass(frozen=True, order=True)
class Case:
    """One data set that was chosen, reconstructed and looked at.

    Attributes:
        scene: Name of the recording.
        strategy: Who chose the views.
        reconstruct: `mpi` or `3dgs`.
        test_views: `holdout` or `paper`.
        n_views: How many views were chosen.
        seed: Of the strategy's and the training's random choices.
    """

    scene: str
    strategy: str
    reconstruct: str
    test_views: str
    n_views: int
    seed: int


@dataclass(frozen=True)
class ViewScore:
    """How near one rendered test view is to its photograph.

    Attributes:
        view: Its number in the recording.
        psnr: Over the whole picture, black where nothing was rendered, dB.
        ssim: The same, up to 1.
        flip: Mean of the FLIP map, 0…1, less is better.
        lpips: `lpips-alex`, less is better; None without the official weights.
        st_lpips: `st-lpips-alex`, less is better; None without its package.
        psnr_seen: PSNR over the pixels that were rendered; None where there are none.
        coverage: Share of the pixels that were rendered, 0…1.
        picture: File with photograph, rendering and error beside each other, relative to the
            results; None but for the worst views.
    """

    view: int
    psnr: float
    ssim: float
    flip: float
    lpips: float | None
    st_lpips: float | None
    psnr_seen: float | None
    coverage: float
    picture: str | None = None


@dataclass(frozen=True)
class CaseResult:
    """The scores of one data set.

    Attributes:
        case: Which one.
        views: The chosen views, numbers in the recording.
        scores: One per test view, in the order of the recording.
        seconds: To reconstruct and to render all test views.
        lost: How many of the views could not be used, since COLMAP could not place them.
    """

    case: Case
    views: tuple[int, ...]
    scores: tuple[ViewScore, ...]
    seconds: float
    lost: int = 0

    def row(self) -> dict[str, str | int | float | None]:
        """Return the row of `results.json`: None where a number is not known, or not finite."""
        c = self.case
        return {
            "scene": c.scene,
            "strategy": c.strategy,
            "reconstruct": c.reconstruct,
            "test_views": c.test_views,
            "seed": c.seed,
            "n_views": c.n_views,
            "n_lost": self.lost,
            **self._measured(),
            "psnr_seen_mean": _mean([score.psnr_seen for score in self.scores], some=True),
            "coverage": float(np.mean([score.coverage for score in self.scores])),
            "seconds": self.seconds,
        }

    def _measured(self) -> dict[str, float | None]:
        """Return mean and deviation of every measure, and the percentile of PSNR."""
        found: dict[str, float | None] = {}
        for name in MEASURES:
            if name == "psnr_p5":
                found[name] = _lowest([score.psnr for score in self.scores])
            else:
                values: list[float | None] = [getattr(score, name) for score in self.scores]
                found |= {f"{name}_mean": _mean(values), f"{name}_std": _std(values)}
        return found


@dataclass(frozen=True)
class Difference:
    """Strategy a minus strategy b on the same test views, with a 95 % interval.

    Attributes:
        scene: Name of the recording.
        reconstruct: `mpi` or `3dgs`.
        test_views: `holdout` or `paper`.
        n_views: How many views both chose.
        a: One strategy.
        b: The other; its seeds are averaged view by view.
        metric: A key of `MEASURES`.
        difference: a - b.
        low: Lower end of the interval.
        high: Upper end.
    """

    scene: str
    reconstruct: str
    test_views: str
    n_views: int
    a: str
    b: str
    metric: str
    difference: float
    low: float
    high: float


def _mean(values: Sequence[float | None], *, some: bool = False) -> float | None:
    """Return the mean; None when a value is missing (with `some`: when all are)."""
    known = _known([value for value in values if value is not None] if some else values)
    return None if known is None else float(np.mean(known))


def _std(values: Sequence[float | None]) -> float | None:
    known = _known(values)
    return None if known is None else float(np.std(known))


def _lowest(values: Sequence[float | None]) -> float | None:
    known = _known(values)
    return None if known is None else float(np.percentile(known, LOWEST_PERCENT))


def _known(values: Sequence[float | None]) -> Float64[np.ndarray, "n"] | None:
    """Return the values; None when there is none, or one is missing or infinite."""
    known = np.array(values, dtype=np.float64)  # None becomes NaN
    return known if len(known) and np.isfinite(known).all() else None
