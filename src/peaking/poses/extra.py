"""The extra `colmap`, imported when it is asked for."""

from __future__ import annotations

import importlib
from typing import Any

from peaking.errors import BackendUnavailable


def imported(otherwise: str = "") -> Any:
    """Return pycolmap.

    Args:
        otherwise: What else can be done without it, as the end of a sentence.

    Raises:
        BackendUnavailable: It is not installed.
    """
    try:
        return importlib.import_module("pycolmap")
    except ImportError as error:
        raise BackendUnavailable(
            f"pycolmap is not installed: pip install 'peaking[colmap]'{otherwise}"
        ) from error


def hush(pycolmap: Any) -> None:
    """Let it print nothing, since it raises; some of its functions set that back."""
    pycolmap.logging.minloglevel = int(pycolmap.logging.FATAL)
