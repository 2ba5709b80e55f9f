"""Parts of the pages that people read: one file each, which needs no network.

Colours, fonts and the look of sections, tables and drawings are in `page.css`; a page adds its own.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from typing import cast


def html_page(title: str, body: str, *, style: str, below: str = "") -> str:
    """Return a page.

    Args:
        title: Plain text.
        body: What stands in <main>.
        style: A style sheet that is added to the common one.
        below: What stands after <main>, scripts for example.
    """
    common = resource("peaking.reports", "page.css")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{common}{style}</style>\n</head>\n<body>\n"
        f"<main>\n{body}</main>\n{below}</body>\n</html>\n"
    )


def resource(package: str, name: str) -> str:
    """Return a text file that lies in a package."""
    return resources.files(package).joinpath(name).read_text(encoding="utf-8")


def both_sizes(wide: str, narrow: str) -> str:
    """Return two sizes of a drawing, so that its text is legible on a phone; the style chooses."""
    return wide.replace('class="', 'class="wide ', 1) + narrow.replace(
        'class="', 'class="narrow ', 1
    )


def legend(entries: Sequence[tuple[str, str]]) -> str:
    """Return a legend of drawings, 26 by 14 units large, with words."""
    items = "".join(
        f'<li><svg viewBox="0 0 26 14" aria-hidden="true">{drawing}</svg>{words}</li>'
        for drawing, words in entries
    )
    return f'<ul class="legend">{items}</ul>'


def jpeg_image(jpeg: bytes, alt: str) -> str:
    """Return an <img> that has its picture in itself."""
    data = base64.b64encode(jpeg).decode()
    return f'<img alt="{html.escape(alt)}" src="data:image/jpeg;base64,{data}">'


def options_table(options: Mapping[str, object]) -> str:
    """Return every option with the names of the groups it is in, and its value."""
    rows = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>"
        for name, value in _flat(options)
    )
    return f'<table class="options">{rows}</table>'


def _flat(options: Mapping[str, object], above: str = "") -> Iterator[tuple[str, str]]:
    for name, value in options.items():
        if isinstance(value, Mapping):
            yield from _flat(cast("Mapping[str, object]", value), f"{above}{name}.")
        else:
            yield f"{above}{name}", str(value)
