"""How far off are poses before and after correction, and how red is it?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from peaking.benchmarks.trust.disturbances import moved
from peaking.benchmarks.trust.judge import RULES
from peaking.benchmarks.trust.scores import mean
from peaking.benchmarks.trust.stage import VIEWS, Stage, angle_rad, distance_m
from peaking.geometry import Camera


def measure(stage: Stage) -> Iterator[dict[str, object]]:
    """Compare photographs at recorded, disturbed and corrected poses; yield the result last.

    The recorded pose is the truth, which real recordings have to a few millimetres only.
    """
    numbers = stage.views(VIEWS)
    judge = stage.judge(numbers)
    red: dict[str, dict[str, list[float]]] = {
        rule: {"recorded": [], "disturbed": [], "corrected": []} for rule in RULES
    }
    off: dict[str, list[tuple[float, float]]] = {"disturbed": [], "corrected": []}
    lost = 0
    for index in stage.close_to(numbers, 2 * stage.plan.poses):
        frame = stage.frame(index)
        told = moved(frame.camera, stage.rng("pose", index))
        corrected = judge.corrected(frame.rgb, told)
        cameras = {"recorded": frame.camera, "disturbed": told, "corrected": corrected}
        lost += corrected is None
        for name, camera in cameras.items():
            if camera is None:
                continue
            said = judge.compare(frame.rgb, camera, depth_m=frame.depth_m, corrects=False)
            for rule in RULES:
                red[rule][name].append(float(said[rule].red.mean()))
            if name in off:
                off[name].append(_apart(camera, frame.camera))
        yield {}
    poses = len(red["ours"]["recorded"])
    tracked = bool(off["corrected"])
    yield {
        "poses": poses,
        "lost": lost if tracked else None,
        "red": {name: mean(shares) for name, shares in red["ours"].items()},
        "error_mm": {name: _median(found, 0) for name, found in off.items()},
        "error_deg": {name: _median(found, 1) for name, found in off.items()},
        "paper": {"red": {name: mean(shares) for name, shares in red["paper"].items()}},
    }


def _apart(a: Camera, b: Camera) -> tuple[float, float]:
    return 1e3 * distance_m(a, b), float(np.rad2deg(angle_rad(a, b)))


def _median(found: list[tuple[float, float]], which: int) -> float | None:
    return float(np.median([one[which] for one in found])) if found else None
