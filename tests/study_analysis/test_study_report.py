"""The report can be made of whatever a study has, and shows it as it is."""

from __future__ import annotations

import re

import pytest

from peaking.study.analysis.figure_style import png_bytes, svg_bytes
from peaking.study.analysis.measure_analysis import Analysis, analyse
from peaking.study.analysis.report import report_page
from peaking.study.analysis.run import figures_of, results_text
from study_analysis.matrices import THREE, TWO, matrix, normal_rows, protocol

NAN = float("nan")
ODD = TWO.replace("Error peaking", "Co$t $5 <&> _x_")


def analysed(text: str, numbers: dict[str, list[list[float]]]) -> Analysis:
    order = {} if text.count("label =") > 2 else {"order": "fixed"}
    of = protocol(text, **order)
    matrices = [matrix(of, name, rows) for name, rows in numbers.items()]
    return analyse(of, matrices, excluded=[("P99", "the phone <fell>")])


ONE = "\n".join(line for line in TWO.splitlines() if '"peaking"' not in line)
CASES = {
    "one participant": analysed(ODD, {"tct_s": [[40.0, 60.0]], "s_conf": [[4, 5]]}),
    "four": analysed(TWO, {"tct_s": [[40.0, 60.0]] * 4, "s_conf": [[4, 5]] * 4}),
    "constant": analysed(TWO, {"tct_s": [[3.0, 3.0]] * 7, "s_conf": [[7, 7]] * 7}),
    "shifted": analysed(TWO, {"tct_s": [[3.0, 4.0]] * 7, "s_conf": [[1, 7]] * 7}),
    "nothing": analysed(TWO, {"tct_s": [[NAN, NAN]] * 6}),
    "half": analysed(TWO, {"tct_s": [[3.0, NAN]] * 6, "captures": [[3.0, NAN], [NAN, 2.0]] * 3}),
    "one condition": analysed(ONE, {"tct_s": [[float(i)] for i in range(6)]}),
    "three, the same": analysed(THREE, {"tct_s": [[1.0, 2.0, 3.0]] * 6}),
    "three": analysed(THREE, {"tct_s": normal_rows(6, (40, 50, 41))}),
    "two": analysed(ODD, {"tct_s": normal_rows(1, (40, 60)), "captures": normal_rows(2, (9, 9))}),
}


@pytest.mark.parametrize("name", list(CASES))
def test_a_report_of_anything(name: str) -> None:
    figures = figures_of(CASES[name])
    drawn = {key: svg_bytes(figure) for key, figure in figures.items()}
    assert all(png_bytes(figure).startswith(b"\x89PNG") for figure in figures.values())
    page = report_page(CASES[name], drawn, version="0")
    words = re.sub(r"<(svg|style).*?</\1>", "", page, flags=re.DOTALL)
    assert "&lt;fell&gt;" in words
    assert not re.search(r"\b(nan|inf|None)\b", words)
    assert not re.search(r"\b(nan|inf|None)\b", results_text(CASES[name]))
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))


def test_the_same_data_give_the_same_drawing() -> None:
    first, second = (svg_bytes(figures_of(CASES["two"])["boxes"]) for _ in range(2))
    assert first == second


def test_pairs_are_told_after_a_significant_test_of_all() -> None:
    assert "Error peaking and No guidance: t(17)" in results_text(CASES["three"])
