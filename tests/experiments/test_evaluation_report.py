import base64
import dataclasses
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from evaluate_factories import case, result, score
from hypothesis import given
from hypothesis import strategies as st

from html_pages import Page
from peaking.experiments.curves import curve_points, interval_chart, quality_chart, signed, verdict
from peaking.experiments.evaluation_report import PAGE_BYTES, write_report
from peaking.experiments.intervals import compare
from peaking.experiments.results import CaseResult, Difference
from peaking.experiments.tables import Evaluation
from peaking.experiments.verdicts import sentence
from peaking.output import encode_jpeg


def difference(
    b: str, low: float, high: float, *, n_views: int = 8, metric: str = "psnr"
) -> Difference:
    middle = (low + high) / 2
    return Difference("desk", "mpi", "holdout", n_views, "peaking", b, metric, middle, low, high)


def plain(text: str) -> str:
    return re.sub("<[^>]*>", "", text).replace("\u00a0", " ")


def evaluation(results: Sequence[CaseResult]) -> Evaluation:
    return Evaluation(
        config={"strategies": ["peaking", "uniform"], "options": {"planes": 32}},
        versions={"peaking": "9.8.7"},
        reference="peaking",
        results=results,
        comparisons=compare(results, reference="peaking", rng=np.random.default_rng(0)),
    )


def walk(lead_db: float = 1.0) -> list[CaseResult]:
    theirs = np.random.default_rng(3).normal(24, 2, size=12)
    return [
        result(case(strategy, n_views=n), list(theirs + gain + n / 8))
        for n in (8, 16)
        for strategy, gain in (("peaking", lead_db), ("uniform", 0.0), ("random", -1.0))
    ]


def with_pictures(
    results: Sequence[CaseResult], folder: Path, jpeg: bytes, *, each: int
) -> list[CaseResult]:
    (folder / "worst").mkdir(exist_ok=True)
    changed: list[CaseResult] = []
    for r in results:
        scores = list(r.scores)
        for k in range(each):
            name = f"worst/{r.case.strategy}-{r.case.n_views}-{k}.jpg"
            (folder / name).write_bytes(jpeg)
            scores[k] = dataclasses.replace(scores[k], picture=name)
        changed.append(dataclasses.replace(r, scores=tuple(scores)))
    return changed


def noise_jpeg(width_px: int, height_px: int) -> bytes:
    picture = np.random.default_rng(0).integers(0, 256, (height_px, width_px, 3), dtype=np.uint8)
    return encode_jpeg(picture)


# The sentence


def test_the_sentence_names_what_is_better_the_same_and_worse() -> None:
    found = [
        difference("random", 1.0, 2.0),
        difference("random", 2.0, 3.0, n_views=16),
        difference("uniform", -0.5, 0.5),
        difference("uniform", -0.2, 0.5, n_views=16),
        difference("farthest", -0.9, -0.3),
        difference("farthest", -0.4, 0.1, n_views=16),
        difference("random", 0.2, 0.4, metric="psnr_p5"),
    ]
    assert plain(sentence(found)) == (
        "In the mean peaking is better than random by +1.5 to +2.5 dB, worse than farthest "
        "(in 1 of 2 cases) by −0.6 dB, no different from uniform; "
        "in the worst views it is better than random by +0.3 dB."
    )


def test_the_sentence_does_not_name_all_one_by_one() -> None:
    found = [difference("random", 1.0, 2.0), difference("uniform", 0.5, 0.7)]
    assert plain(sentence(found)) == (
        "In the mean peaking is better than all 2 others by +0.6 to +1.5 dB."
    )


def test_the_sentence_hides_no_contradiction() -> None:
    found = [difference("uniform", 0.1, 0.3), difference("uniform", -0.3, -0.1, n_views=16)]
    assert "better or worse than uniform by number of views" in sentence(found)
    assert "nothing to compare" in sentence([])


def test_an_interval_that_touches_nought_is_no_verdict() -> None:
    assert verdict(difference("uniform", 0.0, 1.0)) == "same"
    assert verdict(difference("uniform", 0.1, 1.0)) == "better"
    assert verdict(difference("uniform", 0.1, 1.0), less_is_better=True) == "worse"
    assert verdict(difference("uniform", -0.2, -0.1), less_is_better=True) == "better"
    assert signed(-0.424) == "−0.42"


# Charts


def test_curves_average_the_seeds_in_order_of_the_views() -> None:
    results = [
        result(case("random", n_views=16), [24.0, 26.0]),
        result(case("random", seed=0), [20.0, 20.0]),
        result(case("random", seed=1), [22.0, 22.0]),
    ]
    assert curve_points(results, "psnr_mean") == {"random": [(8, 21.0), (16, 25.0)]}


def test_the_dot_and_the_ends_lie_where_the_axis_says() -> None:
    svg = ET.fromstring(
        interval_chart([difference("uniform", 1.0, 3.0)], 500, extent=(1.0, 3.0), label="x")
    )
    zero = float(next(e for e in svg.iter("line") if e.get("class") == "zero").attrib["x1"])
    (row,) = [e for e in svg.iter("g") if e.get("class") == "interval better"]
    line, dot = row.find("line"), row.find("circle")
    assert line is not None
    assert dot is not None
    low, high = float(line.attrib["x1"]), float(line.attrib["x2"])
    assert zero < low < high
    # 1, 2 and 3 dB are 1, 2 and 3 times as far from the line; drawn to 0.1 px.
    assert high - zero == pytest.approx(3 * (low - zero), abs=0.3)
    assert float(dot.attrib["cx"]) - zero == pytest.approx(2 * (low - zero), abs=0.3)


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(0, 4)), min_size=1, max_size=12))
def test_every_interval_lies_in_the_drawing(intervals: list[tuple[float, float]]) -> None:
    rows = [difference(f"s{k}", low, low + wide) for k, (low, wide) in enumerate(intervals)]
    extent = min(r.low for r in rows), max(r.high for r in rows)
    svg = ET.fromstring(interval_chart(rows, 350, extent=extent, label="x"))
    for group in svg.iter("g"):
        line = group.find("line")
        assert line is not None
        assert 128 <= float(line.attrib["x1"]) <= float(line.attrib["x2"]) <= 292


@given(st.lists(st.floats(10, 40), min_size=7, max_size=7))
def test_names_at_the_ends_of_curves_do_not_overlap(values: list[float]) -> None:
    names = [f"s{k}" for k in range(7)]
    points = {name: [(8, 20.0), (16, value)] for name, value in zip(names, values, strict=True)}
    svg = ET.fromstring(
        quality_chart(points, (350, 250), strategies=names, reference="s6", label="x")
    )
    places = sorted(
        float(e.attrib["y"]) for e in svg.iter("text") if e.get("class", "").startswith("name ")
    )
    assert len(places) == 7
    assert np.diff(places).min() >= 14.8  # 15 px, drawn to 0.1
    assert 0 < places[0] < places[-1] < 250


def test_all_views_are_a_level_line_and_do_not_squeeze_the_others() -> None:
    points = {"peaking": [(8, 20.0), (16, 22.0)], "all": [(300, 25.0)]}
    text = quality_chart(
        points, (500, 280), strategies=["all", "peaking"], reference="peaking", label="x"
    )
    assert "all (300)" in text
    assert text.count('class="line level"') == 1
    assert ">300<" not in text


@pytest.mark.parametrize("points", [{}, {"peaking": [(8, 20.0)]}])
def test_a_single_number_of_views_or_none_is_drawn_too(
    points: dict[str, list[tuple[int, float]]],
) -> None:
    text = quality_chart(points, (500, 280), strategies=["peaking"], reference="peaking", label="x")
    ET.fromstring(text)
    assert "nan" not in text


# The page


def test_the_page_says_it_shows_it_and_names_its_configuration(tmp_path: Path) -> None:
    results = with_pictures(walk(), tmp_path, noise_jpeg(90, 20), each=1)
    write_report(tmp_path / "report.html", evaluation(results), out_root=tmp_path)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    words = " ".join(" ".join(page.words).split())
    assert "all 2 others by +1.0 to +2.0 dB" in words.replace("\u00a0", " ")
    assert "Ours (peaking)" in words
    assert "options.planes" in words
    assert "peaking 9.8.7" in words
    images = page.named("img")
    # View 0 of the reference, and of each of the others.
    assert len(images) == 3
    kinds = [a["class"] or "" for tag, a in page.tags if tag == "svg"]
    # 2 metrics of intervals and 4 of curves, each in 2 sizes.
    assert sum("interval-chart" in kind for kind in kinds) == 4
    assert sum("quality-chart" in kind for kind in kinds) == 8


def test_the_page_needs_no_network_and_trusts_no_name(tmp_path: Path) -> None:
    results = [
        dataclasses.replace(r, case=dataclasses.replace(r.case, scene="<script>&desk"))
        for r in walk()
    ]
    write_report(tmp_path / "report.html", evaluation(results), out_root=tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert "script" not in {tag for tag, _ in page.tags}
    assert not re.search(r"""(src|href)=["']?(?!data:)|url\(|https?:|@import""", text)


def test_the_fair_test_views_are_open_and_the_others_folded(tmp_path: Path) -> None:
    both = [
        dataclasses.replace(r, case=dataclasses.replace(r.case, test_views=test_views))
        for r in walk()
        for test_views in ("paper", "holdout")
    ]
    write_report(tmp_path / "report.html", evaluation(both), out_root=tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert text.count("<h3>MPI, holdout test views</h3>") == 3
    assert text.count("<details><summary>MPI, paper test views</summary>") == 3


def test_a_perfect_view_has_no_finite_psnr_and_spoils_nothing(tmp_path: Path) -> None:
    results = walk()
    perfect = result(results[0].case, [float("inf"), *(s.psnr for s in results[0].scores[1:])])
    write_report(tmp_path / "report.html", evaluation([perfect, *results[1:]]), out_root=tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"\b(nan|inf)\b", text)


def test_many_large_pictures_are_made_smaller_until_they_fit(tmp_path: Path) -> None:
    jpeg = noise_jpeg(1800, 500)
    results = with_pictures(walk(), tmp_path, jpeg, each=3)
    assert 4 * len(jpeg) * 4 / 3 > PAGE_BYTES
    path = tmp_path / "report.html"
    write_report(path, evaluation(results), out_root=tmp_path)
    assert path.stat().st_size <= PAGE_BYTES
    sources = re.findall(r'src="data:image/jpeg;base64,([^"]*)"', path.read_text(encoding="utf-8"))
    # Two of the reference, one of each of the others.
    assert len(sources) == 4
    raw = np.frombuffer(base64.b64decode(sources[0]), dtype=np.uint8)
    picture = cv2.imdecode(raw, cv2.IMREAD_COLOR)
    assert picture is not None
    height, width = picture.shape[:2]
    assert width < 1800
    assert width / height == pytest.approx(3.6, rel=0.01)


def test_the_worst_views_are_those_of_the_lowest_psnr(tmp_path: Path) -> None:
    scores = [score(view, psnr) for view, psnr in ((0, 30.0), (10, 12.0), (20, 15.0), (30, 11.0))]
    ours = dataclasses.replace(result(case(), [1.0]), scores=tuple(scores))
    (shown,) = with_pictures([ours], tmp_path, noise_jpeg(30, 10), each=4)
    write_report(tmp_path / "report.html", evaluation([shown]), out_root=tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert re.findall(r"<span>view (\d+) ", text) == ["30", "10"]


def test_what_cannot_be_shown_is_refused_and_nothing_written(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    with pytest.raises(ValueError, match="at least 1 result"):
        write_report(path, evaluation([]), out_root=tmp_path)
    no_jpeg = with_pictures(walk(), tmp_path, b"not a picture", each=1)
    with pytest.raises(ValueError, match=r"JPEG.*worst/peaking"):
        write_report(path, evaluation(no_jpeg), out_root=tmp_path)
    with pytest.raises(FileNotFoundError):
        write_report(path, evaluation(no_jpeg), out_root=tmp_path / "elsewhere")
    assert not path.exists()
