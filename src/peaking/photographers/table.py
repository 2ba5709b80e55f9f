"""The results as JSON and as a table."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from peaking.experiments.costs import Costs
from peaking.output import plain
from peaking.photographers.results import MEASURES, REPORT, TUNED, Difference, Home, PhotosNeeded
from peaking.photographers.tasks import TUNING

UNITS: Mapping[str, tuple[str, str]] = {
    "psnr": ("PSNR, dB", "{:+.2f}"),
    "psnr_p5": ("5th percentile, dB", "{:+.2f}"),
    "ssim": ("SSIM", "{:+.3f}"),
}


@dataclass(frozen=True)
class Photographed:
    """All that was found.

    Attributes:
        config: What was asked for.
        versions: Of what it ran on.
        reference: The guide that others are compared with.
        limits: Numbers of photos, rising.
        homes: What each photographer brought home.
        differences: Reference minus others.
        needed: Photos that the reference needs for the same.
        costs: What all steps took.
    """

    config: Mapping[str, object]
    versions: Mapping[str, str]
    reference: str
    limits: Sequence[int]
    homes: Sequence[Home]
    differences: Sequence[Difference]
    needed: Sequence[PhotosNeeded]
    costs: Costs


def results_json(found: Photographed) -> str:
    """Return everything, without what is in the cache alone."""
    text = {
        "config": found.config,
        "versions": found.versions,
        "reference": found.reference,
        "photographers": [
            {**asdict(home), **{name: home.value(name) for name in MEASURES}}
            for home in found.homes
        ],
        "differences": [asdict(difference) for difference in found.differences],
        "photos_needed": [asdict(needed) for needed in found.needed],
        "costs": found.costs.as_dict(),
    }
    return json.dumps(plain(text), indent=1) + "\n"


def table_md(found: Photographed) -> str:
    """Return the table that is printed: means, differences, photos needed."""
    lines: list[str] = []
    for model in dict.fromkeys(home.model for home in found.homes):
        homes = [home for home in found.homes if home.model == model]
        lines += [*_means(homes, model, found), ""]
        lines += [*_differences(found, model), ""]
        lines += _needed(found, model)
    return "\n".join(lines).rstrip() + "\n"


def _means(homes: Sequence[Home], model: str, found: Photographed) -> list[str]:
    limits = [n for n in found.limits if any(home.photos == n for home in homes)]
    count = len({home.photographer for home in homes})
    lines = [
        f"{model}: PSNR / 5th percentile in dB, and in brackets photos brought home; "
        f"{count} photographers per guide and scene",
        "",
        "| scene | guide | " + " | ".join(f"{n} photos" for n in limits) + " |",
        "|---|---|" + "---|" * len(limits),
    ]
    for scene in dict.fromkeys(home.scene for home in homes):
        mark = " (tuning)" if scene in TUNING else ""
        for guide in dict.fromkeys(home.guide for home in homes):
            cells: list[str] = []
            for photos in limits:
                some = [h for h in homes if (h.scene, h.guide, h.photos) == (scene, guide, photos)]
                if not some:
                    cells.append("")
                    continue
                psnr, low = (np.mean([h.value(name) for h in some]) for name in ("psnr", "psnr_p5"))
                kept = np.mean([h.kept for h in some])
                cells.append(f"{psnr:.2f} / {low:.2f} ({kept:.0f})")
            lines.append(f"| {scene}{mark} | {guide} | " + " | ".join(cells) + " |")
    return lines


def _differences(found: Photographed, model: str) -> list[str]:
    some = [d for d in found.differences if d.model == model]
    limits = sorted({d.photos for d in some})
    lines = [
        f"{found.reference} minus others, with 95 % intervals over photographers",
        "",
        "| | scene | minus | " + " | ".join(f"{n} photos" for n in limits) + " |",
        "|---|---|---|" + "---|" * len(limits),
    ]
    for measure in MEASURES:
        title, form = UNITS[measure]
        for scene, other in dict.fromkeys((d.scene, d.other) for d in some):
            cells: list[str] = []
            for photos in limits:
                cell = [
                    _with_interval(form, d.difference, d.low, d.high)
                    for d in some
                    if (d.measure, d.scene, d.other, d.photos) == (measure, scene, other, photos)
                ]
                cells.append("".join(cell))
            name = f"*{scene}*" if scene in (REPORT, TUNED) else scene
            lines.append(f"| {title} | {name} | {other} | " + " | ".join(cells) + " |")
    return lines


def _with_interval(form: str, value: float, low: float, high: float) -> str:
    """Return a value with its interval, which one photographer alone does not have."""
    if low == high:
        return form.format(value)
    return f"{form.format(value)} ({form.format(low)} … {form.format(high)})"


def _needed(found: Photographed, model: str) -> list[str]:
    some = [n for n in found.needed if n.model == model and n.measure != "ssim"]
    if not some:
        return []
    lines = [
        f"Photos that {found.reference} needs for what others have at {some[0].at_photos}, in per "
        "cent of those, from interpolated curves (* outside the limits that were tried)",
        "",
        "| scene | as | PSNR | 5th percentile |",
        "|---|---|---|---|",
    ]
    for scene, other in dict.fromkeys((n.scene, n.other) for n in some):
        cells = [
            _with_interval("{:.0%}", n.share, n.low, n.high) + ("" if n.reached else "*")
            for n in some
            if (n.scene, n.other) == (scene, other)
        ]
        lines.append(f"| {scene} | {other} | " + " | ".join(cells) + " |")
    return [*lines, ""]
