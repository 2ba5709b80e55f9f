"""Missing numbers, families, designs and what is said, on small studies worked by hand."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from peaking.study.analysis.csv_files import codebook_csv, results_csv, wide_csv
from peaking.study.analysis.matrix import Matrix, build_matrices
from peaking.study.analysis.measure_analysis import Analysis, MeasureAnalysis, analyse
from peaking.study.analysis.over_time_figure import progress_curve
from peaking.study.analysis.words import bounded, decimal, p_value, reported, sentence, stars
from peaking.study.statistics.outcome import FISHER, SCORE, Result, Untestable
from peaking.study.statistics.paired import wilcoxon
from peaking.study.tables import Measurement
from study_analysis.matrices import THREE, TWO, matrix, measure, normal_rows, protocol

NAN = float("nan")
HOLE = [NAN, 3.0]


def of(analysis: Analysis, name: str) -> MeasureAnalysis:
    return next(m for m in analysis.measures if m.measure.name == name)


def result(analysis: MeasureAnalysis) -> Result:
    assert isinstance(analysis.decision.outcome, Result)
    return analysis.decision.outcome


def with_holes(missing: str) -> Analysis:
    """P01 misses a time, P02 an answer."""
    two = protocol(TWO, missing=missing)
    times, answers = normal_rows(1, (40, 60)), normal_rows(2, (4, 5))
    times[0][1], answers[1][0] = NAN, NAN
    return analyse(two, [matrix(two, "tct_s", times), matrix(two, "s_conf", answers)])


def test_pairwise_leaves_out_of_one_measure() -> None:
    found = with_holes("pairwise")
    assert of(found, "tct_s").left_out == ("P01",)
    assert of(found, "s_conf").left_out == ("P02",)
    assert result(of(found, "tct_s")).n == 17
    assert [d.count for d in of(found, "tct_s").described] == [18, 17]


def test_listwise_leaves_out_of_all() -> None:
    found = with_holes("listwise")
    assert of(found, "tct_s").left_out == of(found, "s_conf").left_out == ("P01", "P02")
    assert result(of(found, "s_conf")).n == 16


def test_a_measure_of_one_condition_is_not_tested_and_leaves_nobody_out() -> None:
    two = protocol(TWO, missing="listwise")
    scans = matrix(two, "scan_s", [[30.0 + row, NAN] for row in range(18)])
    found = analyse(two, [matrix(two, "tct_s", normal_rows(1, (40, 60))), scans])
    outcome = of(found, "scan_s").decision.outcome
    assert isinstance(outcome, Untestable)
    assert outcome.reason == "measured with LLFF <guidance> only"
    assert result(of(found, "tct_s")).n == 18


def test_holm_within_the_family_alone() -> None:
    two = protocol()
    names = ("tct_s", "captures", "s_conf", "peaked_mean")
    matrices = [matrix(two, n, normal_rows(i, (10, 11 + i))) for i, n in enumerate(names)]
    found = analyse(two, matrices)
    plain = [result(of(found, n)).p for n in names[:3]]
    order = np.argsort(plain)
    expected, highest = [0.0] * 3, 0.0
    for rank, index in enumerate(order):
        highest = max(highest, min(1.0, (3 - rank) * plain[index]))
        expected[index] = highest
    assert [of(found, n).p_corrected for n in names[:3]] == pytest.approx(expected)
    assert of(found, "peaked_mean").p_corrected is None
    assert "(exploratory, not corrected)" in sentence(of(found, "peaked_mean"), two)
    assert "after Holm’s correction of 3 tests (task)" in sentence(of(found, "tct_s"), two)


def test_three_conditions_have_pairs_and_an_order() -> None:
    three = protocol(THREE)
    found = of(analyse(three, [matrix(three, "tct_s", normal_rows(6, (40, 50, 41)))]), "tct_s")
    assert result(found).test == "repeated-measures ANOVA"
    assert [(p.first, p.second) for p in found.decision.pairs] == [
        ("LLFF <guidance>", "Error peaking"),
        ("LLFF <guidance>", "No guidance"),
        ("Error peaking", "No guidance"),
    ]
    for pair in found.decision.pairs:
        assert isinstance(pair.outcome, Result)
        assert pair.p_holm is not None
        assert pair.p_holm >= pair.outcome.p
    assert found.order is not None
    said = " ".join(found.decision.path())
    assert "Does sphericity hold?" in said
    assert "it does not decide" in said
    assert "significant differences between LLFF <guidance>" in sentence(found, three)


def test_a_strong_effect_of_ranks_has_both_intervals() -> None:
    two = protocol()
    rows = [[1.0 + row, 2.0 + 2.5 * row + (60.0 if row > 15 else 0.0)] for row in range(18)]
    found = of(analyse(two, [matrix(two, "s_conf", rows)]), "s_conf")
    fisher, score, _ = result(found).effects
    assert (fisher.value, fisher.low, fisher.high) == (-1.0, -1.0, -1.0)
    assert score.high == pytest.approx(-0.65, abs=0.01)
    said = sentence(found, two)
    assert "95% CI [−1.00, −1.00] (Fisher’s z; score interval [−1.00, −.65])" in said
    lines = [
        row for row in read(results_csv(analyse(two, [found.matrix]))) if row["effect"] == "r_rb"
    ]
    assert [row["interval_method"] for row in lines] == [FISHER, SCORE]


def test_a_weak_effect_of_ranks_has_one_interval() -> None:
    away = np.array([row * (1.0 if row % 3 else -1.0) for row in range(1, 21)])
    found = wilcoxon(away, np.zeros(20))
    assert isinstance(found, Result)
    assert reported(found) == "r_rb = .40, 95% CI [−.08, .73] (Fisher’s z)"


def test_between_groups_nobody_is_left_out_for_the_other_group() -> None:
    between = protocol(TWO, design="between")
    rows = normal_rows(5, (40, 60))
    values = np.array([[a, NAN] if i % 2 else [NAN, b] for i, (a, b) in enumerate(rows)])
    made = matrix(between, "tct_s", values.tolist())
    places = np.where(np.isnan(values), -1, 0)
    values[0, 1] = NAN  # P01 was to do it, and did not
    full = Matrix(made.measure, made.participants, made.conditions, values, places)
    found = of(analyse(between, [full]), "tct_s")
    assert found.left_out == ("P01",)
    assert result(found).test in ("Welch's t-test", "Mann–Whitney test")
    assert result(found).n == 17
    assert found.order is None


@pytest.mark.parametrize(
    ("count", "said"), [(0, "nothing was measured"), (1, "needs 5"), (4, "needs 5")]
)
def test_few_participants_are_a_sentence(count: int, said: str) -> None:
    two = protocol()
    rows = np.array(normal_rows(1, (40, 60), count=max(count, 1)))[:count]
    made = Matrix(
        measure("tct_s"),
        tuple(f"P{i}" for i in range(count)),
        ("llff", "peaking"),
        rows,
        np.tile([0, 1], (count, 1)),
    )
    found = analyse(two, [made])
    assert said in sentence(found.measures[0], two)
    assert found.reached == ()


def test_scenes_of_a_condition_are_averaged() -> None:
    numbers = [
        Measurement("P01", "llff", "desk", 1, "tct_s", 10.0),
        Measurement("P01", "llff", "shelf", 2, "tct_s", 20.0),
        Measurement("P01", "peaking", "desk", 3, "tct_s", 30.0),
        Measurement("P01", "peaking", "shelf", 4, "tct_s", None),
    ]
    (made,) = build_matrices(numbers, [measure("tct_s")], ("llff", "peaking"))
    assert made.values[0, 0] == 15.0
    assert np.isnan(made.values[0, 1])
    assert made.places.tolist() == [[0, 1]]


def test_a_sample_of_the_peaked_share_holds_until_the_next() -> None:
    curve = progress_curve([(10.0, 0.4), (11.0, 0.2), (20.0, 0.1)])
    assert curve[:10].tolist() == [40.0] * 10
    assert curve[10:100].tolist() == [20.0] * 90
    assert curve[100] == 10.0


def read(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_tables_keep_every_digit_and_the_codebook_knows_every_column() -> None:
    two = protocol()
    made = [matrix(two, "tct_s", normal_rows(1, (40, 60)))]
    wide = read(wide_csv(made))
    assert float(wide[3]["tct_s__peaking"]) == made[0].values[3, 1]
    book = {row["name"] for row in read(codebook_csv([measure("tct_s")], ("llff", "peaking")))}
    for column in wide[0]:
        assert column in book or column.partition("__")[0] in book, column
    tests = read(results_csv(analyse(two, made)))
    assert set(tests[0]) <= book
    (chosen, *_) = [row for row in tests if row["chosen"] == "chosen"]
    outcome = result(analyse(two, made).measures[0])
    assert float(chosen["p"]) == outcome.p
    assert (chosen["first"], chosen["second"]) == ("llff", "peaking")
    assert "Are the differences normal?" in chosen["decision_path"]


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (decimal(-0.001), "0.00"),
        (decimal(-2.345), "−2.35"),
        (bounded(-0.5), "−.50"),
        (bounded(1.0), "1.00"),
        (bounded(0.999), "1.00"),
        (p_value(0.0004), "p < .001"),
        (p_value(0.0415), "p = .042"),
        (p_value(1.0), "p = 1.000"),
        (stars(0.05), ""),
        (stars(0.0499), "*"),
        (stars(0.0099), "**"),
        (stars(None), ""),
    ],
)
def test_numbers_as_the_apa_has_them(said: str, expected: str) -> None:
    assert said == expected
