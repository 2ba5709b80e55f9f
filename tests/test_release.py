"""What is built for others has the web client in it, or is not built."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGE = Path("src/peaking/server/client/index.html")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with one module, whose client is not built."""
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE", ".gitignore"):
        shutil.copy(ROOT / name, tmp_path)
    (tmp_path / PAGE).parent.mkdir(parents=True)
    shutil.copy(ROOT / "src/peaking/__init__.py", tmp_path / "src/peaking")
    return tmp_path


def build(checkout: Path, target: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", "dist"]
    return subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("target", ["sdist", "wheel"])
def test_without_the_client_nothing_is_built(checkout: Path, target: str) -> None:
    built = build(checkout, target)
    assert built.returncode != 0
    assert "Run `make client` in a checkout first" in built.stderr
    assert "Traceback" not in built.stderr
    assert not list((checkout / "dist").glob("peaking-*"))


def test_both_distributions_carry_the_client(checkout: Path) -> None:
    (checkout / PAGE).write_text("<p>the page</p>")
    for target in ("sdist", "wheel"):
        built = build(checkout, target)
        assert built.returncode == 0, built.stderr
    (source,) = (checkout / "dist").glob("*.tar.gz")
    with tarfile.open(source) as archive:
        assert f"{source.name.removesuffix('.tar.gz')}/{PAGE}" in archive.getnames()
    (wheel,) = (checkout / "dist").glob("*.whl")
    assert str(PAGE.relative_to("src")) in zipfile.ZipFile(wheel).namelist()
