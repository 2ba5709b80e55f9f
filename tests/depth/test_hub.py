"""Depth models of the hub's interface, tiny and drawn; and what is said where they are missing."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from depth_models import write_model
from peaking.checkpoints import (
    KNOWN,
    KnownCheckpoint,
    checkpoints_folder,
    depth_model_folder,
    state_of,
)
from peaking.depth.estimator import DepthEstimator
from peaking.depth.hub import Preparation
from peaking.depth.registry import create_estimator
from peaking.errors import CheckpointError

GREY = (0.5, 0.5, 0.5)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_model(tmp_path_factory.mktemp("models") / "tiny-hf")


def test_a_folder_is_an_estimator(model: Path) -> None:
    estimator = create_estimator(str(model), device="cpu")
    assert isinstance(estimator, DepthEstimator)
    assert (estimator.name, estimator.metric) == ("tiny-hf", False)
    rgb = np.random.default_rng(0).integers(0, 255, (64, 48, 3)).astype(np.uint8)
    disparity = estimator(rgb)
    assert disparity.shape == (64, 48)
    assert np.isfinite(disparity).all()
    np.testing.assert_array_equal(disparity, estimator(rgb))


def test_a_metric_model_gives_one_over_metres(tmp_path: Path) -> None:
    estimator = create_estimator(str(write_model(tmp_path, kind="metric")), device="cpu")
    assert estimator.metric
    disparity = estimator(np.zeros((48, 64, 3), np.uint8))
    assert disparity.min() >= 1 / 20 - 1e-6


def test_sizes_are_those_of_the_hub_s_own_preparation() -> None:
    small = Preparation(518, 518, True, 14, GREY, GREY)
    assert small.size_px(294, 639) == (238, 518)
    assert small.size_px(518, 518) == (518, 518)
    stretched = Preparation(384, 384, False, 1, GREY, GREY)
    assert stretched.size_px(294, 639) == (384, 384)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "[" * 50_000,
        '{"size":{"width":1e999}}',
        '{"size":{"width":NaN}}',
        '{"size":{"width":1000000}}',
        '{"size":{"height":-5}}',
        '{"size":{"height":0}}',
        '{"ensure_multiple_of":100000}',
        '{"size":7}',
        '{"image_mean":[1,2]}',
        '{"image_mean":[1e999,0,"x"]}',
        '{"x":"' + "x" * 70_000 + '"}',
    ],
)
def test_a_preparation_that_is_none_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "preprocessor_config.json"
    path.write_text(text)
    with pytest.raises(CheckpointError, match="cannot be used"):
        Preparation.read(path)


def test_colours_are_normalised() -> None:
    prepare = Preparation(14, 14, False, 14, (0.5, 0.0, 0.0), (0.5, 1.0, 2.0))
    made = prepare(np.full((14, 14, 3), 255, np.uint8))
    assert made.shape == (1, 3, 14, 14)
    np.testing.assert_allclose(made[0, :, 0, 0], [1.0, 1.0, 0.5])


# Where files lie


def test_a_missing_model_is_said_with_what_to_put_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PEAKING_CHECKPOINTS", str(tmp_path))
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path / "hub"))
    with pytest.raises(CheckpointError) as caught:
        create_estimator("someone/some-depth-hf")
    assert "downloads nothing" in str(caught.value)
    assert f"into {tmp_path / 'some-depth-hf'}" in str(caught.value)


def test_damaged_weights_are_refused(tmp_path: Path) -> None:
    write_model(tmp_path)
    weights = tmp_path / "model.safetensors"
    weights.write_bytes(weights.read_bytes()[:1000])
    with pytest.raises(CheckpointError, match="cannot be read"):
        create_estimator(str(tmp_path), device="cpu")


def test_a_pickle_in_place_of_safetensors_is_not_opened(tmp_path: Path) -> None:
    write_model(tmp_path)
    (tmp_path / "model.safetensors").rename(tmp_path / "pytorch_model.bin")
    with pytest.raises(CheckpointError, match="cannot be read"):
        create_estimator(str(tmp_path), device="cpu")


def test_the_hub_s_cache_is_looked_into(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    snapshot = tmp_path / "models--someone--some-depth-hf/snapshots/abc"
    snapshot.mkdir(parents=True)
    (snapshot / "config.json").write_text("{}")
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path))
    assert depth_model_folder("someone/some-depth-hf", tmp_path / "none") == snapshot


def test_the_folder_of_checkpoints_can_be_chosen() -> None:
    assert checkpoints_folder({"PEAKING_CHECKPOINTS": "/w"}) == Path("/w")
    assert checkpoints_folder({"XDG_DATA_HOME": "/d"}) == Path("/d/peaking/checkpoints")


def test_hashes_that_were_published_are_compared(tmp_path: Path) -> None:
    known = KnownCheckpoint("n/model", "model/model.safetensors", "", "", "")
    assert state_of(known, tmp_path) == "missing"
    file = tmp_path / known.file
    file.parent.mkdir()
    file.write_bytes(b"weights")
    assert state_of(known, tmp_path) == "not published"
    note = file.parent / ".cache/huggingface/download/model.safetensors.metadata"
    note.parent.mkdir(parents=True)
    note.write_text(f"commit\n{hashlib.sha256(b'weights').hexdigest()}\n1.0\n")
    assert state_of(known, tmp_path) == "ok"
    file.write_bytes(b"other")
    assert state_of(known, tmp_path) == "wrong"


def test_a_cached_file_is_named_by_its_hash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    snapshot = tmp_path / "models--n--model/snapshots/abc"
    blobs = tmp_path / "models--n--model/blobs"
    snapshot.mkdir(parents=True)
    blobs.mkdir()
    (snapshot / "config.json").write_text("{}")
    blob = blobs / hashlib.sha256(b"weights").hexdigest()
    blob.write_bytes(b"weights")
    (snapshot / "model.safetensors").symlink_to(blob)
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path))
    known = KnownCheckpoint("n/model", "model/model.safetensors", "", "", "")
    assert state_of(known, tmp_path / "none") == "ok"
    blob.write_bytes(b"other")
    assert state_of(known, tmp_path / "none") == "wrong"


def test_every_known_file_has_a_licence_and_a_source() -> None:
    for known in KNOWN:
        assert known.licence
        assert known.source.startswith("https://")
