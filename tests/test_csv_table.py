from __future__ import annotations

import ast
import csv
import io
import json
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import peaking
from peaking.reports.csv_table import csv_text

ROOT = Path(peaking.__file__).parent
SIGNS = "=+-@\uff1d\uff0b\uff0d\uff20"

nasty = st.text(st.sampled_from([*"=+-@\t\r\n;,\"' \x00\ufeff\u200bax1.(|!", "\uff1d"]), max_size=9)


def cells_of(text: str) -> list[list[str]]:
    return list(csv.reader(io.StringIO(text, newline="")))


@pytest.mark.parametrize(
    ("value", "written"),
    [
        ("=HYPERLINK(1)", "'=HYPERLINK(1)"),
        ("+49 30 1", "'+49 30 1"),
        ("-x", "'-x"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("\t=1", "'\t'=1"),
        ("\rx", "'\nx"),
        (" =1+1", "' =1+1"),
        ("a;=1+1", "a;'=1+1"),
        ("a\n- b", "a\n'- b"),
        ("\uff1d1", "'\uff1d1"),
        # What is no formula stays as it is.
        ("well-known", "well-known"),
        ("a=b", "a=b"),
        ("me@home", "me@home"),
        ("-0.250000", "-0.250000"),
        ("+3", "+3"),
        ("-1e-05", "-1e-05"),
        (-0.25, "-0.25"),
        (7, "7"),
        (None, ""),
        ("台所", "台所"),
    ],
)
def test_a_cell(value: object, written: str) -> None:
    assert cells_of(csv_text([["first", value]])) == [["first", written]]


def is_formula(cell: str) -> bool:
    """Return whether a spreadsheet may compute it."""
    begins = re.match(rf"[\s\x00\ufeff\u200b\"]*[{re.escape(SIGNS)}]", cell)
    return begins is not None and not re.fullmatch(r"[+-]?[0-9.]+(e[+-]?\d+)?", cell)


@given(st.lists(st.lists(nasty, min_size=1, max_size=3), min_size=1, max_size=3))
def test_no_spreadsheet_sees_a_formula(rows: list[list[str]]) -> None:
    text = csv_text(rows)
    read = [cells_of(text)]
    # Where commas part nothing, quotes in the middle of a line do not count.
    read += [[line.split(delimiter) for line in text.split("\n")] for delimiter in ";\t"]
    assert [cell for table in read for row in table for cell in row if is_formula(cell)] == []


@given(st.lists(nasty), st.floats(allow_nan=False))
def test_provenance_is_json_and_no_formula(texts: list[str], number: float) -> None:
    provenance = json.dumps({"scenes": texts, "threshold": number, "date": "2026-11-30"})
    first = csv_text([["a"]], provenance=provenance).split("\n")[0]
    assert first.startswith("# ")
    assert json.loads(first[2:]) == json.loads(provenance)
    cells = [cell for delimiter in ",;\t" for cell in first.split(delimiter)]
    assert [cell for cell in cells if is_formula(cell) and not cell.strip()[1:2].isdigit()] == []


def test_there_is_one_writer_of_csv() -> None:
    writers = set[str]()
    for path in ROOT.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [n.name for n in node.names] if isinstance(node, ast.ImportFrom) else []
            named = isinstance(node, ast.ImportFrom) and node.module == "csv"
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                named, names = node.value.id == "csv", [node.attr]
            if named and {"writer", "DictWriter"} & set(names):
                writers.add(str(path.relative_to(ROOT)))
    assert writers == {"reports/csv_table.py"}
