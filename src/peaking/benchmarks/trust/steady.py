"""Does what is marked stay as it is, while nothing happens but a hand that moves?"""

# Some functions of NumPy and OpenCV have types that pyright cannot resolve.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.benchmarks.trust.judge import RULES, Judgement
from peaking.benchmarks.trust.scores import mean
from peaking.benchmarks.trust.stage import Stage, distance_m
from peaking.geometry import Camera

MAX_STEP_M = 0.02
"""Frames farther apart are not consecutive."""

RATE_HZ = 30.0

SAME_SURFACE = 0.02
"""Part of the depth within which a point of one frame is the same in the next."""

MIN_COMMON = 0.5
"""Share of the picture that two frames must have in common to be compared."""

VIEWS_BEFORE = 8


def measure(stage: Stage) -> Iterator[dict[str, object]]:
    """Walk along consecutive frames; yield the result last, {} before it.

    States (none, red, never seen, no view will help) are compared on the surface: a pixel with the
    pixel of the frame before that shows the same point, by the true depth. So only what both
    frames see counts, and nothing is newly seen.
    """
    paths = stretches(stage)
    if not paths:
        yield {"pairs": 0, **_nothing(), "paper": _nothing()}
        return
    judge = stage.judge(stage.views(VIEWS_BEFORE))
    changes: dict[str, list[float]] = {rule: [] for rule in RULES}
    jumps: dict[str, list[float]] = {rule: [] for rule in RULES}
    for path in paths:
        before: tuple[int, dict[str, UInt8[np.ndarray, "h w"]]] | None = None
        for index in path:
            frame = stage.frame(index)
            said = judge.compare(frame.rgb, frame.camera, depth_m=frame.depth_m)
            states = {rule: state_of(said[rule]) for rule in RULES}
            if before is not None:
                last, old_states = before
                sources_px, common = same_points(
                    stage.depth_m(index),
                    frame.camera,
                    stage.depth_m(last),
                    stage.frame(last).camera,
                )
                if common.mean() >= MIN_COMMON:
                    for rule in RULES:
                        old = _moved(old_states[rule], sources_px)[common]
                        new = states[rule][common]
                        changes[rule].append(RATE_HZ * float((old != new).mean()))
                        shown = [float((state > 0).mean()) for state in (old, new)]
                        jumps[rule].append(100 * abs(shown[1] - shown[0]))
            before = index, states
            yield {}
    results = {rule: _result(changes[rule], jumps[rule]) for rule in RULES}
    yield {"pairs": len(changes["ours"]), **results["ours"], "paper": results["paper"]}


def stretches(stage: Stage) -> list[list[int]]:
    """Return runs of consecutive frames that are close together, as many as the plan says.

    Half of the frames are from the captured part, half from the end of the path, where there is
    as much.
    """
    numbers = sorted({*stage.scene.views, *stage.scene.held_out})
    runs: list[list[int]] = []
    for number in numbers:
        close = (
            bool(runs)
            and runs[-1][-1] == number - 1
            and distance_m(stage.camera(number - 1), stage.camera(number)) <= MAX_STEP_M
        )
        if close:
            runs[-1].append(number)
        else:
            runs.append([number])
    length = stage.plan.frames // 2
    pieces = [
        run[start : start + length]
        for run in runs
        for start in range(0, len(run), length)
        if len(run[start : start + length]) >= 3
    ]
    if len(pieces) <= 2:
        return pieces
    return [pieces[len(pieces) // 3], pieces[-1]]


def state_of(said: Judgement) -> UInt8[np.ndarray, "h w"]:
    """Return 0 none, 1 red, 2 never seen, 3 no view will help."""
    state = said.red.astype(np.uint8)
    state[said.unseen] = 2
    state[said.unfixable] = 3
    return state


def same_points(
    depth_m: Float32[np.ndarray, "h w"],
    camera: Camera,
    other_m: Float32[np.ndarray, "h w"],
    other: Camera,
) -> tuple[Float32[np.ndarray, "h w 2"], Bool[np.ndarray, "h w"]]:
    """Return where each pixel's point is in another frame (as `cv2.remap` counts).

    Returns:
        The places, and where the other frame shows the same point, by both depths.
    """
    rays = camera.pinhole.rays()
    points_m = camera.world_from_cam.apply(rays * depth_m[..., None].astype(np.float64))
    xy_px, there_m = other.project(points_m)
    sources_px = np.nan_to_num(xy_px - 0.5, nan=-10.0).astype(np.float32)
    found_m = cv2.remap(
        other_m, sources_px[..., 0], sources_px[..., 1], cv2.INTER_NEAREST, borderValue=0
    )
    same = np.abs(found_m - there_m) <= SAME_SURFACE * there_m
    return sources_px, (depth_m > 0) & (found_m > 0) & same


def _moved(
    state: UInt8[np.ndarray, "h w"], sources_px: Float32[np.ndarray, "h w 2"]
) -> UInt8[np.ndarray, "h w"]:
    moved = cv2.remap(state, sources_px[..., 0], sources_px[..., 1], cv2.INTER_NEAREST)
    return np.asarray(moved, np.uint8)


def _result(changes: list[float], jumps: list[float]) -> dict[str, float | None]:
    return {
        "changes_per_s": mean(changes),
        "largest_jump_pp": max(jumps, default=None),
        "median_jump_pp": float(np.median(jumps)) if jumps else None,
    }


def _nothing() -> dict[str, float | None]:
    return _result([], [])
