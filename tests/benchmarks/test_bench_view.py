"""`peaking bench view`: its arguments, and what it computes from what it measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from peaking.benchmarks.view_first import medians
from peaking.benchmarks.view_material import scattered, served
from peaking.benchmarks.view_peers import library_example
from peaking.benchmarks.view_walk import slope_per_minute
from peaking.cli import main
from peaking.errors import ToolMissing
from peaking.splat.gaussians import Gaussians


def gaussians(count: int) -> Gaussians:
    """Return small red Gaussians in a row, a metre apart."""
    means_m = np.zeros((count, 3), np.float32)
    means_m[:, 0] = np.arange(count)
    return Gaussians(
        means_m=means_m,
        log_scales=np.full((count, 3), np.log(0.01), np.float32),
        quaternions=np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
        opacity_logits=np.zeros(count, np.float32),
        sh=np.ones((count, 1, 3), np.float32),
    )


def test_scattered_gaussians_lie_around_those_before_and_cover_as_much() -> None:
    few = gaussians(10)
    many = scattered(few, 4000, seed=3)
    assert len(many) == 4000
    away_m = many.means_m - np.round(many.means_m)
    assert np.abs(away_m).max() < 0.06
    assert away_m.std() == pytest.approx(0.01, rel=0.05)
    assert set(np.round(many.means_m[:, 0]).astype(int)) == set(range(10))
    area = [np.exp(2 * one.log_scales[:, 0]).sum() for one in (few, many)]
    assert area[1] == pytest.approx(area[0], rel=1e-4)
    np.testing.assert_array_equal(many.means_m, scattered(few, 4000, seed=3).means_m)


def test_nothing_cannot_be_scattered() -> None:
    with pytest.raises(ValueError, match="count >= 1"):
        scattered(gaussians(1), 0, seed=0)


def test_growth_is_told_by_the_later_values() -> None:
    times_s = [0.0, 5.0, 30.0, 60.0, 90.0, 120.0]
    values = [0.0, 50.0, 101.0, 102.0, 103.0, 104.0]  # what is made once is no growth
    assert slope_per_minute(times_s, values) == pytest.approx(2.0)
    with pytest.raises(ValueError, match="at least 2"):
        slope_per_minute([0.0, 100.0], [1.0, 2.0])


def test_medians_of_rounds_and_the_longest_wait() -> None:
    rounds = [{"first_picture_s": s, "mpis_by_then": 1.0} for s in (1.0, 4.0, 2.0)]
    expected = {"first_picture_s": 2.0, "mpis_by_then": 1.0, "first_picture_longest_s": 4.0}
    assert medians(rounds) == expected


def test_a_folder_is_served_as_it_is(tmp_path: Path) -> None:
    from urllib.request import urlopen

    (tmp_path / "a.bin").write_bytes(b"abc")
    with served(tmp_path) as address, urlopen(f"{address}/a.bin") as answer:
        assert answer.read() == b"abc"


def test_a_peer_that_cannot_be_built_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("peaking.benchmarks.view_peers.WEB", tmp_path / "nowhere")
    with pytest.raises(ToolMissing, match="make client"):
        library_example(tmp_path / "example", tmp_path / "a.ply")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--walk-s", "1"], "need --walk-s of at least 20"),
        (["--walk-s", "inf"], "need --walk-s of at least 20"),
        (["one", "two"], "need one recording, got 2"),
        (["nowhere"], "nowhere"),
    ],
)
def test_wrong_arguments_are_said(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["bench", "view", *arguments])
    assert ended.value.code == 2
    assert said in capsys.readouterr().err
