"""Wrong arguments of the command line.

A ValueError is reported as a wrong argument only where arguments are checked: anywhere else it is a
fault of the program and ends with a traceback.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

from peaking.errors import PeakingError


class ArgumentError(PeakingError):
    """An argument of the command line is wrong; the message says what is needed."""


@contextmanager
def checked_arguments() -> Generator[None]:
    """Turn a ValueError into an `ArgumentError`: to be put around the making of a plan.

    Raises:
        ArgumentError: Something inside refused a value.
    """
    try:
        yield
    except ValueError as error:
        raise ArgumentError(str(error)) from error
