"""Do one step: a session with its scores, or 3D Gaussians of one. Runs here or in a worker."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np

from peaking.experiments.costs import took
from peaking.experiments.plan import EvaluationStep
from peaking.experiments.reconstruct import Renderer, with_gaussians
from peaking.frame import Frame, as_float
from peaking.light_field import LightField, Scratch
from peaking.metrics.psnr_ssim import psnr, ssim
from peaking.photographers.guides import AUTOMATIC, GUIDES, VIEWS
from peaking.photographers.plan import SessionStep, SplatStep
from peaking.photographers.recording import PhotoRecording
from peaking.photographers.sensor import Shot, take_frame
from peaking.photographers.session import Limits, Taken, photograph, seed_of
from peaking.photographers.tasks import TASKS, SceneName, open_scene
from peaking.selection.recorded_frames import RecordedFrames
from peaking.selection.registry import SelectionOptions, select_from
from peaking.timing import Stopwatch
from peaking.view_builder import ViewBuilder

MAX_PSNR_DB = 99.0
"""Of a picture without any difference."""


def perform(
    step: EvaluationStep, *, processor_s: Callable[[], float] = time.process_time
) -> dict[str, Any]:
    """Do a step; return plain data.

    Raises:
        TypeError: It is no step of photographers.
    """
    start_s = processor_s()
    if isinstance(step, SessionStep):
        stopwatch = Stopwatch(processor_s)
        found, rest, made = _session(step, stopwatch), "photographing", 0
    elif isinstance(step, SplatStep):
        stopwatch = Stopwatch(processor_s)
        found, rest, made = _splat(step, stopwatch), "scoring", 0
    else:
        raise TypeError(f"need a step of photographers, got {type(step).__name__}")
    total_s = processor_s() - start_s
    return {**found, "took": took(rest, total_s, stopwatch.take(), made)}


@lru_cache(maxsize=1)
def test_pictures(scene: SceneName, count: int) -> list[Frame]:
    """Return the test views of a scene, without noise."""
    drawn = open_scene(scene)
    return [
        Frame(f"test_{k}", drawn.draw(camera)[0], camera)
        for k, camera in enumerate(TASKS[scene].test_cameras(count))
    ]


def _session(step: SessionStep, stopwatch: Stopwatch) -> dict[str, Any]:
    limits: list[dict[str, Any]] = []
    taken: Taken | None = None
    largest = max(step.photos)
    for photos in step.photos:
        if GUIDES[step.guide].per_budget:
            taken = photograph(
                step.place, step.guide, step.photographer, Limits(photos, step.seconds)
            )
        elif taken is None:
            most = None if step.guide in AUTOMATIC else largest
            taken = photograph(
                step.place, step.guide, step.photographer, Limits(most, step.seconds)
            )
        kept = _kept(step, taken, photos, stopwatch)
        with stopwatch.stage("scoring"):
            scores = _scores(step, kept, stopwatch)
        limits.append(
            {
                "photos": photos,
                "taken": len(taken.shots),
                "shots": [asdict(shot) for shot in kept],
                "seconds": kept[-1].time_s if kept else 0.0,
                **scores,
            }
        )
    assert taken is not None
    path = [[round(x, 3) for x in at] for at in taken.path]
    return {"limits": limits, "path": path}


def _kept(step: SessionStep, taken: Taken, photos: int, stopwatch: Stopwatch) -> Sequence[Shot]:
    """Return the photos that count: the first ones, or the best that the policy finds."""
    if step.guide not in AUTOMATIC or len(taken.shots) <= photos:
        return taken.shots[:photos]
    with stopwatch.stage("choosing"):
        frames = _frames(step.place, step.photographer, taken.shots)
        recorded = RecordedFrames(PhotoRecording(step.place, frames), VIEWS)
        selection = SelectionOptions("peaking", num_views=photos)
        chosen = select_from(recorded.path(range(len(frames))), selection, VIEWS)
    return [taken.shots[k] for k in chosen]


def _frames(scene: SceneName, photographer: int, shots: Sequence[Shot]) -> list[Frame]:
    drawn, seed = open_scene(scene), seed_of(scene, photographer)
    return [take_frame(drawn, shot, seed) for shot in shots]


def _scores(step: SessionStep, kept: Sequence[Shot], stopwatch: Stopwatch) -> dict[str, Any]:
    builder = ViewBuilder(VIEWS)
    frames = _frames(step.place, step.photographer, kept)
    field = LightField([builder.build(frame).mpi for frame in frames], VIEWS)
    scratch = Scratch()
    return score(
        test_pictures(step.place, step.test_views),
        lambda camera: field.render(camera, scratch=scratch),
    )


def score(tests: Sequence[Frame], render: Renderer) -> dict[str, list[float]]:
    """Compare whole pictures with what a model shows, black where it shows nothing."""
    found: dict[str, list[float]] = {"psnr": [], "ssim": []}
    for test in tests:
        shown = np.clip(render(test.camera).rgba[..., :3], 0.0, 1.0)
        photo = as_float(test.rgb)
        found["psnr"].append(round(min(psnr(shown, photo), MAX_PSNR_DB), 4))
        found["ssim"].append(round(ssim(shown, photo), 5))
    return found


def _splat(step: SplatStep, stopwatch: Stopwatch) -> dict[str, Any]:
    frames = _frames(step.place, step.photographer, step.shots)
    render = with_gaussians(frames, step.splat, seed=0, stopwatch=stopwatch)
    return score(test_pictures(step.place, step.test_views), render)
