import csv
import dataclasses
import io
import json
import re

import numpy as np
import pytest
from evaluate_factories import case, result, score

from peaking.experiments.intervals import compare
from peaking.experiments.results import CaseResult
from peaking.experiments.tables import (
    Evaluation,
    per_view_csv,
    results_json,
    strategies_of,
    table_1,
    table_md,
    table_tex,
)


def evaluation(results: list[CaseResult]) -> Evaluation:
    return Evaluation(
        config={"scenes": ["desk"], "note": "a --b"},
        versions={"peaking": "0.1.0"},
        reference="peaking",
        results=results,
        comparisons=compare(results, reference="peaking", rng=np.random.default_rng(0)),
    )


def two_scenes() -> Evaluation:
    # Ours: means 20 and 40, deviations 2 and 4. Uniform: 18 and 38, deviations 1 and 6.
    return evaluation(
        [
            result(case(scene="desk"), [18.0, 22.0]),
            result(case(scene="hall"), [36.0, 44.0]),
            result(case("uniform", scene="desk"), [17.0, 19.0]),
            result(case("uniform", scene="hall"), [32.0, 44.0]),
        ]
    )


def test_ratios_are_taken_scene_by_scene_and_averaged() -> None:
    (table,) = table_1(two_scenes())
    cell = table.ratios["uniform"]["psnr"]
    assert cell.mean == pytest.approx((18 / 20 + 38 / 40) / 2)
    assert cell.std == pytest.approx((1 / 2 + 6 / 4) / 2)
    p5 = table.ratios["uniform"]["psnr_p5"]
    assert p5.mean == pytest.approx((17.1 / 18.2 + 32.6 / 36.4) / 2)
    assert p5.std is None
    ours = table.ratios["peaking"]["psnr"]
    assert (ours.mean, ours.std) == (1.0, 1.0)
    assert table.absolute["uniform"]["psnr"].mean == pytest.approx(28.0)
    assert table.absolute["uniform"]["psnr"].std == pytest.approx(3.5)


def test_seeds_are_averaged_before_the_ratio() -> None:
    (table,) = table_1(
        evaluation(
            [
                result(case(), [20.0, 20.0]),
                result(case("random", seed=0), [10.0, 10.0]),
                result(case("random", seed=1), [12.0, 18.0]),
            ]
        )
    )
    assert table.ratios["random"]["psnr"].mean == pytest.approx(12.5 / 20)
    # Ours does not vary over the views: no ratio of deviations.
    assert table.ratios["random"]["psnr"].std is None
    assert table.absolute["random"]["psnr"].std == pytest.approx(1.5)
    assert table.data_sets["random"] == 1


def test_the_paper_form() -> None:
    assert "| Uniform | 0.925 (1.00) | 0.918 | 1.000 | 1.000 |" in table_md(two_scenes())
    lines = [line.strip() for line in table_tex(two_scenes()).splitlines()]
    start = lines.index(r"\toprule")
    assert lines[start : lines.index(r"\bottomrule") + 1] == [
        r"\toprule",
        r"MPI, holdout test views & PSNR $(\uparrow)$ & PSNR, 5th percentile $(\uparrow)$ & "
        r"SSIM $(\uparrow)$ & FLIP $(\downarrow)$ \\",
        r"\midrule",
        r"Uniform & 0.925 (1.00) & 0.918 & 1.000 & 1.000 \\",
        r"Ours (peaking) & 1.000 (1.00) & 1.000 & 1.000 & 1.000 \\",
        r"\bottomrule",
    ]


def test_every_row_of_a_tex_table_has_as_many_cells() -> None:
    mixed = two_scenes().results[0]
    other = dataclasses.replace(mixed, case=dataclasses.replace(mixed.case, reconstruct="3dgs"))
    scores = tuple(dataclasses.replace(s, lpips=0.2) for s in other.scores)
    tex = table_tex(evaluation([mixed, dataclasses.replace(other, scores=scores)]))
    counts = {line.count(" & ") for line in tex.splitlines() if line.endswith(r"\\")}
    assert counts == {5}
    assert tex.index("MPI, holdout") < tex.index("3DGS, holdout")
    assert tex.count(r"\midrule") == 4


def test_a_missing_metric_is_never_under_another_name() -> None:
    without = table_md(two_scenes())
    assert "LPIPS" not in without
    ours = result(case(), [1.0, 1.0])
    scores = tuple(dataclasses.replace(score(v, 20.0), st_lpips=0.25) for v in (0, 10))
    found = table_md(evaluation([dataclasses.replace(ours, scores=scores)]))
    assert "| ST-LPIPS ↓ |" in found
    assert "| LPIPS" not in found


def test_what_has_no_partner_has_absolute_values_only() -> None:
    everything = evaluation(
        [result(case(), [20.0, 22.0]), result(case("all", n_views=300), [25.0, 27.0])]
    )
    (table,) = table_1(everything)
    assert list(table.ratios) == ["peaking"]
    assert list(table.absolute) == ["all", "peaking"]
    assert "| All | 26.00 (1.00) |" in table_md(everything)


def test_strategies_come_in_the_order_of_the_paper_and_the_reference_last() -> None:
    names = ["peaking", "mine", "uniform", "random", "all"]
    found = strategies_of(evaluation([result(case(name), [1.0, 2.0]) for name in names]))
    assert found == ["random", "uniform", "all", "mine", "peaking"]


def test_json_has_null_for_what_is_not_available() -> None:
    infinite = evaluation(
        [result(case(), [float("inf"), 20.0]), result(case("uniform"), [19.0, 20.0])]
    )
    text = results_json(infinite)
    assert not re.search(r"NaN|Infinity", text)
    document = json.loads(text)
    assert list(document) == ["config", "versions", "notes", "costs", "rows", "compare"]
    assert document["versions"] == {"peaking": "0.1.0"}
    ours, uniform = document["rows"]
    assert ours["strategy"] == "peaking"
    assert ours["psnr_mean"] is None
    assert ours["lpips_mean"] is None
    assert uniform["psnr_mean"] == 19.5
    assert list(document["compare"][0]) == [
        *("scene", "reconstruct", "test_views", "n_views", "a", "b"),
        *("metric", "difference", "low", "high"),
    ]
    # PSNR is infinite for one view, so it is not compared.
    assert {row["metric"] for row in document["compare"]} == {"ssim", "flip"}


def test_the_csv_has_a_line_per_case_and_test_view() -> None:
    first, rest = per_view_csv(two_scenes()).split("\n", 1)
    assert json.loads(first.removeprefix("# "))["config"]["scenes"] == ["desk"]
    rows = list(csv.DictReader(io.StringIO(rest)))
    assert len(rows) == 8
    assert (rows[0]["scene"], rows[0]["strategy"], rows[0]["view"]) == ("desk", "peaking", "0")
    assert float(rows[0]["psnr"]) == 18.0
    assert rows[0]["lpips"] == ""


def test_a_comment_in_markdown_does_not_end_early() -> None:
    first = table_md(two_scenes()).splitlines()[0]
    assert first.startswith("<!-- ")
    assert "--" not in first.removeprefix("<!--").removesuffix("-->")


def test_nothing_gives_empty_tables() -> None:
    nothing = evaluation([])
    assert table_1(nothing) == []
    assert json.loads(results_json(nothing))["rows"] == []
    assert r"\bottomrule" in table_tex(nothing)
