"""The code lies in the order the data goes: a stage imports earlier stages only."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import peaking

ROOT = Path(peaking.__file__).parent
ORDER = [
    "errors",
    "geometry",
    "frame",
    "point_cloud",
    "checkpoints",
    "depth",
    "mpi",
    "generate",
    "render",
    "align",
    "nearest",
    "metric_depth",
    "error_map",
    "overlay",
    "presets",
    "timing",
    "pipeline",
    "output",
    "page",
    "event_log",
    "mpi_file",
    "datasets",
    "poses",
    "guidance",
    "replay",
    "splat",
    "evaluate",
    "study",
    "server",
    "bench",
    "commands",
    "cli",
]
MODULES = sorted(p for p in ROOT.rglob("*.py") if p != ROOT / "__init__.py")


def stage_of(module: str) -> str:
    return module.split(".")[1]


def imports_of(path: Path) -> set[str]:
    """Return the stages that a file imports, wherever in the file."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == "peaking":
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("peaking."):
            found.add(stage_of(node.module or ""))
        elif isinstance(node, ast.Import):
            found |= {stage_of(n.name) for n in node.names if n.name.startswith("peaking.")}
    return found & set(ORDER)


def stage_of_file(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def test_every_file_belongs_to_a_stage() -> None:
    assert {stage_of_file(path) for path in MODULES} - set(ORDER) == set()


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_one_way(path: Path) -> None:
    own = ORDER.index(stage_of_file(path))
    later = {name for name in imports_of(path) if ORDER.index(name) > own}
    assert not later, f"imports later stages: {sorted(later)}"


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = "import sys, peaking; print([m for m in ('numba', 'cv2', 'numpy') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_command_line_starts_without_the_compiler() -> None:
    code = "import sys, peaking.cli; print([m for m in ('numba', 'cv2') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_study_server_starts_without_the_statistics() -> None:
    heavy = ("scipy", "statsmodels", "pandas", "matplotlib")
    code = (
        "import sys, peaking.cli, peaking.server.study.app, peaking.server.study.open_study; "
        f"print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
