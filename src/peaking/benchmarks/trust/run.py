"""All measures of all scenes, in turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Literal, get_args

from peaking.benchmarks.trust import (
    classes,
    false_red,
    pose,
    seen,
    steady,
    true_red,
    useful,
)
from peaking.benchmarks.trust.scene import open_trust_scene
from peaking.benchmarks.trust.stage import Plan, Stage
from peaking.options import DEFAULT, Options

MeasureName = Literal["seen", "false_red", "true_red", "useful", "steady", "classes", "pose"]
MEASURE_NAMES: tuple[MeasureName, ...] = get_args(MeasureName)

Measure = Callable[[Stage], Iterator[dict[str, object]]]
MEASURES: Mapping[MeasureName, Measure] = {
    "seen": seen.measure,
    "false_red": false_red.measure,
    "true_red": true_red.measure,
    "useful": useful.measure,
    "steady": steady.measure,
    "classes": classes.measure,
    "pose": pose.measure,
}


def measure_scenes(
    scenes: Sequence[Path],
    *,
    only: Sequence[MeasureName] = MEASURE_NAMES,
    plan: Plan | None = None,
    options: Options = DEFAULT,
    told: Callable[[str, MeasureName, int], object] = lambda _scene, _measure, _step: None,
) -> dict[str, object]:
    """Measure, and return the results file.

    Args:
        scenes: Recordings with depth.
        only: What is measured.
        plan: How much.
        options: Of the method, the same for all scenes.
        told: Is told the scene, the measure and its step after every step.

    Raises:
        RecordingError: A scene cannot be opened, or too few of its frames have depth.
    """
    opened = [open_trust_scene(scene) for scene in scenes]
    results: list[dict[str, object]] = []
    for scene in opened:
        stage = Stage(scene, options, plan=plan)
        name = scene.recording.name
        result: dict[str, object] = {"scene": name}
        for measure in only:
            for step, found in enumerate(MEASURES[measure](stage)):
                told(name, measure, step)
                result[measure] = found
        results.append(result)
    return {"options": options.as_dict(), "plan": asdict(plan or Plan()), "scenes": results}
