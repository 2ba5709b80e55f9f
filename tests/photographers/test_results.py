from __future__ import annotations

import json

import numpy as np
import pytest

from peaking.experiments.costs import Costs
from peaking.photographers.plan import PhotographersPlan
from peaking.photographers.results import Home, compare, photos_for
from peaking.photographers.table import Photographed, results_json, table_md

LIMITS = (8, 16, 32)


def home(scene: str, guide: str, photos: int, who: int, psnr: float) -> Home:
    scores = (psnr - 1, psnr, psnr + 1)
    return Home(scene, guide, "mpi", photos, who, photos, 30.0, scores, (0.5, 0.6, 0.7))


def some(scenes: tuple[str, ...] = ("desk", "room", "hall")) -> list[Home]:
    """`auto` at 16 photos is as `interval` at 32, for whoever it is."""
    return [
        home(scene, guide, photos, who, better + 2 * np.log2(photos) + who)
        for scene in scenes
        for guide, better in (("interval", 10.0), ("auto", 12.0))
        for photos in LIMITS
        for who in range(4)
    ]


def test_photos_for_a_quality_are_read_between_limits() -> None:
    curve = np.array([20.0, 22.0, 24.0])
    assert photos_for(22.0, curve, LIMITS) == pytest.approx(16)
    assert photos_for(23.0, curve, LIMITS) == pytest.approx(16 * 2**0.5)
    assert photos_for(10.0, curve, LIMITS) == 8
    assert photos_for(26.0, curve, LIMITS) == pytest.approx(64), "the last rise goes on"
    assert photos_for(99.0, curve, LIMITS) == 4 * 32, "but not for ever"
    assert photos_for(22.5, np.array([22.0, 21.0, 23.0]), LIMITS) == pytest.approx(16 * 2**0.5)


def test_differences_are_paired_over_photographers() -> None:
    rng = np.random.default_rng(0)
    differences, needed = compare(some(), reference="auto", limits=LIMITS, rng=rng)
    for difference in differences:
        if difference.measure == "ssim":
            continue
        ends = (difference.difference, difference.low, difference.high)
        np.testing.assert_allclose(ends, 2.0)
    names = {difference.scene for difference in differences}
    assert names == {"desk", "room", "hall", "unseen scenes"}
    assert len(differences) == 4 * 3 * 3
    psnr = [n for n in needed if n.measure != "ssim"]
    np.testing.assert_allclose([(n.share, n.low, n.high) for n in psnr], 0.5)
    assert all(n.reached for n in psnr)


def test_an_interval_is_as_wide_as_photographers_differ() -> None:
    rng = np.random.default_rng(1)
    homes = some(("desk",))
    noisy = [
        home(h.scene, h.guide, h.photos, h.photographer, h.value("psnr") + h.photographer)
        if h.guide == "auto"
        else h
        for h in homes
    ]
    differences, _ = compare(noisy, reference="auto", limits=LIMITS, rng=rng)
    first = differences[0]
    assert first.difference == pytest.approx(3.5)
    assert 2.0 <= first.low < 3.0
    assert 4.0 < first.high <= 5.0


def test_the_table_and_the_json_say_it() -> None:
    homes = some()  # all differ by the same, so that intervals have no width
    rng = np.random.default_rng(0)
    differences, needed = compare(homes, reference="auto", limits=LIMITS, rng=rng)
    plan = PhotographersPlan(photographers=4)
    costs = Costs({"photographing": 12.0}, 0, 100.0, 1)
    found = Photographed(plan.as_dict(), {}, "auto", LIMITS, homes, differences, needed, costs)
    table = table_md(found)
    assert "| room | auto | 19.50 / 18.60 (8)" in table
    assert "| PSNR, dB | *unseen scenes* | interval | +2.00 |" in table
    assert "| hall | interval | 50% | 50% |" in table
    read = json.loads(results_json(found))
    assert read["photographers"][0]["psnr_p5"] == pytest.approx(15.1)
    assert read["config"]["photographers"] == 4


@pytest.mark.parametrize(
    "wrong",
    ({"photos": ()}, {"photos": (0,)}, {"photos": (4, 4)}, {"photographers": 0}, {"seconds": 0.5}),
)
def test_a_plan_refuses_what_cannot_be(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="need"):
        PhotographersPlan(**wrong)  # type: ignore[arg-type]
