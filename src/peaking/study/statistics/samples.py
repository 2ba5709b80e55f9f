"""Numbers as they come into a test: finite, enough of them, and written for people."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64


def check_finite(values: Float64[np.ndarray, "..."]) -> None:
    """Refuse what is missing or infinite; leave participants out before.

    Raises:
        ValueError: A value is NaN or infinite.
    """
    if not np.isfinite(values).all():
        raise ValueError("need finite values; leave out the participants without one")


def differences(
    first: Float64[np.ndarray, "n"], second: Float64[np.ndarray, "n"]
) -> Float64[np.ndarray, "n"]:
    """Return first minus second, with differences that are only rounding set to 0.

    0.3 - 0.1 and 0.2 - 0.0 are one tie to a reader and two numbers to a computer: differences are
    rounded at 1e-12 of the largest value, so that ties and zeros are what they should be.

    Raises:
        ValueError: A value is not finite, or the lengths differ.
    """
    check_finite(first)
    check_finite(second)
    if first.shape != second.shape:
        raise ValueError(f"need pairs, got {len(first)} and {len(second)} numbers")
    largest = float(np.abs(np.concatenate((first, second))).max(initial=0.0))
    return rounded(first - second, scale=largest)


def rounded(values: Float64[np.ndarray, "..."], *, scale: float) -> Float64[np.ndarray, "..."]:
    """Round to 1e-12 of `scale`."""
    if scale == 0:
        return values
    digits = 12 - int(np.ceil(np.log10(scale)))
    return np.round(values, min(digits, 300))


def number(value: float) -> str:
    """Return a number as a sentence has it: at most six digits, a true minus."""
    return f"{value:.6g}".replace("-", "−")
