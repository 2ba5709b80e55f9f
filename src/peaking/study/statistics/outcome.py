"""What a test gives: a result with effects and their intervals, or a sentence why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass

CONFIDENCE = 0.95
"""Of every interval."""

NORMAL_QUANTILE = 1.959963984540054
"""Of the standard normal distribution, for that confidence."""

MIN_SAMPLE = 5
"""Participants (or pairs) below which nothing is tested.

With 4 pairs the smallest possible p-value of the Wilcoxon test is 0.125, and whether 4 numbers are
normal cannot be told.
"""


FISHER = "Fisher's z, variance under no effect; R's effectsize"
SCORE = "score interval, normal shift"
"""Methods of the two intervals that a rank-biserial has: the usual one, and one that holds."""


@dataclass(frozen=True)
class Effect:
    """The size of an effect and its 95 % confidence interval."""

    name: str
    """In words: `Cohen's d_av`."""
    symbol: str
    value: float
    low: float | None
    """Lower limit; none where the interval does not exist (the method says why)."""
    high: float | None
    method: str
    """How the interval was computed, with its source."""


@dataclass(frozen=True)
class Result:
    """A test that could be made."""

    test: str
    """In words: `paired t-test`."""
    symbol: str
    """Of the statistic: `t`, `V`, `U`, `F`."""
    statistic: float
    df: tuple[float, ...]
    """Degrees of freedom, none for rank tests."""
    p: float
    """Two-sided, not corrected for other tests."""
    n: int
    """Participants whose numbers were used."""
    effects: tuple[Effect, ...] = ()
    """The first is the one that is reported with the test. A rank-biserial is there twice, with the
    interval of Fisher's z and the score interval."""
    remarks: tuple[str, ...] = ()
    """What a reader has to know: ties, dropped zeros, how the p-value was computed."""

    def __post_init__(self) -> None:
        """Let no NaN pass in silence.

        Raises:
            ValueError: Statistic or p-value is not a number.
        """
        if math.isnan(self.statistic) or not 0 <= self.p <= 1:
            raise ValueError(f"{self.test}: got statistic {self.statistic}, p {self.p}")


@dataclass(frozen=True)
class Untestable:
    """A test that could not be made, and why: a sentence for the report."""

    test: str
    reason: str


Outcome = Result | Untestable
