"""Depth models through OpenVINO say what they say in PyTorch; where the extra is installed."""

from __future__ import annotations

import logging
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jaxtyping import Float32, UInt8

from depth_models import write_model
from peaking.depth.registry import create_estimator
from peaking.errors import BackendUnavailable
from peaking.options import DepthRuntime

TOLERANCE = {"openvino": 1e-5, "openvino-bf16": 0.05}
"""Worst difference, by the range of what PyTorch says. Measured (OpenVINO 2026.4.1, a processor
that multiplies bfloat16): 8e-7 and 0.026."""

needs_openvino = pytest.mark.skipif(
    find_spec("openvino") is None, reason="needs the extra openvino"
)


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PEAKING_CHECKPOINTS", str(tmp_path / "weights"))
    return write_model(tmp_path / "model")


def picture(width_px: int = 64, height_px: int = 48) -> UInt8[np.ndarray, "h w 3"]:
    generator = np.random.default_rng(0)
    return generator.integers(0, 256, (height_px, width_px, 3)).astype(np.uint8)


def said(model: Path, runtime: DepthRuntime, **size: int) -> Float32[np.ndarray, "h w"]:
    return create_estimator(str(model), runtime=runtime)(picture(**size))


@needs_openvino
@pytest.mark.parametrize("runtime", TOLERANCE)
@pytest.mark.parametrize("size", [{}, {"width_px": 48, "height_px": 64}])
def test_it_says_what_pytorch_says(
    model: Path, runtime: DepthRuntime, size: dict[str, int]
) -> None:
    reference = said(model, "pytorch", **size)
    difference = np.abs(said(model, runtime, **size) - reference).max() / np.ptp(reference)
    logging.getLogger("measured").info("%s: %.1e", runtime, difference)
    assert difference < TOLERANCE[runtime]


@needs_openvino
def test_a_conversion_is_kept_and_one_that_is_damaged_made_again(
    model: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = said(model, "openvino")
    (kept,) = (tmp_path / "weights/openvino").iterdir()
    assert kept.name.endswith("-70x56")
    caplog.clear()
    with caplog.at_level(logging.INFO, "peaking.depth"):
        np.testing.assert_array_equal(said(model, "openvino"), first)
        assert "converting" not in caplog.text
        (kept / "model.xml").write_text("<net")
        np.testing.assert_array_equal(said(model, "openvino"), first)
        assert "is damaged" in caplog.text
    assert [path.name for path in kept.parent.iterdir()] == [kept.name]


@needs_openvino
def test_other_weights_are_converted_anew(model: Path, tmp_path: Path) -> None:
    said(model, "openvino")
    write_model(model, seed=2)
    said(model, "openvino")
    assert len(list((tmp_path / "weights/openvino").iterdir())) == 2


@needs_openvino
def test_where_nothing_can_be_kept_it_works_all_the_same(
    model: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "weights").write_text("not a folder")
    assert np.isfinite(said(model, "openvino")).all()
    assert "was not kept" in caplog.text


def test_where_openvino_is_missing_it_says_what_to_install(
    model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    missing: Any = None
    monkeypatch.setitem(sys.modules, "openvino", missing)
    with pytest.raises(BackendUnavailable, match=r"pip install 'peaking\[openvino\]'"):
        create_estimator(str(model), runtime="openvino")


def test_it_is_not_for_cuda(model: Path) -> None:
    with pytest.raises(BackendUnavailable, match="leave out --device cuda"):
        create_estimator(str(model), device="cuda", runtime="openvino")
