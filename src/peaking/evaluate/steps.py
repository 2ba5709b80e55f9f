"""Do one step of an evaluation. Runs in this process, in a worker, or on another machine."""

from __future__ import annotations

import base64
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from peaking.datasets.nerfstudio import open_recording
from peaking.errors import RecordingError
from peaking.evaluate.costs import took
from peaking.evaluate.placing import at_pose, place
from peaking.evaluate.plan import ChooseStep, CountStep, PlaceStep, ScoreStep, Step
from peaking.evaluate.reconstruct import shrunk, with_gaussians, with_mpis
from peaking.evaluate.scene import Scene
from peaking.evaluate.scoring import Perceptual, score_views
from peaking.evaluate.splits import LEAST_VIEWS, split
from peaking.evaluate.strategies import STRATEGIES
from peaking.evaluate.strategies.threshold import walk
from peaking.evaluate.strategies.uniform import uniform
from peaking.frame import Frame
from peaking.presets import Options

Found = dict[str, Any]
"""What a step found, as it is written to the cache: plain JSON. Its `took` is from `costs.took`."""

Clock = Callable[[], float]
"""In seconds."""

REST: Mapping[type[Step], str] = {
    PlaceStep: "placing",
    CountStep: "choosing",
    ChooseStep: "choosing",
    ScoreStep: "scoring",
}
"""The kind of a step's seconds that are none of reading, generating, training, rendering."""


def perform(
    step: Step, *, processor_s: Clock = time.process_time, wall_s: Clock = time.perf_counter
) -> Found:
    """Do a step.

    Args:
        step: What to do.
        processor_s: Says what it costs.
        wall_s: Says how long it takes.

    Raises:
        RecordingError: The recording cannot be used, or has too few frames.
        PeakingError: What was asked for is not installed.
    """
    start_s = processor_s()
    if isinstance(step, PlaceStep):
        found, stages_ms, made = _place(step, wall_s), {}, 0
    else:
        scene = _opened(step.scene, step.fingerprint, step.options, step.mpis)
        found = _done(scene, step, wall_s)
        stages_ms, made = scene.take_costs()
    if isinstance(step, ChooseStep | CountStep):
        stages_ms.pop("rendering", None)  # is a part of choosing
    total_s = processor_s() - start_s
    return {**found, "took": took(REST[type(step)], total_s, stages_ms, made)}


def _done(scene: Scene, step: CountStep | ChooseStep | ScoreStep, wall_s: Clock) -> Found:
    if isinstance(step, CountStep):
        return _count(scene, step)
    if isinstance(step, ChooseStep):
        return _choose(scene, step, wall_s)
    return _score(scene, step, wall_s)


def usable_frames(scene: Scene) -> list[int]:
    """Return the frames that can be chosen: those with depth, or all where none has depth."""
    return list(scene.with_depth) or list(range(len(scene)))


@lru_cache(maxsize=1)
def _opened(root: Path, fingerprint: str, options: Options, mpis: Path | None) -> Scene:
    """Return the scene; a worker keeps the last one with its frames and MPIs."""
    return Scene(open_recording(root), options, shared=mpis and mpis / fingerprint)


def _count(scene: Scene, step: CountStep) -> Found:
    frames = split(scene, usable_frames(scene), "holdout", LEAST_VIEWS)
    most = len(frames.candidates)
    taken = walk(scene, frames.candidates, step.threshold_share, most=most)
    return {"count": len(taken.views)}


def _place(step: PlaceStep, wall_s: Clock) -> Found:
    start_s = wall_s()
    return {
        **asdict(place(open_recording(step.scene))),
        "seconds": wall_s() - start_s,
    }


def _choose(scene: Scene, step: ChooseStep, wall_s: Clock) -> Found:
    start_s = wall_s()
    metres_per_rad = step.uniform_metres_per_rad
    usable = usable_frames(scene)
    frames = split(
        scene, usable, step.test_views, step.num_views, uniform_metres_per_rad=metres_per_rad
    )
    if step.strategy == "uniform" and frames.uniform is not None:
        views = list(frames.uniform)
    else:
        rng = np.random.default_rng([step.seed, step.num_views])
        choose = STRATEGIES[step.strategy]
        if step.strategy == "uniform":
            choose = partial(uniform, metres_per_rad=metres_per_rad)
        views = choose(scene, frames.candidates, step.num_views, rng)
    if step.strategy != "all" and len(views) != step.num_views:
        raise RecordingError(
            step.scene,
            f"{step.strategy} found {len(views)} views where {step.num_views} were asked for",
            remedy="ask for fewer (--views) or leave this strategy out (--strategies)",
        )
    return {
        "views": [int(i) for i in views],
        "test": list(frames.test),
        "seconds": wall_s() - start_s,
    }


def _score(scene: Scene, step: ScoreStep, wall_s: Clock) -> Found:
    start_s = wall_s()
    if step.splat is not None:
        with scene.stopwatch.stage("reading"):
            training, tested = _frames_of_gaussians(scene, step, step.splat.pixels)
        render = with_gaussians(training, step.splat, seed=step.seed, stopwatch=scene.stopwatch)
    else:
        render = with_mpis(scene, step.views)
        tested = [(i, scene.frame(i)) for i in step.test]
    built_s = wall_s() - start_s
    scores, pictures = score_views(tested, render, _perceptual(step))
    return {
        "scores": [asdict(score) for score in scores],
        "pictures": {str(k): base64.b64encode(jpeg).decode() for k, jpeg in pictures.items()},
        "built_seconds": built_s,
        "seconds": wall_s() - start_s,
    }


def _frames_of_gaussians(
    scene: Scene, step: ScoreStep, pixels: int
) -> tuple[list[Frame], list[tuple[int, Frame]]]:
    """Return the frames to train on, and those to test with their numbers."""
    numbers = (*step.views, *step.test)
    frames = [shrunk(scene.recording.read(i), pixels) for i in numbers]
    if step.poses is not None:
        frames = [at_pose(frame, pose) for frame, pose in zip(frames, step.poses, strict=True)]
    count = len(step.views)
    return frames[:count], list(zip(step.test, frames[count:], strict=True))


def _perceptual(step: ScoreStep) -> Perceptual:
    if not step.lpips:
        return Perceptual()
    from peaking.evaluate.lpips import open_lpips

    nets = {name: open_lpips(name, folder=step.lpips_folder) for name in step.lpips}
    return Perceptual(nets.get("lpips-alex"), nets.get("st-lpips-alex"))
