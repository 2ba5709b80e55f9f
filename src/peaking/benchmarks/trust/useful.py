"""Does a view help where it is red?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from peaking.benchmarks.trust.judge import RULES
from peaking.benchmarks.trust.scores import mean, pearson, ratio, region_means
from peaking.benchmarks.trust.stage import Stage, angle_rad, distance_m, spread, true_error

COLUMNS, ROWS = 8, 16
"""Regions of an upright picture; of one that lies, the other way round."""

VIEWS_BEFORE = 8

STEP_M = 0.04, 0.20
"""How far from the new view it is measured: nearer than that it would be asked about itself."""

MAX_TURN_RAD = float(np.deg2rad(20.0))

MEASURED_AT = 2
"""Frames around each new view."""


def measure(stage: Stage) -> Iterator[dict[str, object]]:
    """Add views one at a time to the same eight; yield the result last, {} before it.

    At frames a few steps from the new view: what asks for a view in a region before (red and never
    seen; the paper's red is both), and how much the region's true error (FLIP) falls. `wrong_only`
    is red alone, in regions of which everything has been seen.
    """
    before = stage.views(VIEWS_BEFORE)
    judge = stage.judge(before)
    marked: dict[str, list[float]] = {rule: [] for rule in RULES}
    red: dict[str, list[float]] = {rule: [] for rule in RULES}
    falls: list[float] = []
    falls_of_seen: list[float] = []
    added = 0
    for index in spread([i for i in every(stage) if i not in before], stage.plan.steps):
        near = measured_at(stage, index)
        after = stage.judge((*before, index) if near else before)
        added += bool(near)
        for other in near:
            frame = stage.frame(other)
            said = judge.compare(frame.rgb, frame.camera, depth_m=frame.depth_m)
            height, width = frame.rgb.shape[:2]
            grid = (ROWS, COLUMNS) if height >= width else (COLUMNS, ROWS)
            seen, known = stage.seen_truth(before, other)
            everywhere = np.ones_like(known)
            errors = [
                true_error(j.render(frame.camera), frame.rgb, seen & known) for j in (judge, after)
            ]
            fall = region_means(errors[0] - errors[1], everywhere, *grid)[0].ravel()
            unseen = region_means((~seen & known).astype(np.float64), everywhere, *grid)[0].ravel()
            whole = unseen == 0
            falls += fall.tolist()
            falls_of_seen += fall[whole].tolist()
            for rule in RULES:
                asks = region_means(said[rule].marked.astype(np.float64), everywhere, *grid)[0]
                only = region_means(said[rule].red.astype(np.float64), everywhere, *grid)[0]
                marked[rule] += asks.ravel().tolist()
                red[rule] += only.ravel()[whole].tolist()
        yield {}
    results = {
        rule: {
            "pearson": pearson(marked[rule], falls),
            "pearson_wrong_only": pearson(red[rule], falls_of_seen),
            "marked_share": mean(marked[rule]),
        }
        for rule in RULES
    }
    helped = sum(fall > 0 for fall in falls)
    yield {
        "views_added": added,
        "regions": len(falls),
        "regions_helped": ratio(helped, len(falls)),
        **results["ours"],
        "paper": results["paper"],
    }


def every(stage: Stage) -> list[int]:
    """Return every frame that can become a view, in the order of the recording."""
    return sorted({*stage.scene.views, *stage.scene.held_out})


def measured_at(stage: Stage, index: int) -> list[int]:
    """Return frames that are a few steps from a frame and look the same way."""
    here = stage.camera(index)
    near = [
        i
        for i in every(stage)
        if STEP_M[0] <= distance_m(stage.camera(i), here) <= STEP_M[1]
        and angle_rad(stage.camera(i), here) <= MAX_TURN_RAD
    ]
    near.sort(key=lambda i: abs(i - index))
    return near[:MEASURED_AT]
