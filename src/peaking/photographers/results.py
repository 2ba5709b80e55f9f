"""What photographers brought home, guide against guide: curves, paired differences, a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from peaking.experiments.intervals import CONFIDENCE, RESAMPLES
from peaking.experiments.results import LOWEST_PERCENT
from peaking.photographers.tasks import TUNING

MEASURES = ("psnr", "psnr_p5", "ssim")
REPORT, TUNED = "unseen scenes", "tuning scenes"
"""Names under which scenes are averaged."""

MOST_RATIO = 4.0
"""Where a curve does not reach a quality it is continued, but no further than to so many times."""


@dataclass(frozen=True)
class Home:
    """What one photographer brought home.

    Attributes:
        scene: Where.
        guide: With which guide.
        model: `mpi` or `3dgs`.
        photos: The limit.
        photographer: Who.
        kept: How many photos there are.
        seconds: When the last one was taken.
        psnr: Of every test view, whole pictures, dB.
        ssim: The same.
    """

    scene: str
    guide: str
    model: str
    photos: int
    photographer: int
    kept: int
    seconds: float
    psnr: tuple[float, ...]
    ssim: tuple[float, ...]

    def value(self, measure: str) -> float:
        """Return a measure over the test views; of a percentile the lowest of five in a hundred."""
        if measure == "psnr_p5":
            return float(np.percentile(self.psnr, LOWEST_PERCENT))
        return float(np.mean(self.ssim if measure == "ssim" else self.psnr))


@dataclass(frozen=True)
class Difference:
    """Reference minus another guide, in the mean over the same photographers, with its interval."""

    scene: str
    model: str
    photos: int
    other: str
    measure: str
    difference: float
    low: float
    high: float
    photographers: int


@dataclass(frozen=True)
class PhotosNeeded:
    """Photos that the reference needs for what another guide has at its largest limit, as a share.

    `share` below 1: fewer. `reached`: it is within the limits that were tried.
    """

    scene: str
    model: str
    other: str
    measure: str
    at_photos: int
    share: float
    low: float
    high: float
    reached: bool


Values = Float64[np.ndarray, "photographers limits"]


def values_of(
    homes: Sequence[Home], measure: str, limits: Sequence[int]
) -> dict[tuple[str, str, str], Values]:
    """Return the measure by scene, model and guide; NaN where nobody worked."""
    found: dict[tuple[str, str, str], Values] = {}
    most = 1 + max((home.photographer for home in homes), default=0)
    for home in homes:
        key = (home.scene, home.model, home.guide)
        values = found.setdefault(key, np.full((most, len(limits)), np.nan))
        values[home.photographer, limits.index(home.photos)] = home.value(measure)
    return found


def counts(photographers: int, rng: np.random.Generator) -> Int64[np.ndarray, "resamples p"]:
    """Return how often each photographer is in the sample (first) and in every resample."""
    drawn = rng.multinomial(photographers, [1 / photographers] * photographers, size=RESAMPLES)
    return np.vstack([np.ones((1, photographers), np.int64), drawn])


def compare(
    homes: Sequence[Home], *, reference: str, limits: Sequence[int], rng: np.random.Generator
) -> tuple[list[Difference], list[PhotosNeeded]]:
    """Compare one guide with every other, over the same photographers (paired bootstrap).

    Scenes are compared alone, and averaged: those for tuning, and those for reporting.

    Args:
        homes: In any order.
        reference: The guide that others are subtracted from.
        limits: Numbers of photos, rising.
        rng: For the resampling.
    """
    differences: list[Difference] = []
    needed: list[PhotosNeeded] = []
    scenes = list(dict.fromkeys(home.scene for home in homes))
    for measure in MEASURES:
        by_guide = values_of(homes, measure, limits)
        for model in sorted({home.model for home in homes}, reverse=True):
            others = dict.fromkeys(
                guide for _, m, guide in by_guide if m == model and guide != reference
            )
            for other in others:
                curves: dict[str, tuple[_Means, _Means]] = {}
                for scene in scenes:
                    ours = by_guide.get((scene, model, reference))
                    theirs = by_guide.get((scene, model, other))
                    if ours is not None and theirs is not None:
                        pair = _means(ours, theirs, rng)
                        if pair is not None:
                            curves[scene] = pair
                count = max(home.photographer for home in homes if home.model == model) + 1
                for name, (mine, its) in _with_averages(curves).items():
                    for k, photos in enumerate(limits):
                        gap = (mine - its)[:, k]
                        if np.isfinite(gap).all():
                            ends = _ends(gap)
                            differences.append(
                                Difference(name, model, photos, other, measure, *ends, count)
                            )
                    found = _needed(mine, its, limits)
                    if found is not None:
                        share, reached = found
                        needed.append(
                            PhotosNeeded(
                                name, model, other, measure, limits[-1], *_ends(share), reached
                            )
                        )
    return differences, needed


_Means = Float64[np.ndarray, "resamples limits"]


def _means(ours: Values, theirs: Values, rng: np.random.Generator) -> tuple[_Means, _Means] | None:
    """Return the means of the sample and the resamples, of those who worked with both guides."""
    both = np.isfinite(ours).any(axis=1) & np.isfinite(theirs).any(axis=1)
    if not both.any():
        return None
    weights = counts(int(both.sum()), rng) / both.sum()
    return weights @ ours[both], weights @ theirs[both]


def _with_averages(
    curves: Mapping[str, tuple[_Means, _Means]],
) -> dict[str, tuple[_Means, _Means]]:
    found = dict(curves)
    groups = ((TUNED, True), (REPORT, False))
    for name, is_tuning in groups:
        some = [pair for scene, pair in curves.items() if (scene in TUNING) == is_tuning]
        if len(some) > 1:
            ours = np.mean([pair[0] for pair in some], axis=0)
            found[name] = ours, np.mean([pair[1] for pair in some], axis=0)
    return found


def _ends(values: Float64[np.ndarray, "samples"]) -> tuple[float, float, float]:
    tail = 100 * (1 - CONFIDENCE) / 2
    low, high = np.percentile(values[1:], [tail, 100 - tail])
    return float(values[0]), float(low), float(high)


def _needed(
    ours: _Means, theirs: _Means, limits: Sequence[int]
) -> tuple[Float64[np.ndarray, "samples"], bool] | None:
    """Return photos needed as a share of the largest limit, of the sample and the resamples."""
    if len(limits) < 2 or not (np.isfinite(ours).all() and np.isfinite(theirs).all()):
        return None
    shares = np.array(
        [
            photos_for(quality, curve, limits) / limits[-1]
            for curve, quality in zip(ours, theirs[:, -1], strict=True)
        ]
    )
    return shares, bool(ours[0].max() >= theirs[0, -1] >= ours[0].min())


def photos_for(
    quality: float, curve: Float64[np.ndarray, "limits"], limits: Sequence[int]
) -> float:
    """Return at how many photos a curve has a quality, between limits by the logarithm.

    Beyond the last limit its last rise is continued, to `MOST_RATIO` times at most; below the first
    limit is the first limit.
    """
    rising = np.maximum.accumulate(curve)
    places = np.log2(np.array(limits, dtype=np.float64))
    if quality <= rising[0]:
        return float(limits[0])
    if quality <= rising[-1]:
        k = int(np.searchsorted(rising, quality))
        share = (quality - rising[k - 1]) / (rising[k] - rising[k - 1])
        return float(2 ** (places[k - 1] + share * (places[k] - places[k - 1])))
    rise = (rising[-1] - rising[-2]) / (places[-1] - places[-2])
    further = (quality - rising[-1]) / rise if rise > 0 else np.inf
    return float(limits[-1] * min(2.0**further, MOST_RATIO))
