"""How the score of captures is judged: rank correlations by hand, sets of the size they say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from peaking.benchmarks import guidance
from peaking.benchmarks.guidance import DRAWN, POLICIES, correlations, spearman, view_sets
from peaking.datasets import open_recording
from peaking.experiments.splits import Split
from peaking.guidance.watch import small_views
from peaking.options import DEFAULT
from peaking.selection.recorded_frames import RecordedFrames
from peaking.selection.registry import SelectionOptions

DESK = Path(__file__).parents[2] / "scenes" / "desk"


def numbers(*values: float) -> np.ndarray:
    return np.array(values, np.float64)


def test_ranks_alone_count() -> None:
    assert spearman(numbers(1, 2, 3), numbers(1, 10, 1000)) == pytest.approx(1)
    assert spearman(numbers(1, 2, 3), numbers(3, 2, 1)) == pytest.approx(-1)
    # By hand: ranks 0 1 2 3 and 1 0 3 2, 1 - 6 · 4 / (4 · 15).
    assert spearman(numbers(1, 2, 3, 4), numbers(2, 1, 4, 3)) == pytest.approx(0.6)


def test_ties_have_the_mean_of_their_ranks() -> None:
    """By hand: ranks 0.5 0.5 2 and 0 1 2, so 1.5 / √(1.5 · 2)."""
    assert spearman(numbers(5, 5, 7), numbers(1, 2, 3)) == pytest.approx(1.5 / 3**0.5)
    assert spearman(numbers(1, 1, 1), numbers(1, 2, 3)) == 0


def test_a_score_that_counts_views_ranks_none_of_equal_number() -> None:
    rows = [
        {"count": count, "score": count / 10, "psnr_db": 10.0 * count + k}
        for count in (4, 8)
        for k in range(3)
    ]
    found = correlations(rows)
    assert found["spearman_all"] > 0.8
    assert found["spearman_equal_count"] == 0
    assert found["spearman_by_count"] == {4: 0, 8: 0}


def test_sets_of_each_size_have_that_many_views(monkeypatch: pytest.MonkeyPatch) -> None:
    def first(path: object, selection: SelectionOptions, options: object) -> list[int]:
        return list(range(selection.num_views or 0))

    monkeypatch.setattr(guidance, "select_from", first)
    frames = RecordedFrames(open_recording(DESK), small_views(DEFAULT))
    candidates = tuple(range(80))
    sets = view_sets(frames, Split(candidates, ()), np.random.default_rng(3))
    sizes = sorted({len(one.views) for one in sets})
    assert sizes == [4, 8, 16]
    for size in sizes:
        same = [one for one in sets if len(one.views) == size]
        assert len(same) == 2 * DRAWN + len(POLICIES)
        for one in same:
            assert list(one.views) == sorted(set(one.views))
            assert set(one.views) <= set(candidates)
            if one.kind == "clustered":
                assert one.views[-1] - one.views[0] <= 4 * size + 1
