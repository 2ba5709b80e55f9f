"""What is true in the population of a simulated study: the paper's numbers, or no effect at all.

Printed in the paper (section 4.1) are means and standard deviations of TCT, NCT and TLX
frustration, and medians of what was tested by ranks. Not printed, and assumed here: the standard
deviations of the latter, all numbers of what did not differ, and the correlation of the two numbers
of a participant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

CORRELATION = 0.3
"""Between the numbers of one participant in two conditions; assumed."""


@dataclass(frozen=True)
class Truth:
    """Distribution of one measure: normal, moved into its range and to the nearest step."""

    measure: str
    means: tuple[float, ...]
    """By condition, before rounding and clipping."""
    sds: tuple[float, ...]
    low: float
    high: float
    step: float = 0.0
    """0: any number."""

    def without_effect(self) -> Truth:
        """Return the same with the first condition's distribution in all of them."""
        count = len(self.means)
        return replace(self, means=self.means[:1] * count, sds=self.sds[:1] * count)


def _seconds(name: str, means: tuple[float, float], sds: tuple[float, float]) -> Truth:
    return Truth(name, means, sds, low=5.0, high=3600.0)


def _answer(name: str, means: tuple[float, float], points: int, sd: float = 1.0) -> Truth:
    return Truth(name, means, (sd, sd), low=1.0, high=float(points), step=1.0)


def _rating(
    name: str, means: tuple[float, float], sds: tuple[float, float] = (18.0, 18.0)
) -> Truth:
    return Truth(name, means, sds, low=0.0, high=100.0, step=5.0)


PAPER: tuple[Truth, ...] = (
    _seconds("nct_s", (37.6, 62.2), (15.6, 27.7)),
    # TCT of the paper is 99.9 ± 31.7 s: what is not NCT is waiting.
    Truth("waiting_s", (0.0, 37.7), (0.0, 15.4), low=0.0, high=3600.0),
    Truth("captures", (14.0, 11.0), (1.6, 1.9), low=1.0, high=200.0, step=1.0),
    _answer("s_conf", (4.5, 5.1), 7),
    _answer("satis", (4.5, 5.8), 7, sd=1.1),
    _answer("scene_focus", (2.2, 6.3), 7),
    _answer("sus_q1", (3.6, 3.6), 5),
    _answer("sus_q2", (2.2, 2.2), 5),
    _answer("sus_q3", (3.8, 3.8), 5),
    _answer("sus_q4", (2.0, 3.0), 5),
    _answer("sus_q5", (3.1, 4.0), 5),
    _answer("sus_q6", (2.2, 2.2), 5),
    _answer("sus_q7", (3.9, 3.9), 5),
    _answer("sus_q8", (2.3, 2.3), 5),
    _answer("sus_q9", (3.5, 3.5), 5),
    _answer("sus_q10", (1.9, 2.4), 5),
    _rating("tlx_mental", (35.0, 35.0)),
    _rating("tlx_physical", (30.0, 30.0)),
    _rating("tlx_temporal", (32.5, 17.0)),
    _rating("tlx_performance", (35.0, 35.0)),
    _rating("tlx_effort", (38.0, 38.0)),
    _rating("tlx_frustration", (42.0, 28.5), (28.0, 16.6)),
    Truth("peaked_mean", (6.5, 4.28), (1.8, 1.2), low=0.1, high=60.0),
)
"""The first condition is LLFF's guidance, the second the error peaking."""


def no_effect(truths: Sequence[Truth]) -> tuple[Truth, ...]:
    """Return truths in which the conditions do not differ."""
    return tuple(truth.without_effect() for truth in truths)
