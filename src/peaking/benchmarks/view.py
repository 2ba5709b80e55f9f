"""Measure what people look at: the viewer, what is shared, and trainings beside captures."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from peaking.benchmarks import view_first, view_frames, view_training, view_walk
from peaking.benchmarks.browser import chromium
from peaking.benchmarks.measure import machine
from peaking.benchmarks.view_material import Material, Told
from peaking.server.serving import CLIENT_DIR
from peaking.share.writing import write_place

Part = Literal["first-picture", "light-field", "splat", "memory", "share", "training"]
WITHOUT_BROWSER: tuple[Part, ...] = ("share", "training")


@dataclass(frozen=True)
class ViewOptions:
    """What to measure.

    Attributes:
        scene: A recording with depth.
        parts: Which, in this order.
        walk_s: How long one walks while memory is watched, seconds.
        splat: Gaussians that were trained on the recording; None: train them where needed.
        seed: Of the walk.
    """

    scene: Path
    parts: Sequence[Part]
    walk_s: float = 300.0
    splat: Path | None = None
    seed: int = 0


def run(plan: ViewOptions, *, told: Told) -> dict[str, object]:
    """Measure the parts; `told` hears what is going on.

    Raises:
        BackendUnavailable: playwright is not installed.
        ToolMissing: There is no Chromium, or the web client is not built.
        PeakingError: The recording cannot be read, or a server does not start.
    """
    document: dict[str, object] = {"machine": machine()}
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        material = Material(plan.scene, folder, plan.splat, told)
        browser: Any = None
        if not set(plan.parts) <= set(WITHOUT_BROWSER):
            only = "measure only what needs none: --only share training"
            browser = stack.enter_context(chromium(only))
        measures: dict[Part, Callable[[], dict[str, object]]] = {
            "first-picture": lambda: view_first.first_pictures(browser, material, told),
            "light-field": lambda: view_frames.light_field_frames(browser, material, told),
            "splat": lambda: view_frames.splat_frames(browser, material, told),
            "memory": lambda: view_walk.memory(browser, material, plan.walk_s, plan.seed, told),
            "share": lambda: _shares(material),
            "training": lambda: view_training.beside_training(material, told),
        }
        for part in plan.parts:
            document[part.replace("-", "_")] = measures[part]()
    return document


def _shares(material: Material) -> dict[str, object]:
    """Return sizes and losses of the recording in one file of 20 MB at most."""
    document: dict[str, object] = {}
    for kind in ("light-field", "splat"):
        out = material.folder / f"share_{kind}.html"
        shared, figures = material.share(kind, out)
        size = write_place(shared, out, CLIENT_DIR)
        document[kind.replace("-", "_")] = {"megabytes": round(size / 1e6, 2), **asdict(figures)}
    return document
