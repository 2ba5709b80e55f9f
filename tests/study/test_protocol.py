"""Orders worked by hand, laws of the designs, and what is refused."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.errors import StudyError
from peaking.study.counterbalance import row_of, williams
from peaking.study.protocol import (
    FILE_NAME,
    Protocol,
    load_protocol,
    parse_protocol,
    remarks,
    trials_of,
)

SMALL = """
version = 1
title = "Two ways to photograph"
design = "within"
order = "ab-ba"
planned_participants = 4
seed = 7
consent = "I agree."
conditions = [
  { name = "peaking", label = "Red", overlay = "peaks" },
  { name = "llff", label = "Grid", overlay = "none", guide = "plenoptic", scan = true },
]
scenes = [{ name = "desk", label = "Desk" }]
[ask]
after_review = ["sus"]
"""
FILE = Path("protocol.toml")


def parsed(*changes: tuple[str, str]) -> Protocol:
    text = SMALL
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return parse_protocol(text, FILE)


def test_two_conditions_are_ab_and_ba() -> None:
    assert williams(2) == [[0, 1], [1, 0]]


def test_four_conditions_are_the_published_square() -> None:
    assert williams(4) == [[0, 1, 3, 2], [1, 2, 0, 3], [2, 3, 1, 0], [3, 0, 2, 1]]


@given(st.integers(2, 9))
def test_every_condition_stands_everywhere_and_follows_every_other_equally_often(n: int) -> None:
    rows = williams(n)
    at = Counter((place, value) for row in rows for place, value in enumerate(row))
    after = Counter(pair for row in rows for pair in pairwise(row))
    assert len(rows) == (n if n % 2 == 0 else 2 * n)
    assert set(at.values()) == {len(rows) // n}
    assert len(after) == n * (n - 1)
    assert len(set(after.values())) == 1


@given(st.integers(1, 12), st.integers(0, 2**40), st.integers(0, 5))
def test_every_block_has_every_row_once(rows: int, seed: int, block: int) -> None:
    places = range(block * rows, (block + 1) * rows)
    assert sorted(row_of(place, rows, seed=seed) for place in places) == list(range(rows))


def test_both_orders_come_equally_often() -> None:
    protocol = parsed()
    orders = [tuple(t.condition for t in trials_of(protocol, row)) for row in range(4)]
    assert Counter(orders) == {("peaking", "llff"): 2, ("llff", "peaking"): 2}
    assert orders == [tuple(t.condition for t in trials_of(protocol, row)) for row in range(4)]


def test_scenes_are_counterbalanced_separately_from_conditions() -> None:
    scenes = (
        'scenes = [{ name = "a", label = "A" }, { name = "b", label = "B" }]\nscene_use = "one"'
    )
    protocol = parsed(('scenes = [{ name = "desk", label = "Desk" }]', scenes))
    plans = [tuple((t.condition, t.scene) for t in trials_of(protocol, row)) for row in range(4)]
    assert set(plans) == {
        (("peaking", "a"), ("llff", "b")),
        (("peaking", "b"), ("llff", "a")),
        (("llff", "a"), ("peaking", "b")),
        (("llff", "b"), ("peaking", "a")),
    }


def test_every_condition_in_every_scene() -> None:
    scenes = 'scenes = [{ name = "a", label = "A" }, { name = "b", label = "B" }]'
    protocol = parsed(('scenes = [{ name = "desk", label = "Desk" }]', scenes))
    for row in range(8):
        trials = trials_of(protocol, row)
        assert [t.position for t in trials] == [1, 2, 3, 4]
        assert len({(t.condition, t.scene) for t in trials}) == 4
        assert trials[0].condition == trials[1].condition


def test_between_gives_everybody_one_condition() -> None:
    protocol = parsed(('"within"', '"between"'))
    given_ = [trials_of(protocol, row) for row in range(6)]
    assert all(len(trials) == 1 for trials in given_)
    assert Counter(trials[0].condition for trials in given_) == {"peaking": 3, "llff": 3}


def test_an_odd_number_for_ab_ba_is_said() -> None:
    (said,) = remarks(parsed(("planned_participants = 4", "planned_participants = 5")))
    assert "odd number" in said
    assert "plan 6" in said
    assert remarks(parsed()) == []


@pytest.mark.parametrize(
    ("old", "new", "field", "remedy"),
    [
        ("version = 1", "version = 9", "version", "write: version = 1"),
        ("seed = 7", 'seed = "x"', "seed", "correct it"),
        ("seed = 7", "seed = 7\ncolour = 1", "colour", "correct it"),
        ('overlay = "peaks"', 'overlay = "red"', "conditions[0].overlay", "correct it"),
        ('name = "llff"', 'name = "peaking"', "conditions", "its own name"),
        ('order = "ab-ba"', 'order = "ab"', "order", "correct it"),
        ('["sus"]', '["susi"]', "ask", "choose from"),
        ('["sus"]', '["sus", "sus"]', "ask", "its own name"),
        ("seed = 7", "", "seed", "correct it"),
        (
            'overlay = "peaks"',
            'overlay = "peaks", guide = "plenoptic"',
            "conditions[0].overlay",
            "none",
        ),
        ("scan = true", "scan = true, area_side_m = 15", "conditions[1].area_side_m", "correct it"),
        (
            "scan = true",
            'scan = true, area_side_m = "a"',
            "conditions[1].area_side_m",
            "correct it",
        ),
        (
            'overlay = "peaks"',
            'overlay = "peaks", area_side_m = 0.3',
            "conditions[0].area_side_m",
            "leave area_side_m out",
        ),
        (
            "[ask]",
            '[[families]]\nname = "main"\nmeasures = ["tct"]\n[ask]',
            "families[0].measures",
            "tct_s",
        ),
    ],
)
def test_what_is_wrong_is_said_with_field_and_remedy(
    old: str, new: str, field: str, remedy: str
) -> None:
    with pytest.raises(StudyError) as caught:
        parsed((old, new))
    assert field in str(caught.value)
    assert remedy in str(caught.value)
    assert str(caught.value).startswith("protocol.toml: ")


def test_ab_ba_is_for_two() -> None:
    third = '{ name = "free", label = "Free", overlay = "none" },\n]\nscenes'
    with pytest.raises(StudyError, match="order: 'ab-ba' is for 2 conditions, there are 3"):
        parsed(("]\nscenes", third))


def test_what_is_not_there_and_what_is_not_toml(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="peaking study init"):
        load_protocol(tmp_path)
    for text in ("version = ", "a = " + "[" * 5000, "a = " + "9" * 5000):
        (tmp_path / FILE_NAME).write_text(text)
        with pytest.raises(StudyError, match="is not TOML"):
            load_protocol(tmp_path)
    (tmp_path / FILE_NAME).write_bytes(b"\xff\xfe")
    with pytest.raises(StudyError, match="cannot be read"):
        load_protocol(tmp_path)
