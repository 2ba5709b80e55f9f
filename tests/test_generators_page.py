"""The example of another generator on docs/generators.md runs, and is short."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs/generators.md").read_text(encoding="utf-8")
MAX_LINES = 60


def test_links_lead_somewhere() -> None:
    for link in re.findall(r"\]\(((?!https?:)[^)#]+)\)", PAGE):
        assert (ROOT / "docs" / link).exists(), link


def test_the_example_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    assert len(code.splitlines()) <= MAX_LINES
    monkeypatch.chdir(ROOT)
    exec(compile(code, "docs/generators.md", "exec", dont_inherit=True), {"__name__": "example"})
    said = capsys.readouterr().out
    assert re.fullmatch(r"\d+\.\d% of the pixels are wrong with cutouts\n", said)
