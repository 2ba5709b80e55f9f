"""Is anything red although nothing is wrong, but for what a camera does?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, UInt8

from peaking.benchmarks.trust.disturbances import (
    ALL,
    DISTURBANCES,
    Turn,
    disturbance,
    moved,
    photographed,
)
from peaking.benchmarks.trust.judge import RULES, Judge
from peaking.benchmarks.trust.scores import mean
from peaking.benchmarks.trust.stage import COVERED, VIEWS, Stage, as_picture, shrunk
from peaking.geometry import Camera

RIM_PX = 8
"""Around holes of the rendering and along the picture's border nothing counts: a pose that is off
moves them."""

NAMES = (*DISTURBANCES, ALL)


@dataclass(frozen=True)
class Question:
    """A true picture, disturbed.

    Attributes:
        name: Of the disturbance.
        live: The model's own rendering, as a camera would have taken it.
        told: Where the device says it was taken.
        counted: What the model covers: nothing of it is wrong.
    """

    name: str
    live: UInt8[np.ndarray, "h w 3"]
    told: Camera
    counted: Bool[np.ndarray, "h w"]


def measure(stage: Stage) -> Iterator[dict[str, object]]:
    """Compare true pictures with the model; yield the result last, {} before it."""
    numbers = stage.views(VIEWS)
    judge = stage.judge(numbers)
    shares: dict[str, dict[str, list[float]]] = {rule: {n: [] for n in NAMES} for rule in RULES}
    poses = stage.close_to(numbers, stage.plan.poses)
    for index in poses:
        for question in questions(stage, judge, index):
            said = judge.compare(question.live, question.told)
            for rule in RULES:
                red = said[rule].red[question.counted]
                shares[rule][question.name].append(float(red.mean()) if red.size else 0.0)
        yield {}
    results = {rule: _result(shares[rule]) for rule in RULES}
    yield {"poses": len(poses), **results["ours"], "paper": results["paper"]}


def questions(stage: Stage, judge: Judge, index: int) -> Iterator[Question]:
    """Yield the picture of a held-out pose under every disturbance."""
    camera = stage.frame(index).camera
    rendering = judge.render(camera)
    picture = as_picture(rendering)
    counted = shrunk(rendering.alpha >= COVERED, RIM_PX)
    counted[:RIM_PX], counted[-RIM_PX:], counted[:, :RIM_PX], counted[:, -RIM_PX:] = (False,) * 4
    for name in NAMES:
        rng = stage.rng("false_red", index, name)
        what = disturbance(name, rng)
        told = moved(camera, rng) if what.moved else camera
        shown = rendered_in_turn(judge, Turn.drawn(rng), camera) if what.rolling else picture
        yield Question(name, photographed(shown, what, rng), told, counted)


def rendered_in_turn(judge: Judge, turn: Turn, camera: Camera) -> UInt8[np.ndarray, "h w 3"]:
    """Render rows as a camera reads them, one after the other."""
    strips = judge.render_strips(camera, turn.strips(camera))
    return np.concatenate([as_picture(strip) for strip in strips])


def _result(shares: dict[str, list[float]]) -> dict[str, object]:
    means = {name: mean(values) for name, values in shares.items()}
    worst = max((value for value in means.values() if value is not None), default=None)
    return {"shares": means, "worst": worst}
