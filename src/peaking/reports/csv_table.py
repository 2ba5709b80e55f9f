"""The one writer of CSV files: what people typed never becomes a formula in a spreadsheet."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence

_SIGNS = "=+@\uff1d\uff0b\uff20\ufe62\ufe66\ufe6b"
"""Begin a formula, also in their wide and small forms; so do these:"""
_DASHES = "\\-\uff0d\ufe63\u2212"

# Spreadsheets skip spaces and invisible characters before a formula; where `;` or a tab parts the
# cells, quotes in the middle of a line do not count, so a formula may begin after these too.
_FORMULA = re.compile(
    r"(\A|[;\t\r\n\v\f\x85\u2028\u2029])"
    rf"(?=[\s\x00-\x20\x7f-\xa0\xad\u200b-\u200f\u2060\ufeff\"]*[{_SIGNS}{_DASHES}])"
)
_NUMBER = re.compile(r"[+-]?((\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|inf|nan)", re.ASCII)
_JSON_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')
_JSON_SPECIAL = re.compile(rf"[,;\x85\u2028\u2029{_SIGNS}]|(?<![0-9A-Za-z])[{_DASHES}]")


def csv_text(rows: Iterable[Sequence[object]], *, provenance: str | None = None) -> str:
    """Return rows as CSV; None is an empty cell, and text that begins a formula gets a `'` first.

    Text counts as the begin of a formula when its first visible character is `=`, `+`, `-` or `@`,
    or the first one after a `;`, a tab or a line break in it, or when it begins with a tab or a
    line break. Numbers stay numbers, also those that come as text (`-0.25`).

    Args:
        rows: Lines of cells: texts, numbers, None.
        provenance: JSON in one line, which stands first, after "# ".
    """
    out = io.StringIO()
    if provenance is not None:
        out.write(f"# {_harmless_json(provenance)}\n")
    writer = csv.writer(out, lineterminator="\n")
    for row in rows:
        writer.writerow([_cell(value) for value in row])
    return out.getvalue()


def _cell(value: object) -> object:
    if value is None or isinstance(value, bool | int | float):
        return value
    text = str(value)
    if _NUMBER.fullmatch(text):
        return text
    text = text.replace("\0", "\ufffd").replace("\r\n", "\n").replace("\r", "\n")
    if text[:1] in ("\t", "\n"):
        text = "'" + text
    return _FORMULA.sub(r"\1'", text)


def _harmless_json(text: str) -> str:
    """Return the same JSON, in which no text has a character that parts or begins a cell."""
    return _JSON_TEXT.sub(
        lambda found: _JSON_SPECIAL.sub(lambda m: f"\\u{ord(m[0]):04x}", found[0]), text
    )
