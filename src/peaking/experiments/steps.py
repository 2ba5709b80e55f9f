"""Do one step of an evaluation. Runs in this process, in a worker, or on another machine."""

from __future__ import annotations

import base64
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any

from peaking.datasets import open_recording
from peaking.datasets.mended_poses import refined
from peaking.datasets.registry import AS_FOUND, Reading
from peaking.errors import RecordingError
from peaking.experiments.costs import took
from peaking.experiments.placing import at_pose, place
from peaking.experiments.plan import ChooseStep, CountStep, EvaluationStep, PlaceStep, ScoreStep
from peaking.experiments.reconstruct import shrunk, with_gaussians, with_mpis
from peaking.experiments.scoring import Perceptual, score_views
from peaking.experiments.splits import MIN_VIEWS, split
from peaking.frame import Frame
from peaking.options import Options
from peaking.selection.recorded_frames import RecordedFrames
from peaking.selection.registry import SelectionOptions, select_from
from peaking.selection.threshold import taken_at

Found = dict[str, Any]
"""What a step found, as it is written to the cache: plain JSON. Its `took` is from `costs.took`."""

Clock = Callable[[], float]
"""In seconds."""

REST: Mapping[type[EvaluationStep], str] = {
    PlaceStep: "placing",
    CountStep: "choosing",
    ChooseStep: "choosing",
    ScoreStep: "scoring",
}
"""The kind of a step's seconds that are none of reading, generating, training, rendering."""


def perform(
    step: EvaluationStep,
    *,
    processor_s: Clock = time.process_time,
    wall_s: Clock = time.perf_counter,
) -> Found:
    """Do a step.

    Args:
        step: What to do.
        processor_s: Says what it costs.
        wall_s: Says how long it takes.

    Raises:
        RecordingError: The recording cannot be used, or has too few frames.
        PeakingError: What was asked for is not installed.
        TypeError: It is no step of an evaluation.
    """
    start_s = processor_s()
    if isinstance(step, PlaceStep):
        found, stages_ms, made = _place(step, wall_s), {}, 0
    elif not isinstance(step, CountStep | ChooseStep | ScoreStep):
        raise TypeError(f"need a step of an evaluation, got {type(step).__name__}")
    else:
        frames = _opened(
            step.scene, step.fingerprint, step.options, step.mpis, reading=step.reading
        )
        found = _done(frames, step, wall_s)
        stages_ms, made = frames.take_costs()
    if isinstance(step, ChooseStep | CountStep):
        stages_ms.pop("rendering", None)  # is a part of choosing
    total_s = processor_s() - start_s
    return {**found, "took": took(REST[type(step)], total_s, stages_ms, made)}


def _done(frames: RecordedFrames, step: CountStep | ChooseStep | ScoreStep, wall_s: Clock) -> Found:
    if isinstance(step, CountStep):
        return _count(frames, step)
    if isinstance(step, ChooseStep):
        return _choose(frames, step, wall_s)
    return _score(frames, step, wall_s)


def usable_frames(frames: RecordedFrames) -> list[int]:
    """Return the frames that can be chosen: those with depth, or all where none has depth."""
    return list(frames.with_depth) or list(range(len(frames)))


@lru_cache(maxsize=1)
def _opened(
    root: Path,
    fingerprint: str,
    options: Options,
    mpis: Path | None,
    *,
    reading: Reading = AS_FOUND,
) -> RecordedFrames:
    """Return the scene; a worker keeps the last one with its frames and MPIs.

    One of another fingerprint than was recorded is the one with mended poses.
    """
    recording = open_recording(root, reading)
    if recording.fingerprint() != fingerprint:
        recording = refined(recording)
    return RecordedFrames(recording, options, shared=mpis and mpis / fingerprint)


def _count(frames: RecordedFrames, step: CountStep) -> Found:
    candidates = split(frames, usable_frames(frames), "holdout", MIN_VIEWS).candidates
    taken = taken_at(frames.path(candidates).candidates, step.threshold_share)
    return {"count": len(taken.views)}


def _place(step: PlaceStep, wall_s: Clock) -> Found:
    start_s = wall_s()
    return {
        **asdict(place(open_recording(step.scene, step.reading))),
        "seconds": wall_s() - start_s,
    }


def _choose(frames: RecordedFrames, step: ChooseStep, wall_s: Clock) -> Found:
    start_s = wall_s()
    metres_per_rad = step.uniform_metres_per_rad
    usable = usable_frames(frames)
    parts = split(
        frames, usable, step.test_views, step.num_views, uniform_metres_per_rad=metres_per_rad
    )
    if step.strategy == "uniform" and parts.uniform is not None:
        views = list(parts.uniform)
    else:
        selection = SelectionOptions(
            policy=step.strategy,
            num_views=None if step.strategy == "all" else step.num_views,
            uniform_metres_per_rad=metres_per_rad,
            seed=step.seed,
        )
        views = select_from(frames.path(parts.candidates), selection, step.options)
    if step.strategy != "all" and len(views) != step.num_views:
        raise RecordingError(
            step.scene,
            f"{step.strategy} found {len(views)} views where {step.num_views} were asked for",
            remedy="ask for fewer (--views) or leave this strategy out (--strategies)",
        )
    return {
        "views": [int(i) for i in views],
        "test": list(parts.test),
        "seconds": wall_s() - start_s,
    }


def _score(frames: RecordedFrames, step: ScoreStep, wall_s: Clock) -> Found:
    start_s = wall_s()
    if step.splat is not None:
        with frames.stopwatch.stage("reading"):
            training, tested = _frames_of_gaussians(frames, step, step.splat.pixels)
        render = with_gaussians(training, step.splat, seed=step.seed, stopwatch=frames.stopwatch)
    else:
        render = with_mpis(frames, step.views)
        tested = [(i, frames.frame(i)) for i in step.test]
    built_s = wall_s() - start_s
    scores, pictures = score_views(tested, render, _perceptual(step))
    return {
        "scores": [asdict(score) for score in scores],
        "pictures": {str(k): base64.b64encode(jpeg).decode() for k, jpeg in pictures.items()},
        "built_seconds": built_s,
        "seconds": wall_s() - start_s,
    }


def _frames_of_gaussians(
    frames: RecordedFrames, step: ScoreStep, pixels: int
) -> tuple[list[Frame], list[tuple[int, Frame]]]:
    """Return the frames to train on, and those to test with their numbers."""
    numbers = (*step.views, *step.test)
    read = [shrunk(frames.recording.read(i), pixels) for i in numbers]
    if step.poses is not None:
        read = [at_pose(frame, pose) for frame, pose in zip(read, step.poses, strict=True)]
    count = len(step.views)
    return read[:count], list(zip(step.test, read[count:], strict=True))


def _perceptual(step: ScoreStep) -> Perceptual:
    if not step.lpips:
        return Perceptual()
    from peaking.metrics.lpips import open_lpips

    nets = {name: open_lpips(name, folder=step.lpips_folder) for name in step.lpips}
    return Perceptual(nets.get("lpips-alex"), nets.get("st-lpips-alex"))
