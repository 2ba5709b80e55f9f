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
    "terminal",
    "options",
    "limits",
    "geometry",
    "frame",
    "point_cloud",
    "checkpoints",
    "depth",
    "mpi",
    "generators",
    "rendering",
    "scale_alignment",
    "view_weights",
    "hole_filling",
    "memory",
    "metric_depth",
    "error_map",
    "overlay",
    "timing",
    "tracking",
    "light_field",
    "view_builder",
    "pipeline",
    "output",
    "pictures",
    "reports",
    "foreign_json",
    "event_log",
    "mpi_file",
    "poses",
    "datasets",
    "metrics",
    "selection",
    "guidance",
    "replay",
    "best_frames",
    "audit",
    "splat",
    "export",
    "experiments",
    "photographers",
    "study",
    "server",
    "share",
    "benchmarks",
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


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def files_imported_by(path: Path, modules: dict[str, Path]) -> set[Path]:
    """Return the files of the package that a file imports, wherever in the file.

    What only the type checker imports does not count.
    """
    found: set[Path] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
        if isinstance(node, ast.Import):
            found |= {modules[name.name] for name in node.names if name.name in modules}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            inner = {f"{node.module}.{name.name}" for name in node.names}
            found |= {modules[name] for name in inner & modules.keys()}
            if inner - modules.keys() and node.module in modules:
                found.add(modules[node.module])
    return found - {path}


def circles(imports: dict[Path, set[Path]]) -> list[list[Path]]:
    """Return the sets of files that import each other, in a circle of any length (Tarjan 1972)."""
    order: dict[Path, int] = {}
    low: dict[Path, int] = {}
    stack: list[Path] = []
    found: list[list[Path]] = []

    def visit(path: Path) -> None:
        order[path] = low[path] = len(order)
        stack.append(path)
        for other in imports[path]:
            if other not in order:
                visit(other)
                low[path] = min(low[path], low[other])
            elif other in stack:
                low[path] = min(low[path], order[other])
        if low[path] == order[path]:
            start = stack.index(path)
            if len(stack) - start > 1:
                found.append(sorted(stack[start:]))
            del stack[start:]

    for path in imports:
        if path not in order:
            visit(path)
    return found


def test_a_circle_of_three_files_is_found() -> None:
    a, b, c, d = (Path(name) for name in "abcd")
    assert circles({a: {b}, b: {c}, c: {a, d}, d: set()}) == [[a, b, c]]
    assert circles({a: {b, c}, b: {d}, c: {d}, d: set()}) == []


def test_no_files_import_each_other_in_a_circle() -> None:
    modules = {module_of(path): path for path in MODULES}
    found = circles({path: files_imported_by(path, modules) for path in MODULES})
    assert [[str(path.relative_to(ROOT)) for path in circle] for circle in found] == []


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_module_has_the_name_of_a_function_in_it(path: Path) -> None:
    """Else `peaking.a.b.b` is the one or the other, depending on what was imported before."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = {n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)}
    assert module_of(path).rsplit(".", 1)[-1] not in names


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
