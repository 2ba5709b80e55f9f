"""A photographer who takes the targets of LLFF's grids, one after the other, by the arrow."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from peaking.geometry import Cam, Camera, Rigid, World
from peaking.guidance.guide import Guide, Tolerance, next_target, progress, within_reach
from peaking.guidance.plenoptic import TOLERANCE_SHARE, grid_targets
from peaking.photographers.drawn.phone import tremor
from peaking.photographers.sensor import Shot, as_numbers, blur_px
from peaking.photographers.tasks import METRES_PER_RAD, PINHOLE, Task
from peaking.photographers.temperaments import Temperament

AIM_S = 0.8
"""Mean of how long it takes to bring the phone to a target that is near."""

TRIES = 3
"""So often they try to meet it before they press anyhow."""

PRESSES_BLINDLY = 0.1
"""Of what is missed: how often a photo is taken that is nowhere near a target."""

SHUTTER_S = 0.3


def grids(task: Task, photos: int) -> Guide:
    """Return LLFF's guide for a task: a grid around every anchor, so many targets in all.

    Where a number is no square, the next larger grid is thinned out evenly.
    """
    ends = np.round(np.linspace(0, photos, len(task.anchors) + 1)).astype(int)
    targets: list[Rigid[World, Cam]] = []
    nearest_m = math.inf
    for anchor, count in zip(task.anchors, np.diff(ends).tolist(), strict=True):
        if count == 0:
            continue
        side = math.ceil(math.sqrt(count))
        pitch_m = task.area_side_m / side
        nearest_m = min(nearest_m, pitch_m)
        grid = grid_targets(task.camera(np.array(anchor)).world_from_cam, side, pitch_m)
        chosen = np.round(np.linspace(0, len(grid) - 1, count)).astype(int)
        targets += [grid[k] for k in chosen.tolist()]
    return Guide(tuple(targets), Tolerance(position_m=TOLERANCE_SHARE * nearest_m))


def walk_the_grid(
    task: Task, temperament: Temperament, photos: int, seconds: float, seed: Sequence[int]
) -> tuple[tuple[Shot, ...], tuple[tuple[float, ...], ...]]:
    """Take targets until photos or seconds are used up; return the shots and the path.

    Each next one is the nearest that is open, as the arrow says.
    """
    rng = np.random.default_rng((*seed, 4))
    guide = grids(task, photos)
    here = task.camera(rng.uniform(size=5))
    shots: list[Shot] = []
    path = [_noted(here)]
    views: list[Camera] = []
    time_s = 0.0
    while len(shots) < photos:
        taken_by = progress(guide, views).taken_by
        target = next_target(guide, here, taken_by)
        if target is None:
            break
        place = guide.targets[target]
        time_s += _far_m(here, place) / temperament.speed_m_per_s
        for _ in range(TRIES):
            time_s += rng.exponential(AIM_S)
            here = _aimed(guide, place, temperament, rng)
            if within_reach(guide, here, taken_by) is not None:
                break
        if rng.random() < PRESSES_BLINDLY * temperament.misses:
            here = task.camera(rng.uniform(size=5))
        time_s += SHUTTER_S
        if time_s > seconds:
            break
        path.append(_noted(here))
        views.append(here)
        shots.append(_shot(here, len(shots), time_s, temperament, seed))
        if within_reach(guide, here, taken_by) is None:
            views[-1] = Camera(PINHOLE, place)  # who pressed anyhow goes on to the next
    return tuple(shots), tuple(path)


def _aimed(
    guide: Guide, target: Rigid[World, Cam], temperament: Temperament, rng: np.random.Generator
) -> Camera:
    near = guide.near_enough
    sloppiness = temperament.sloppiness / math.sqrt(3)
    off_m = rng.normal(0, sloppiness * near.position_m, size=3)
    turn, _ = cv2.Rodrigues(rng.normal(0, sloppiness * near.direction_rad, size=3))
    return Camera(PINHOLE, Rigid(target.rotation @ turn, target.translation_m + off_m))


def _shot(
    camera: Camera, number: int, time_s: float, temperament: Temperament, seed: Sequence[int]
) -> Shot:
    """Return a shot of somebody who stands still, with the blur of a trembling hand."""
    tremor_seed = int(np.random.default_rng((*seed, 3)).integers(1 << 30))
    moment_s = 0.02
    moved = tremor(15 * (time_s + moment_s), tremor_seed) - tremor(15 * time_s, tremor_seed)
    turn, _ = cv2.Rodrigues(temperament.tremor_rad * moved[3:])
    pose = camera.world_from_cam
    later = Camera(
        PINHOLE,
        Rigid(pose.rotation @ turn, pose.translation_m + temperament.tremor_m * moved[:3]),
    )
    return Shot(number, time_s, as_numbers(camera), blur_px(camera, later, moment_s, 1.5))


def _far_m(here: Camera, there: Rigid[World, Cam]) -> float:
    cosine = float(np.clip(here.forward @ there.rotation[:, 2], -1, 1))
    moved_m = float(np.linalg.norm(there.translation_m - here.position_m))
    return moved_m + METRES_PER_RAD * math.acos(cosine)


def _noted(camera: Camera) -> tuple[float, ...]:
    return (*camera.position_m.tolist(), *camera.forward.tolist())
