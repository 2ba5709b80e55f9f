"""Whether the score of a capture ranks sets of views as their quality does where none was taken.

Of each recording, sets of views of several kinds and sizes are made. Each set gets its score (the
walk is that of the recording), and is shown the frames held out. What is asked is the rank
correlation of the two: over all sets, and among sets of equal number, which a count would not rank.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from peaking.datasets import open_recording
from peaking.experiments.splits import Split, budgets, split
from peaking.guidance.watch import Watch, small_views
from peaking.metrics.psnr_ssim import psnr
from peaking.options import DEFAULT, Options, PolicyName
from peaking.selection.recorded_frames import RecordedFrames
from peaking.selection.registry import SelectionOptions, select_from

POLICIES: tuple[PolicyName, ...] = ("uniform", "threshold", "farthest", "coverage", "peaking")
DRAWN = 4
"""Random sets of each size, and as many clustered ones: of a part of the walk."""

MIN_SET = 4
CLUSTERED = (1.2, 4.0)
"""A part of the walk that is drawn from has so many times the frames of the set."""

MAX_FRAMES = 120
"""Of a longer recording, evenly chosen frames are looked at."""

MAX_PSNR_DB = 99.0


@dataclass(frozen=True)
class ViewSet:
    """Some views of a recording.

    Attributes:
        kind: How they were chosen.
        views: Their numbers, in order.
    """

    kind: str
    views: tuple[int, ...]


def measure_scenes(
    scenes: Sequence[Path],
    *,
    options: Options = DEFAULT,
    seed: int = 0,
    told: Callable[[str, int, int], object] = lambda _scene, _done, _all: None,
) -> dict[str, object]:
    """Measure, and return the results file.

    Args:
        scenes: Recordings with depth.
        options: How views are shown; of small pictures (`watch.small_views`).
        seed: Of the sets that are drawn.
        told: Is told the scene, how many of its sets are done, and of how many.

    Raises:
        RecordingError: A scene cannot be opened, or too few of its frames have depth.
    """
    small = small_views(options)
    results: list[dict[str, Any]] = []
    for scene in scenes:
        recording = open_recording(scene)
        frames = RecordedFrames(recording, small, max_mpis=400)
        every = -(-len(frames.with_depth) // MAX_FRAMES)
        parts = split(frames, frames.with_depth[::every], "holdout", MIN_SET)
        rng = np.random.default_rng(seed)
        sets = view_sets(frames, parts, rng)
        rows: list[dict[str, Any]] = []
        for done, one in enumerate(sets):
            told(recording.name, done, len(sets))
            rows.append(_measured(frames, parts, one))
        results.append({"scene": recording.name, **correlations(rows), "sets": rows})
    return {"options": small.as_dict(), "seed": seed, "scenes": results}


def view_sets(frames: RecordedFrames, parts: Split, rng: np.random.Generator) -> list[ViewSet]:
    """Return sets of a few, more and many views, of each kind."""
    candidates = np.array(parts.candidates)
    found: list[ViewSet] = []
    for count in sorted({max(MIN_SET, count) for count in budgets(len(candidates))}):
        for _ in range(DRAWN):
            chosen = rng.choice(candidates, count, replace=False)
            found.append(ViewSet("random", tuple(sorted(chosen.tolist()))))
            span = min(len(candidates), int(count * rng.uniform(*CLUSTERED)) + 1)
            begin = int(rng.integers(0, len(candidates) - span + 1))
            chosen = rng.choice(candidates[begin : begin + span], count, replace=False)
            found.append(ViewSet("clustered", tuple(sorted(chosen.tolist()))))
        for policy in POLICIES:
            selection = SelectionOptions(policy, num_views=count)
            path = frames.path(parts.candidates)
            chosen_by = select_from(path, selection, frames.options)
            found.append(ViewSet(policy, tuple(sorted(chosen_by))))
    return found


def correlations(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the rank correlations of score and quality of the sets of a scene."""
    counts = sorted({row["count"] for row in rows})
    quality = np.array([row["psnr_db"] for row in rows])
    score = np.array([row["score"] for row in rows])
    equal = {
        count: spearman(*(x[[row["count"] == count for row in rows]] for x in (score, quality)))
        for count in counts
    }
    return {
        "spearman_all": spearman(score, quality),
        "spearman_equal_count": float(np.mean(list(equal.values()))),
        "spearman_by_count": equal,
    }


def spearman(a: Float64[np.ndarray, "n"], b: Float64[np.ndarray, "n"]) -> float:
    """Return Spearman's rank correlation, with mean ranks of ties; 0 where nothing varies."""
    ranks_a, ranks_b = _ranks(a), _ranks(b)
    if ranks_a.std() == 0 or ranks_b.std() == 0:
        return 0.0
    return float(np.corrcoef(ranks_a, ranks_b)[0, 1])


def _ranks(values: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    below = (values[None] < values[:, None]).sum(axis=1)
    same = (values[None] == values[:, None]).sum(axis=1)
    return below + (same - 1) / 2


def _measured(frames: RecordedFrames, parts: Split, one: ViewSet) -> dict[str, Any]:
    mpis = [frames.mpi(i) for i in one.views]
    walk = [frames.cameras[i].world_from_cam for i in parts.candidates]
    began_s = time.process_time()
    score = Watch(frames.options).advise(mpis, walk).score
    took_s = time.process_time() - began_s
    return {
        "kind": one.kind,
        "count": len(one.views),
        "score": score,
        "psnr_db": _quality_db(frames, parts, one),
        "from_scratch_s": took_s,
    }


def _quality_db(frames: RecordedFrames, parts: Split, one: ViewSet) -> float:
    """Return the mean PSNR of frames held out."""
    found: list[float] = []
    for number in parts.test:
        frame = frames.frame(number)
        shown = np.clip(frames.render(one.views, frame.camera).rgba[..., :3], 0.0, 1.0)
        photo = frame.rgb.astype(np.float32) / np.float32(255.0)
        found.append(min(psnr(shown, photo, frame.mask), MAX_PSNR_DB))
    return float(np.mean(found))
