"""A capture that grows: the score rises, what did not change is not computed again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from peaking.guidance.foresight import SmallViews
from peaking.guidance.watch import MAX_LEFT, WALKED, Watch, small_views
from peaking.mpi import Mpi
from peaking.options import DEFAULT
from test_memory import camera, view

OPTIONS = replace(DEFAULT, pixels=96 * 72)
WALK = [camera(0.05 * k).world_from_cam for k in range(25)]
"""1.2 m to the right."""


@pytest.fixture(scope="module")
def mpis() -> list[Mpi]:
    return [view(camera(x_m)) for x_m in (0.0, 0.4, 0.8, 1.2)]


def test_with_more_views_of_a_walk_the_score_rises(mpis: list[Mpi]) -> None:
    watch = Watch(OPTIONS)
    scores = [watch.advise(mpis[:count], WALK).score for count in (1, 2, 3, 4)]
    assert scores == sorted(scores)
    assert scores[0] < 0.7
    assert 0.8 < scores[-1] <= 1.0


def test_of_as_many_views_those_that_cover_the_walk_score_higher(mpis: list[Mpi]) -> None:
    apart = Watch(OPTIONS).advise([mpis[0], mpis[3]], WALK).score
    together = Watch(OPTIONS).advise([mpis[0], view(camera(0.03))], WALK).score
    assert apart > together


def test_the_photographer_is_sent_where_views_are_missing(mpis: list[Mpi]) -> None:
    advice = Watch(OPTIONS).advise(mpis[:1], WALK)
    assert advice.verdict == "go on"
    assert advice.next is not None
    assert advice.next.camera.position_m[0] > 0.2
    assert 1 <= len(advice.left) <= MAX_LEFT
    assert advice.surface_m.shape[0] > 20


def test_a_view_taken_where_it_was_suggested_leaves_less(mpis: list[Mpi]) -> None:
    watch = Watch(OPTIONS)
    before = watch.advise(mpis[:1], WALK)
    assert before.next is not None
    there = before.next.camera.world_from_cam
    taken = view(replace(camera(0.0), world_from_cam=there))
    after = watch.advise([mpis[0], taken], WALK)
    assert after.score > before.score
    assert after.next is None or not np.allclose(
        after.next.camera.position_m, before.next.camera.position_m
    )


def test_walking_alone_does_not_change_a_suggestion(mpis: list[Mpi]) -> None:
    """It is on its way there that the photographer walks."""
    watch = Watch(OPTIONS)
    first = watch.advise(mpis[:1], WALK[:2]).next
    assert first is not None
    for k in range(1, 6):
        way = np.linspace(WALK[1].translation_m, first.camera.position_m, 6)[: k + 1]
        walked = [replace(WALK[0], translation_m=place) for place in way]
        now = watch.advise(mpis[:1], [*WALK[:2], *walked]).next
        assert now is not None
        np.testing.assert_allclose(now.camera.position_m, first.camera.position_m)


def test_what_did_not_change_is_not_computed_again(
    mpis: list[Mpi], monkeypatch: pytest.MonkeyPatch
) -> None:
    foresee, asked = SmallViews.foresee, [0]

    def counted(*args: object, **kwargs: object) -> object:
        asked[0] += 1
        return foresee(*args, **kwargs)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(SmallViews, "foresee", counted)
    watch = Watch(OPTIONS)
    first = watch.advise(mpis, WALK)
    once = asked[0]
    again = watch.advise(mpis, WALK)
    assert again.score == first.score
    assert asked[0] - once <= 1  # at most the suggestion itself
    fresh = Watch(OPTIONS)
    fresh.advise(mpis[:2], WALK)
    grown = fresh.advise(mpis, WALK)
    assert grown.score == pytest.approx(first.score, abs=2e-3)


def test_a_view_taken_back_is_forgotten(mpis: list[Mpi]) -> None:
    watch = Watch(OPTIONS)
    before = watch.advise(mpis[:2], WALK).score
    watch.advise(mpis, WALK)
    assert watch.advise(mpis[:2], WALK).score == pytest.approx(before, abs=2e-3)


def test_it_can_be_made_to_wait(mpis: list[Mpi]) -> None:
    calls: list[None] = []
    Watch(OPTIONS).advise(mpis[:1], WALK, pause=lambda: calls.append(None))
    assert len(calls) > 10


def test_it_needs_a_view() -> None:
    with pytest.raises(ValueError, match="at least one view"):
        Watch(OPTIONS).advise([])


def test_small_views_are_not_too_small() -> None:
    assert small_views(DEFAULT).pixels == DEFAULT.pixels // 16
    assert small_views(OPTIONS).pixels == OPTIONS.pixels
    assert 2 * WALKED > 100
