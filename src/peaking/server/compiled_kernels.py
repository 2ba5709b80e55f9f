# pyright: reportUnknownMemberType=none
"""Hears of the kernels that numba compiles."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

from numba.core import event


@contextmanager
def listened_to(*, begun: Callable[[], None], compiled: Callable[[], None]) -> Generator[None]:
    """Listen while something inside uses kernels, in whatever thread.

    Kernels that come from numba's cache are not heard of.

    Args:
        begun: Called before a kernel is compiled, in the thread that compiles it.
        compiled: Called after that.
    """
    with event.install_listener("numba:compile", _Listener(begun, compiled)):
        yield


class _Listener(event.Listener):
    def __init__(self, begun: Callable[[], None], compiled: Callable[[], None]) -> None:
        self._begun = begun
        self._compiled = compiled

    def on_start(self, event: Any) -> None:
        if _is_ours(event):
            self._begun()

    def on_end(self, event: Any) -> None:
        if _is_ours(event):
            self._compiled()


def _is_ours(compiled: Any) -> bool:
    """Return whether it is a kernel of this package, and nothing that numba brings with it."""
    return str(compiled.data["dispatcher"].py_func.__module__).startswith("peaking.")
