"""What is shown in a terminal: names and problems come from anywhere, and control nothing there."""

from __future__ import annotations

import logging
import sys
import traceback
import unicodedata
from types import TracebackType
from typing import Any

_JOINERS = "\u200c\u200d"
"""Emoji and several scripts need them; they move nothing."""
_CONTROLS = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Unicode's categories: control and format characters, halves of pairs, breaks of lines."""

LOGGING: dict[str, Any] = {
    "version": 1,
    "disable_existing_loggers": False,
    "formatters": {"plain": {"()": "peaking.terminal.LogFormatter"}},
    "handlers": {"stderr": {"class": "logging.StreamHandler", "formatter": "plain"}},
    "root": {"handlers": ["stderr"], "level": "WARNING"},
}
"""For `logging.config.dictConfig`: everything in one way to stderr."""


def harmless(text: str) -> str:
    r"""Return a text in which nothing controls a terminal: such characters become `\x1b`, `\n`.

    Those are the control characters (line breaks and tabs too), bidi overrides and other characters
    of format, and what is no character at all.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        c.encode("unicode_escape").decode("ascii")
        if unicodedata.category(c) in _CONTROLS and c not in _JOINERS
        else c
        for c in text
    )


def say(*lines: object, problem: bool = False) -> None:
    """Print lines, made harmless: a line break within one is shown, and does not break it.

    Args:
        lines: One line each; a text of several lines is handed in as `*text.splitlines()`.
        problem: Print to stderr.
    """
    out = sys.stderr if problem else sys.stdout
    for line in lines or ("",):
        print(harmless(str(line)), file=out)
    out.flush()


class LogFormatter(logging.Formatter):
    """Formats log lines, made harmless; only a traceback has several lines."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802
        """Return the message in one line."""
        return harmless(super().formatMessage(record))

    def formatException(self, ei: Any) -> str:  # noqa: N802
        """Return the traceback."""
        return _harmless_lines(super().formatException(ei))

    def formatStack(self, stack_info: str) -> str:  # noqa: N802
        """Return the stack."""
        return _harmless_lines(super().formatStack(stack_info))


def show_fault(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Print the traceback of a fault of the program, made harmless; for `sys.excepthook`."""
    say(*"".join(traceback.format_exception(kind, error, trace)).split("\n")[:-1], problem=True)


def _harmless_lines(text: str) -> str:
    return "\n".join(harmless(line) for line in text.split("\n"))
