"""Which frames are tested, and how many views are asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking.datasets import open_recording
from peaking.errors import RecordingError
from peaking.experiments.splits import budgets, num_candidates, split
from peaking.options import DEFAULT
from peaking.selection.recorded_frames import RecordedFrames
from recordings import lateral_cameras, write_recording

NUM_FRAMES = 24
SMALL = replace(DEFAULT, pixels=48 * 64, num_planes=8)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> RecordedFrames:
    root: Path = tmp_path_factory.mktemp("split") / "walk"
    write_recording(root, cameras=lateral_cameras(NUM_FRAMES, 48, 64))
    return RecordedFrames(open_recording(root), SMALL)


def test_holdout_tests_every_eighth_frame_and_never_offers_it(frames: RecordedFrames) -> None:
    usable = list(range(48))
    parts = split(frames, usable, "holdout", 5)
    assert parts.test == (4, 12, 20, 28, 36, 44)
    assert not set(parts.test) & set(parts.candidates)


def test_paper_tests_between_every_two_of_uniform(frames: RecordedFrames) -> None:
    parts = split(frames, list(range(NUM_FRAMES)), "paper", 4)
    assert parts.uniform is not None
    assert len(parts.test) == 3
    for a, middle, b in zip(parts.uniform, parts.test, parts.uniform[1:], strict=False):
        assert middle == (a + b) // 2
    assert not set(parts.test) & set(parts.candidates)


@given(st.integers(12, 400))
@settings(max_examples=30, deadline=None)
def test_budgets_rise(count: int) -> None:
    few, middle, many = budgets(count)
    assert 2 <= few < middle < many <= count


def test_too_many_views_are_refused(frames: RecordedFrames) -> None:
    with pytest.raises(RecordingError, match=r"24 usable frames.*40 views were asked for"):
        split(frames, list(range(NUM_FRAMES)), "holdout", 40)


def test_candidates_are_counted_without_the_test_views(frames: RecordedFrames) -> None:
    parts = split(frames, list(range(NUM_FRAMES)), "holdout", 2)
    assert num_candidates(frames.recording) == len(parts.candidates)
