import dataclasses
import hashlib
import importlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from metric_pairs import metric_pairs
from peaking.errors import BackendUnavailable, ToolMissing
from peaking.metrics import lpips
from peaking.metrics.lpips import METRICS, LpipsName, available, open_lpips
from random_weights import random_weights

TOLERANCE = 1e-5
"""Worst measured: 6.2e-8 on the packaged weights (tests/oracles/lpips_values.py)."""

NAMES: tuple[LpipsName, ...] = ("lpips-alex", "lpips-vgg", "st-lpips-alex")

PUBLISHED = {
    # lpips 0.1.4 and stlpips-pytorch 0.0.2 with tests/random_weights.py.
    ("lpips-alex", "rippled"): 0.06432998180389404,
    ("lpips-alex", "shifted"): 0.3931519687175751,
    ("lpips-alex", "hole"): 0.16525691747665405,
    ("lpips-alex", "grey"): 0.6315711140632629,
    ("lpips-vgg", "rippled"): 0.05828255042433739,
    ("lpips-vgg", "shifted"): 0.3316083550453186,
    ("lpips-vgg", "hole"): 0.09258127212524414,
    ("lpips-vgg", "grey"): 0.6743237972259521,
    ("st-lpips-alex", "rippled"): 0.02289687842130661,
    ("st-lpips-alex", "shifted"): 0.21343658864498138,
    ("st-lpips-alex", "hole"): 0.1875147670507431,
    ("st-lpips-alex", "grey"): 0.6974743008613586,
}


def install(name: LpipsName, home: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put a package and a backbone with random weights below `home`; return the backbone's folder.

    Their digits become the expected ones.
    """
    torch: Any = importlib.import_module("torch")
    monkeypatch.setenv("TORCH_HOME", str(home / "torch"))
    monkeypatch.setenv("PEAKING_CHECKPOINTS", str(home / "no weights"))
    monkeypatch.syspath_prepend(home / "packages")
    metric = METRICS[name]
    package = home / "packages" / metric.package
    (package / metric.heads).parent.mkdir(parents=True)
    (package / "__init__.py").write_text("raise RuntimeError('imported')", encoding="utf-8")
    backbone, heads = (
        {key: torch.from_numpy(value) for key, value in part.items()}
        for part in random_weights(name)
    )
    if metric.backbone is None:
        heads |= backbone
    torch.save(heads, package / metric.heads)
    metric = dataclasses.replace(metric, heads_sha256=digits_of(package / metric.heads))
    folder = home / "weights"
    folder.mkdir()
    if metric.backbone is not None:
        torch.save(backbone | {"classifier.1.bias": torch.zeros(3)}, folder / "new")
        named = f"net-{digits_of(folder / 'new')}.pth"
        (folder / "new").rename(folder / named)
        metric = dataclasses.replace(metric, backbone=named)
    monkeypatch.setitem(METRICS, name, metric)
    return folder


def digits_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:8]


@pytest.mark.parametrize("name", NAMES)
def test_agreement_with_the_published_code(
    name: LpipsName, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = install(name, tmp_path, monkeypatch)
    distance = open_lpips(name, folder=folder)
    for pair, (image, reference) in metric_pairs().items():
        assert distance(image, reference) == pytest.approx(PUBLISHED[name, pair], abs=TOLERANCE)
    _, reference = metric_pairs()["hole"]
    assert distance(reference, reference) == 0.0
    with pytest.raises(ValueError, match="32 px"):
        distance(reference[:31], reference[:31])


def test_folders_are_searched_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = install("lpips-alex", tmp_path, monkeypatch)
    backbone = METRICS["lpips-alex"].backbone or ""
    assert not available("lpips-alex")
    with pytest.raises(ToolMissing, match=f"lpips-alex: needs .*{backbone}.*checkpoints; put it"):
        open_lpips("lpips-alex")
    hub = tmp_path / "torch" / "hub" / "checkpoints"
    hub.mkdir(parents=True)
    (hub / backbone).write_bytes((folder / backbone).read_bytes())
    assert available("lpips-alex")
    monkeypatch.setenv("PEAKING_CHECKPOINTS", str(tmp_path / "named"))
    (tmp_path / "named").mkdir()
    (tmp_path / "named" / backbone).write_bytes(b"an error page")
    with pytest.raises(ToolMissing, match=r"named/.*SHA-256 begins with"):
        open_lpips("lpips-alex")
    open_lpips("lpips-alex", folder=folder)


def test_other_weights_in_the_package_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install("st-lpips-alex", tmp_path, monkeypatch)
    metric = dataclasses.replace(METRICS["st-lpips-alex"], heads_sha256="b356b382")
    monkeypatch.setitem(METRICS, "st-lpips-alex", metric)
    with pytest.raises(ToolMissing, match="replace it by the published file"):
        open_lpips("st-lpips-alex")


def test_what_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install("st-lpips-alex", tmp_path, monkeypatch)
    metric = METRICS["st-lpips-alex"]
    monkeypatch.setitem(METRICS, "st-lpips-alex", dataclasses.replace(metric, heads="other.pth"))
    with pytest.raises(ToolMissing, match="not in this version of stlpips-pytorch"):
        open_lpips("st-lpips-alex")
    absent = dataclasses.replace(metric, package="no_such_package")
    monkeypatch.setitem(METRICS, "st-lpips-alex", absent)
    with pytest.raises(ToolMissing, match="pip install --no-deps stlpips-pytorch"):
        open_lpips("st-lpips-alex")
    assert not available("st-lpips-alex")
    with pytest.raises(ValueError, match="need one of lpips-alex, lpips-vgg, st-lpips-alex"):
        lpips._metric("lpips")


def test_without_pytorch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(BackendUnavailable, match=r"peaking\[torch\]"):
        lpips._torch()
    assert not available("st-lpips-alex")


def test_importing_does_not_import_pytorch() -> None:
    code = "import sys, peaking.metrics.lpips; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
