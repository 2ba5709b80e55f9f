"""Are never seen, wrong, and "no view will help" told apart?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool

from peaking.benchmarks.trust.judge import RULES, RuleName
from peaking.benchmarks.trust.scores import ratio
from peaking.benchmarks.trust.stage import RIGHT, WRONG, Stage, apart, spread, true_error
from peaking.benchmarks.trust.steady import state_of

VIEWS_OF_AREA = 8

APART_M = 0.08
"""Views of an area are at least so far apart (a turn counts, as in `stage.apart`): nobody takes
eight pictures from one place."""

MATERIALS = {1: "mirror", 2: "glass", 3: "moving", 4: "over_exposed"}
STATES = "none", "wrong", "unseen", "unfixable"
MENDABLE = "right", "wrong", "unseen"
TRUTHS = (*MENDABLE, *MATERIALS.values())
MEANT = {"wrong": 1, "unseen": 2} | dict.fromkeys(MATERIALS.values(), 3)
"""The state (its place in `STATES`) that a kind of truth should have."""

MIN_PIXELS = 500
"""Of a kind of truth, over all pictures, for its recall to be said."""


def measure(stage: Stage) -> Iterator[dict[str, object]]:
    """Ask at held-out frames after 8 views of the area each; yield the result last, {} before it.

    The views come in the order of the recording, and each is compared before it is taken, as in
    live capture. Of mirror, glass, moving and over-exposed things only what truly looks wrong
    (FLIP) counts, and what has been seen.
    """
    counts: dict[RuleName, dict[str, list[int]]] = {
        rule: {truth: [0] * len(STATES) for truth in TRUTHS} for rule in RULES
    }
    if stage.scene.materials(stage.scene.views[0]) is None:
        yield {"confusion": None, "recall": None, "unfixable_of_mendable": None, "paper": None}
        return
    for index in spread(stage.held_out(), 2 * stage.plan.poses):
        numbers = views_of_area(stage, index)
        judge = stage.judge(numbers[:1])
        for number in numbers[1:]:
            taken = stage.frame(number)
            judge.compare(taken.rgb, taken.camera, depth_m=taken.depth_m)
            judge.capture(stage.view(number))
        frame = stage.frame(index)
        said = judge.compare(frame.rgb, frame.camera, depth_m=frame.depth_m)
        seen, known = stage.seen_truth(numbers, index)
        materials = stage.materials(index)
        plain = known & (materials == 0)
        error = true_error(judge.render(frame.camera), frame.rgb, seen & plain)
        truths: dict[str, Bool[np.ndarray, "h w"]] = {
            "right": plain & seen & (error <= RIGHT),
            "wrong": plain & seen & (error >= WRONG),
            "unseen": plain & ~seen,
        }
        for label, name in MATERIALS.items():
            truths[name] = (materials == label) & (error >= WRONG)
        for rule in RULES:
            state = state_of(said[rule])
            for truth, where in truths.items():
                found = np.bincount(state[where], minlength=len(STATES))
                counts[rule][truth] = (np.array(counts[rule][truth]) + found).tolist()
        yield {}
    yield {**_result(counts["ours"]), "paper": _result(counts["paper"])}


def views_of_area(stage: Stage, index: int) -> tuple[int, ...]:
    """Return the nearest views of a frame that are not from one place, in the recording's order."""
    here = stage.camera(index)
    chosen: list[int] = []
    for number in sorted(stage.scene.views, key=lambda i: apart(stage.camera(i), here)):
        away = [apart(stage.camera(number), stage.camera(other)) for other in (*chosen, index)]
        if min(away) >= APART_M and len(chosen) < VIEWS_OF_AREA:
            chosen.append(number)
    return tuple(sorted(chosen or stage.scene.views[:1]))


def _result(counts: dict[str, list[int]]) -> dict[str, object]:
    mendable = np.sum([counts[truth] for truth in MENDABLE], axis=0)
    to_mend = np.sum([counts[truth] for truth in ("wrong", "unseen")], axis=0)
    return {
        "confusion": {
            truth: dict(zip(STATES, found, strict=True)) for truth, found in counts.items()
        },
        "recall": {truth: _recall(counts[truth], MEANT[truth]) for truth in MEANT},
        "unfixable_of_mendable": ratio(int(to_mend[3]), int(to_mend.sum())),
        "unfixable_of_plain": ratio(int(mendable[3]), int(mendable.sum())),
    }


def _recall(found: list[int], meant: int) -> float | None:
    return found[meant] / sum(found) if sum(found) >= MIN_PIXELS else None
