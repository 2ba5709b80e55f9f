"""Scores of `peaking bench trust`, worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.benchmarks.trust.scores import Detection, Marks, pearson, region_means

YES, NO = True, False


def detection(wrong: list[float], right: list[float], threshold: float = 0.4) -> Detection:
    score = np.array([[*wrong, *right]], np.float32)
    is_wrong = np.array([[YES] * len(wrong) + [NO] * len(right)])
    found = Detection()
    found.add(score, score > threshold, is_wrong, ~is_wrong)
    return found


def test_one_of_two_wrong_pixels_is_above_all_right_ones() -> None:
    # Of the four pairs, 2 > 1, 2 > 0 and 0 = 0 (a half) speak for the score; 0 < 1 against it.
    found = detection(wrong=[2.0, 0.0], right=[1.0, 0.0])
    assert found.auc == 2.5 / 4
    assert found.recall == 1 / 2
    assert found.precision == 1 / 2  # red: the wrong one with 2, the right one with 1


def test_recall_at_a_precision() -> None:
    found = detection(wrong=[2.5, 1.5, 0.5], right=[2.0, 1.0, 0.1])
    assert found.recall_at(1.0) == 1 / 3  # down to 2.5
    assert found.recall_at(0.6) == 3 / 3  # down to 0.5: three wrong, two right
    assert found.recall_at(2 / 3) == 2 / 3  # down to 1.5: two wrong, one right
    assert found.recall_at(None) is None


def test_what_is_called_right_is_never_recalled() -> None:
    """A score of 0 says "not wrong": no threshold reaches it."""
    found = detection(wrong=[0.0, 0.0, 2.0], right=[0.0])
    assert found.recall_at(0.01) == 1 / 3


def test_nothing_to_tell_apart() -> None:
    found = detection(wrong=[], right=[1.0])
    assert (found.auc, found.recall, found.precision) == (None, None, 0.0)
    assert found.recall_at(0.5) is None


@given(
    st.lists(st.floats(0, 3, width=32), min_size=1, max_size=30),
    st.lists(st.floats(0, 3, width=32), min_size=1, max_size=30),
)
def test_auc_the_other_way_round_adds_up_to_one(wrong: list[float], right: list[float]) -> None:
    forth, back = detection(wrong, right).auc, detection(right, wrong).auc
    assert forth is not None
    assert back is not None
    assert forth + back == pytest.approx(1.0)


def test_marks_by_hand() -> None:
    marks = Marks()
    marked = np.array([[YES, YES, NO, NO, YES]])
    true = np.array([[YES, NO, YES, NO, YES]])
    marks.add(marked, true, np.array([[YES, YES, YES, YES, NO]]))
    assert marks.as_dict() == {
        "precision": 1 / 2,
        "recall": 1 / 2,
        "marked_share": 2 / 4,
        "true_share": 2 / 4,
    }


def test_pearson_by_hand() -> None:
    assert pearson([0.0, 1.0, 2.0], [1.0, 3.0, 5.0]) == pytest.approx(1.0)
    assert pearson([0.0, 1.0, 2.0], [1.0, 0.0, 1.0]) == pytest.approx(0.0)
    assert pearson([1.0, 1.0, 1.0], [1.0, 2.0, 3.0]) is None


def test_regions_by_hand() -> None:
    values = np.array([[1.0, 3.0, 5.0, 7.0], [1.0, 3.0, 5.0, 9.0]])
    counted = np.array([[YES, YES, YES, YES], [YES, YES, NO, NO]])
    means, shares = region_means(values, counted, 2, 2)
    np.testing.assert_array_equal(means, [[2.0, 6.0], [2.0, 0.0]])
    np.testing.assert_array_equal(shares, [[1.0, 1.0], [1.0, 0.0]])
