import base64
import json
import math
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from replay_factories import FRAMES, panels, path_record, plain, settings, walk

from html_pages import Page
from peaking.replay.charts import index_ticks, nice_at_least, percent, share_chart
from peaking.replay.path_map_svg import map_view, path_map, words_of_length
from peaking.replay.records import FrameRecord, summarize
from peaking.replay.report import write_report
from peaking.replay.stills import Still, StillPicker, encode_stills

MAX_BYTES = 3_000_000


def still(index: int, kind: str = "worst", size_px: tuple[int, int] = (40, 30)) -> Still:
    three = panels(size_px, seed=index)
    return Still(index, three.live, three.rendering, three.peaks, kind)  # type: ignore[arg-type]


def report(
    folder: Path, records: list[FrameRecord], stills: list[Still] | None = None
) -> tuple[str, Page]:
    summary = summarize(settings(), records)
    path = folder / "report.html"
    write_report(path, summary=summary, records=records, stills=stills or [])
    text = path.read_text(encoding="utf-8")
    return text, Page(text)


def decoded(image: dict[str, str | None]) -> np.ndarray:
    kind, data = (image["src"] or "").split(",", 1)
    assert kind == "data:image/jpeg;base64"
    raw = cv2.imdecode(np.frombuffer(base64.b64decode(data), dtype=np.uint8), cv2.IMREAD_COLOR)
    assert raw is not None
    return cv2.cvtColor(raw, cv2.COLOR_BGR2RGB)


def test_the_page_has_its_numbers_its_stills_and_its_options(tmp_path: Path) -> None:
    text, page = report(tmp_path, walk(), [still(12), still(5, "typical")])
    words = " ".join(page.words)
    for expected in ("desk & <lamp>", "150", "13", "2.43\u00a0%", "4.28\u00a0%", "paper", "9.8.7"):
        assert expected in words
    assert "error.kind" in words
    assert "<l1>" in words
    images = page.named("img")
    assert len(images) == 6
    assert all(image["alt"] for image in images)
    np.testing.assert_allclose(decoded(images[2]), plain((40, 30), (255, 0, 0)), atol=3)
    assert text.index("Worst frames") < text.index("Typical frames")


def test_nothing_is_fetched_from_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "overlay.mp4").touch()
    (tmp_path / "captured").mkdir()
    text, page = report(tmp_path, walk(), [still(12)])
    links = [v for _, found in page.tags for k, v in found.items() if k in ("src", "href")]
    assert {link for link in links if link and not link.startswith("data:")} == {
        "overlay.mp4",
        "captured/",
    }
    assert not re.search(r"https?://|@import|url\((?!#)", text)


def test_what_is_not_there_is_not_linked(tmp_path: Path) -> None:
    text, _ = report(tmp_path, walk())
    assert "overlay.mp4" not in text
    assert "captured/" not in text


def test_names_cannot_break_the_page(tmp_path: Path) -> None:
    name = "</script><script>alert('x')</script>\"&\udcff.jpg"
    records = [path_record(i, name=name) for i in range(30)]
    text, page = report(tmp_path, records, [still(12)])
    assert "<script>alert" not in text
    assert len(page.named("script")) == 2
    data = text.split('id="frames">')[1].split("</script>")[0]
    assert json.loads(data)["frames"][3]["name"].startswith("</script><script>alert")


def test_large_stills_and_long_recordings_stay_below_the_limit(tmp_path: Path) -> None:
    stills = [still(i, size_px=(720, 1280)) for i in range(8)]
    records = [path_record(i, captured=True) for i in range(4000)]
    report(tmp_path, records, stills)
    assert (tmp_path / "report.html").stat().st_size < MAX_BYTES


@pytest.mark.parametrize("count", [1, 2])
def test_a_very_short_replay_has_a_report(tmp_path: Path, count: int) -> None:
    _, page = report(tmp_path, walk()[:count])
    assert len(page.named("svg")) >= 4


def test_drawings_say_what_they_show(tmp_path: Path) -> None:
    _, page = report(tmp_path, walk())
    drawings = [found for found in page.named("svg") if found.get("role") == "img"]
    assert len(drawings) == 4
    assert all(found["aria-label"] for found in drawings)


@pytest.mark.parametrize(
    ("marks", "said"),
    [("apart", "amber dots are wrong and no view will help"), ("paper", "in red")],
)
def test_marks_are_explained_and_counted_apart(tmp_path: Path, marks: str, said: str) -> None:
    (tmp_path / "overlay.mp4").touch()
    shares = {"wrong_share": 0.021, "unseen_share": 0.013, "unfixable_share": 0.004}
    records = [path_record(i, **shares) for i in range(30)]
    summary = summarize(settings(options={"marks": marks}), records)
    path = tmp_path / "report.html"
    write_report(path, summary=summary, records=records, stills=[still(12)])
    text = path.read_text()
    assert said in text
    for words in ("2.10 % wrong", "1.30 % never seen", "0.40 % no view will help"):
        assert words.replace(" %", "\u00a0%") in text


def test_no_frame_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least 1 frame"):
        report(tmp_path, [])


# The chart


def test_the_curve_by_hand() -> None:
    records = [
        path_record(0),
        path_record(1, peaked_share=0.05, unseen_share=None, captured=False),
        path_record(2, peaked_share=0.10, unseen_share=None, captured=True),
    ]
    drawing = share_chart(records, (1060, 270), threshold_share=0.05)
    # x: 46 + 1000 * i / 2; y: 226 - 200 * share / 0.10.
    assert '<path class="curve" d="M546.0 126.0L1046.0 26.0"/>' in drawing
    assert 'class="threshold" x1="46" x2="1046" y1="126.0" y2="126.0"' in drawing
    assert drawing.count('class="shutter"') == 2
    assert "M1041.0 12h10.0l-5.0 9.0z" in drawing
    assert 'class="unseen"' not in drawing


def test_long_curves_are_thinned_out_but_keep_their_peak() -> None:
    records = [
        path_record(i, peaked_share=0.9 if i == 7777 else 0.01, captured=False)
        for i in range(8_000)
    ]
    drawing = share_chart(records, (1080, 300), threshold_share=0.05)
    assert len(drawing) < 200_000
    heights = [float(y) for y in re.findall(r"L[\d.]+ ([\d.]+)", drawing)]
    assert min(heights) == pytest.approx(26 + (300 - 44 - 26) * 0.1, abs=0.1)


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (None, "–"),
        (0.0, "0.00\u00a0%"),
        (0.0428, "4.28\u00a0%"),
        (0.0999, "10.0\u00a0%"),
        (1.0, "100.0\u00a0%"),
    ],
)
def test_shares_in_words(share: float | None, words: str) -> None:
    assert percent(share) == words


@pytest.mark.parametrize(("number", "nice"), [(0.03, 0.05), (1.0, 1.0), (2.1, 5.0), (7.0, 10.0)])
def test_nice_numbers(number: float, nice: float) -> None:
    assert nice_at_least(number) == pytest.approx(nice)


@given(st.floats(1e-9, 1e9))
def test_a_nice_number_is_at_least_the_number_and_at_most_two_and_a_half_times_it(
    number: float,
) -> None:
    assert number * (1 - 1e-6) <= nice_at_least(number) <= 2.5 * number * (1 + 1e-6)


@given(st.integers(0, 100_000), st.integers(2, 12))
def test_ticks_are_round_and_few(last: int, most: int) -> None:
    ticks = index_ticks(last, most)
    assert ticks[0] == 0
    assert ticks[-1] <= last
    assert len(ticks) <= most + 1


def test_nothing_nice_is_at_least_zero() -> None:
    with pytest.raises(ValueError, match="need a number > 0"):
        nice_at_least(0.0)


# The map


def line(direction: tuple[float, float, float], count: int = 20) -> list[FrameRecord]:
    return [
        path_record(
            i,
            position_m=np.array(direction) * i / 10,
            forward=np.array([0.0, 1.0, 0.0]),
            up=np.array([0.0, 0.0, 1.0]),
        )
        for i in range(count)
    ]


def test_a_walk_to_the_right_goes_to_the_right_of_the_map() -> None:
    records = line((1.0, 0.0, 0.0))  # z up, looking along y: right is x
    view = map_view(records)
    assert view.words == "seen from above"
    np.testing.assert_allclose(view.axes, [[1, 0, 0], [0, 1, 0]], atol=1e-9)
    places = view.point_m(np.array([r.position_m for r in records]))
    np.testing.assert_allclose(places[-1] - places[0], [1.9, 0.0], atol=1e-9)


def test_a_sheet_held_upright_is_seen_from_behind() -> None:
    records = [
        path_record(
            i,
            position_m=np.array([0.1 * (i % 5), 0.0, 0.1 * (i // 5)]),
            forward=np.array([0.0, 1.0, 0.0]),
            up=np.array([0.0, 0.0, 1.0]),
        )
        for i in range(25)
    ]
    view = map_view(records)
    assert view.words == "seen from behind the cameras"
    np.testing.assert_allclose(view.axes, [[1, 0, 0], [0, 0, 1]], atol=1e-9)


@examples(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_from_above_is_never_mirrored_and_does_not_depend_on_the_worlds_axes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    turned = [
        path_record(
            r.index, position_m=turn @ r.position_m, forward=turn @ r.forward, up=turn @ r.up
        )
        for r in walk()
    ]
    view = map_view(turned)
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(2), atol=1e-9)
    np.testing.assert_allclose(np.cross(*view.axes), turn @ [0.0, 0.0, 1.0], atol=1e-9)
    before = map_view(walk())
    placed = view.point_m(np.array([r.position_m for r in turned]))
    as_before = before.point_m(np.array([r.position_m for r in walk()]))
    np.testing.assert_allclose(placed, as_before, atol=1e-9)


def test_cameras_that_turn_over_have_a_map_too() -> None:
    records = [path_record(i, up=np.array([math.cos(i), math.sin(i), 0.0])) for i in range(FRAMES)]
    assert map_view(records).words == "in the plane in which it is widest"
    assert "nan" not in path_map(records, map_view(records), (640, 430))


@pytest.mark.parametrize("direction", [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)])
def test_a_path_without_width_is_drawn(direction: tuple[float, float, float]) -> None:
    records = line(direction)
    drawing = path_map(records, map_view(records), (640, 430))
    assert "nan" not in drawing
    assert "inf" not in drawing


def test_both_axes_have_the_scale_of_the_bar() -> None:
    records = line((1.0, 0.0, 0.0))  # 1.9 m in 640 - 2 * 26 px
    drawing = path_map(records, map_view(records), (640, 430))
    assert float(re.findall(r'data-scale="([\d.]+)"', drawing)[0]) == pytest.approx(588 / 1.9, 1e-4)
    assert f"h{0.5 * 588 / 1.9:.1f}v-5" in drawing
    assert "50\u00a0cm" in drawing


@pytest.mark.parametrize(
    ("length_m", "words"),
    [(0.005, "5\u00a0mm"), (0.2, "20\u00a0cm"), (1.0, "100\u00a0cm"), (2.0, "2\u00a0m")],
)
def test_lengths_in_words(length_m: float, words: str) -> None:
    assert words_of_length(length_m) == words


# The stills


def test_the_worst_and_the_most_ordinary_are_picked() -> None:
    shares = [None, 0.02, 0.9, 0.02, 0.02, 0.03, 0.5, 0.02, 0.01, 0.02]
    picker = StillPicker(worst=2, typical=1)
    for index, share in enumerate(shares):
        picker.offer(path_record(index, peaked_share=share), panels(seed=index))
    stills = picker.stills()
    assert [(s.index, s.kind) for s in stills] == [(2, "worst"), (6, "worst"), (1, "typical")]
    np.testing.assert_array_equal(stills[0].live, panels(seed=2).live)


def test_the_worst_are_not_neighbours_where_there_are_others() -> None:
    shares = [0.01] * 100
    shares[40:43] = [0.5, 0.6, 0.55]
    shares[80] = 0.3
    picker = StillPicker(worst=2, typical=0)
    for index, share in enumerate(shares):
        picker.offer(path_record(index, peaked_share=share), panels())
    assert [s.index for s in picker.stills()] == [41, 80]


def test_reused_buffers_and_long_walks_do_no_harm() -> None:
    picker = StillPicker()
    shown = panels()
    for index in range(1000):
        shown.live[:] = index % 256
        picker.offer(path_record(index, peaked_share=0.02 + index / 1e6), shown)
    stills = picker.stills()
    assert len(picker._ordinary) < 30
    assert next(s.index for s in stills if s.kind == "worst") == 999
    assert all((s.live == s.index % 256).all() for s in stills)
    assert all(400 < s.index < 600 for s in stills if s.kind == "typical")


def test_there_may_be_nothing_to_pick() -> None:
    picker = StillPicker()
    picker.offer(path_record(0), panels())
    assert picker.stills() == []


def test_stills_shrink_until_they_fit() -> None:
    stills = [still(i, size_px=(720, 1280)) for i in range(4)]
    whole = sum(len(jpeg) for three in encode_stills(stills, most_bytes=10**9) for jpeg in three)
    small = sum(len(jpeg) for three in encode_stills(stills, most_bytes=300_000) for jpeg in three)
    assert small <= 300_000 < whole
