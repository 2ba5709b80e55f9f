from __future__ import annotations

import ast
import io
import logging
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import peaking
from peaking import cli
from peaking.errors import RecordingError
from peaking.terminal import LOGGING, LogFormatter, harmless, say

ROOT = Path(peaking.__file__).parent
CONTROLS = [
    *(chr(c) for c in (*range(0x20), *range(0x7F, 0xA0))),
    *"\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\u2028\u2029\ufeff",
    "\udcff",
]


@pytest.mark.parametrize("control", CONTROLS)
def test_no_control_character_is_left(control: str) -> None:
    shown = harmless(f"a{control}b")
    assert control not in shown
    assert shown.startswith("a\\")
    shown.encode()


@given(st.text())
def test_what_is_left_is_printable_or_joins(text: str) -> None:
    assert all(c.isprintable() or c in "\u200c\u200d" or ord(c) > 0x7F for c in harmless(text))
    assert harmless("台所 é “x” → ½") == "台所 é “x” → ½"


def test_a_line_stays_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    say("a\nskipped: b\x1b[2J", "c")
    assert capsys.readouterr().out == "a\\nskipped: b\\x1b[2J\nc\n"


def test_problems_are_shown_harmless(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: object) -> None:
        raise RecordingError(Path("a\x1b]0;owned\x07\nb"), "is\u202ebad", remedy="look")

    monkeypatch.setattr(cli.COMMANDS["quality"], "run", fail)
    with pytest.raises(SystemExit):
        cli.main(["quality", str(tmp_path)])
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1
    assert not set(shown) & set(CONTROLS) - {"\n"}


def test_logs_are_shown_harmless() -> None:
    out = io.StringIO()
    handler = logging.StreamHandler(out)
    handler.setFormatter(LogFormatter())
    log = logging.Logger("test")
    log.addHandler(handler)
    try:
        raise ValueError("from\x1b[1m\u202e")
    except ValueError:
        log.exception("session %s\nforged line", "a\x1b[31m")
    shown = out.getvalue()
    assert shown.startswith("session a\\x1b[31m\\nforged line\nTraceback")
    assert not set(shown) & set(CONTROLS) - {"\n"}


def test_the_servers_log_goes_this_way() -> None:
    code = (
        "import logging, logging.config; from peaking.terminal import LOGGING; "
        "logging.config.dictConfig(LOGGING); "
        "[logging.getLogger(n).warning('a\\x1bb') for n in ('peaking.server', 'uvicorn.error')]"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "a\\x1bb\n" * 2
    assert "LOGGING" in (ROOT / "server/serving.py").read_text()
    assert LOGGING["root"]["level"] == "WARNING"


def test_nothing_else_prints() -> None:
    """`say` is the one way to a terminal; what asks or shows progress gets harmless text."""
    found = set[str]()
    for path in ROOT.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            called = ast.unparse(node.func)
            if called in ("print", "tqdm.write", "sys.stdout.write", "sys.stderr.write"):
                found.add(f"{path.relative_to(ROOT)}: {called}")
            if called == "input" and "harmless" not in ast.unparse(node):
                found.add(f"{path.relative_to(ROOT)}: {called}")
    # The second writes source code, the others a code to scan, which is drawn with escapes.
    assert found == {
        "terminal.py: print",
        "server/typescript.py: sys.stdout.write",
        "commands/serving.py: sys.stdout.write",
        "commands/share.py: sys.stdout.write",
    }
