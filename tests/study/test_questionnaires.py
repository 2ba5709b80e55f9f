"""Scores worked by hand from the published rules; the built-in forms; filled-in forms."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.study.questionnaires import (
    Answer,
    Item,
    Questionnaire,
    built_in,
    built_in_names,
    check_questionnaire,
    problems,
)
from peaking.study.questionnaires.scoring import TLX_PAIRS, TLX_SCALES, scores, tlx_weights


def numbered(*values: int) -> dict[str, Answer]:
    return {f"q{i}": value for i, value in enumerate(values, start=1)}


def test_sus_as_in_brooke_s_example() -> None:
    """Brooke 1996: contributions 4 1 1 4 1 2 1 1 4 3 make 22, times 2.5 is 55."""
    answers = numbered(5, 4, 2, 1, 2, 3, 2, 4, 5, 2)
    assert scores(built_in("sus"), answers)[""] == 55.0


def test_sus_is_100_at_best_and_0_at_worst() -> None:
    assert scores(built_in("sus"), numbered(*[5, 1] * 5))[""] == 100.0
    assert scores(built_in("sus"), numbered(*[1, 5] * 5))[""] == 0.0


def test_sus_items_are_as_answered() -> None:
    found = scores(built_in("sus"), numbered(5, 4, 2, 1, 2, 3, 2, 4, 5, 2))
    assert [found[f"q{i}"] for i in range(1, 11)] == [5, 4, 2, 1, 2, 3, 2, 4, 5, 2]


def test_a_missing_answer_is_not_made_up() -> None:
    answers = numbered(5, 4, 2, 1, 2, 3, 2, 4, 5)
    found = scores(built_in("sus"), answers)
    assert found[""] is None
    assert found["q10"] is None
    assert found["q1"] == 5.0


def test_tlx_raw_is_the_mean_of_six() -> None:
    ratings: dict[str, Answer] = dict(zip(TLX_SCALES, [70, 10, 40, 25, 60, 35], strict=True))
    assert scores(built_in("nasa_rtlx"), ratings)["raw"] == pytest.approx(240 / 6)


def test_tlx_weighted_by_fifteen_pairs() -> None:
    """Mental wins its 5 pairs, effort its other 4, then temporal 3, frustration 2, performance 1:
    (5·70 + 4·60 + 3·40 + 2·35 + 1·25 + 0·10) / 15 = 805 / 15.
    """
    ranks = ["mental", "effort", "temporal", "frustration", "performance", "physical"]
    answers: dict[str, Answer] = dict(zip(TLX_SCALES, [70, 10, 40, 25, 60, 35], strict=True))
    for pair in TLX_PAIRS:
        answers[f"pair_{pair[0]}_{pair[1]}"] = min(pair, key=ranks.index)
    assert tlx_weights(answers) == {
        "mental": 5,
        "physical": 0,
        "temporal": 3,
        "performance": 1,
        "effort": 4,
        "frustration": 2,
    }
    found = scores(built_in("nasa_tlx"), answers)
    assert found["weighted"] == pytest.approx(805 / 15)
    assert found["raw"] == pytest.approx(40.0)


def test_tlx_without_a_pair_has_no_weighted_score() -> None:
    answers: dict[str, Answer] = dict.fromkeys(TLX_SCALES, 50)
    found = scores(built_in("nasa_tlx"), answers)
    assert found["weighted"] is None
    assert found["raw"] == 50.0


@given(st.lists(st.integers(0, 1), min_size=15, max_size=15))
def test_tlx_weights_sum_to_fifteen(chosen: list[int]) -> None:
    answers: dict[str, Answer] = {
        f"pair_{a}_{b}": (a, b)[which] for (a, b), which in zip(TLX_PAIRS, chosen, strict=True)
    }
    weights = tlx_weights(answers)
    assert weights is not None
    assert sum(weights.values()) == 15


def test_harus_is_the_sum_over_0_96() -> None:
    """Odd items are stated negatively: 7 - answer; even ones positively: answer - 1.

    Manipulability: 5 4 5 4 5 4 5 4 = 36 of 48; comprehensibility: 6 6 0 0 6 6 0 0 = 24 of 48.
    """
    answers = numbered(2, 5, 2, 5, 2, 5, 2, 5, 1, 7, 7, 1, 1, 7, 7, 1)
    found = scores(built_in("harus"), answers)
    assert found["manipulability"] == pytest.approx(75.0)
    assert found["comprehensibility"] == pytest.approx(50.0)
    assert found[""] == pytest.approx(60 / 0.96)


def test_a_mean_turns_reversed_items_round() -> None:
    """(6 + (8 - 3)) / 2 = 5.5."""
    items = [
        Item(id="a", text="a", kind="scale"),
        Item(id="b", text="b", kind="scale", reversed=True),
    ]
    own = Questionnaire(name="own", title="Own", items=items, scoring="mean")
    assert scores(own, {"a": 6, "b": 3}) == {"": 5.5, "a": 6.0, "b": 3.0}


@pytest.mark.parametrize("name", built_in_names())
def test_built_in_forms_are_sound_and_empty_ones_are_incomplete(name: str) -> None:
    form = built_in(name)
    assert form.name == name
    assert check_questionnaire(form) is None
    needed = {item.id for item in form.items if not item.optional}
    assert problems(form, {}) == dict.fromkeys(needed, "unanswered")


def test_published_lengths() -> None:
    assert len(built_in("sus").items) == 10
    assert len(built_in("harus").items) == 16
    assert len(built_in("nasa_tlx").items) == 6 + 15
    assert {"s_conf", "scene_focus"} == {i.id for i in built_in("paper_before").items}
    assert {"satis"} == {i.id for i in built_in("paper_after").items}


@pytest.mark.parametrize(
    ("answers", "expected"),
    [
        ({"q1": 6}, "out-of-range"),
        ({"q1": 0}, "out-of-range"),
        ({"q1": 2.5}, "out-of-range"),
        ({"q1": "3"}, "not-a-number"),
        ({"q1": float("nan")}, "not-a-number"),
        ({"q1": None}, "unanswered"),
        ({"q1": 3, "q11": 3}, "unknown"),
    ],
)
def test_wrong_answers_are_named(answers: dict[str, Answer], expected: str) -> None:
    found = problems(built_in("sus"), answers)
    wrong = "q11" if "q11" in answers else "q1"
    assert found[wrong] == expected


def test_a_scale_of_somebody_else_s_items_is_refused() -> None:
    items = [Item(id="a", text="a", kind="scale")]
    own = Questionnaire(name="own", title="Own", items=items, scoring="sus")
    assert "needs the items q1" in (check_questionnaire(own) or "")


FIXTURE = Path(__file__).parents[2] / "web" / "fixtures" / "study_answers.json"
SHARED: dict[str, Any] = json.loads(FIXTURE.read_text())


@pytest.mark.parametrize(("name", "answer", "expected"), SHARED["cases"])
def test_both_languages_find_the_same_answers_wrong(
    name: str, answer: Answer, expected: str | None
) -> None:
    """The client reads the same file: web/tests/study/answer_rules.test.ts."""
    item = msgspec.convert(SHARED["items"][name], Item)
    form = Questionnaire(name="form", title="Form", items=[item])
    assert problems(form, {name: answer}).get(name) == expected
