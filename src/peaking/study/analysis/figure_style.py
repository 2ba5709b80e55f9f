"""How all figures of the report look, and their bytes as SVG and PNG."""

# Matplotlib is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import functools
import io
import textwrap
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib import font_manager
from matplotlib.figure import Figure

INK, MUTED, LINE, PAPER = "#14181f", "#5a6472", "#dde1e7", "#ffffff"
COLOURS = ("#1d5fc4", "#d1495b", "#2f8f6b", "#b87900", "#7a4fb5", "#5a6472")
"""Of the conditions, in their order; they differ in lightness too."""

PNG_DPI = 200

FALLBACK_FONTS = (
    "Noto Sans CJK JP",
    "IPAexGothic",
    "IPAGothic",
    "TakaoPGothic",
    "Hiragino Sans",
    "Yu Gothic",
    "Noto Sans CJK SC",
    "WenQuanYi Zen Hei",
    "Microsoft YaHei",
    "Malgun Gothic",
)
"""For letters that Matplotlib's own font lacks; those that are installed are used."""

STYLE: dict[Any, Any] = {
    "text.parse_math": False,  # a label with dollars is a label
    "font.size": 9,
    "text.color": INK,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": MUTED,
    "figure.facecolor": PAPER,
    "svg.hashsalt": "peaking",  # the same data give the same bytes
    "svg.fonttype": "path",  # looks the same where the font is missing
}


@contextmanager
def styled() -> Generator[None, None, None]:
    """Draw inside with the report's style, whatever the user's own is."""
    with mpl.rc_context():
        mpl.rcdefaults()
        for name, value in STYLE.items():
            mpl.rcParams[name] = value
        mpl.rcParams["font.family"] = ["DejaVu Sans", *_installed_fallbacks()]
        yield


@functools.cache
def _installed_fallbacks() -> tuple[str, ...]:
    installed = set(font_manager.get_font_names())
    return tuple(name for name in FALLBACK_FONTS if name in installed)


def colour_of(condition: int) -> str:
    """Return the colour of a condition."""
    return COLOURS[condition % len(COLOURS)]


def wrapped(text: str, width: int) -> str:
    """Break a label into lines of at most `width` characters."""
    return "\n".join(textwrap.wrap(text, width, break_long_words=False)) or text


def svg_bytes(figure: Figure) -> bytes:
    """Return a figure as SVG; the same figure gives the same bytes."""
    out = io.BytesIO()
    with styled():
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    return out.getvalue()


def png_bytes(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    out = io.BytesIO()
    with styled():
        figure.savefig(out, format="png", dpi=PNG_DPI, metadata={"Software": None})
    return out.getvalue()
