"""Numbers that two languages, or code and documents, need are written once and agree."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from peaking.options import DEFAULT
from peaking.server import wire
from peaking.server.app import ServerOptions
from peaking.server.study import wire as study_wire

ROOT = Path(__file__).parents[2]
WEB = ROOT / "web" / "src"


@pytest.mark.parametrize(
    ("page", "says"),
    [
        ("design.md", f"settles over {wire.SETTLING_S:g} s"),
        ("protocol.md", f"comes every {wire.PING_S:g} s"),
        ("protocol.md", f"hears nothing for {wire.SILENCE_S:g} s"),
        ("protocol.md", f"at most {wire.MAX_POINTS:,}"),
        ("protocol.md", f"at most {wire.MAX_NEIGHBOURS} of them"),
        ("protocol.md", f"Version {wire.PROTOCOL}."),
        ("capture.md", f"dashed line is {100 * wire.PAPER_PEAKED_SHARE:.2f} %"),
    ],
)
def test_the_documents_say_the_same(page: str, says: str) -> None:
    text = " ".join((ROOT / "docs" / page).read_text().split())
    assert says in text


@pytest.mark.parametrize("module", [wire, study_wire])
def test_the_client_writes_none_of_them_again(module: object) -> None:
    """Constants of the wire are defined in TypeScript by the generated files alone."""
    for name in module.CONSTANTS:  # pyright: ignore[reportAttributeAccessIssue]
        again = [
            path.name
            for path in WEB.rglob("*.ts")
            if re.search(rf"\bconst {name} =", path.read_text()) and path.name != "wire.ts"
        ]
        assert again == []


@pytest.mark.parametrize("module", [wire, study_wire])
def test_the_client_uses_all_of_them(module: object) -> None:
    source = "\n".join(path.read_text() for path in WEB.rglob("*.ts") if path.name != "wire.ts")
    names = module.CONSTANTS  # pyright: ignore[reportAttributeAccessIssue]
    assert [name for name in names if not re.search(rf"\b{name}\b", source)] == []


def test_a_client_can_miss_two_pings() -> None:
    assert wire.SILENCE_S > 3 * wire.PING_S


def test_more_neighbours_than_clients_blend_are_refused_at_the_start() -> None:
    most = replace(DEFAULT, neighbours=wire.MAX_NEIGHBOURS)
    ServerOptions(devices=None, client_dir=Path("none"), options=most)
    more = replace(DEFAULT, neighbours=wire.MAX_NEIGHBOURS + 1)
    with pytest.raises(ValueError, match="neighbours <= 8, which is what clients can blend, got 9"):
        ServerOptions(devices=None, client_dir=Path("none"), options=more)
