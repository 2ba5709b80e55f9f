"""Time functions in turn, so that other load on the machine affects all of them alike."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

WARM_UP_ROUNDS = 2


@dataclass(frozen=True)
class Candidate:
    """Something to be timed.

    Attributes:
        name: As it is called in the results.
        call: Does the work once; gets the number of the round, to take another input each time.
        every: It is timed in every so-manieth round; more than 1 for what takes long.
    """

    name: str
    call: Callable[[int], object]
    every: int = 1


@dataclass(frozen=True)
class Timing:
    """How long one candidate took, over all rounds."""

    name: str
    median_ms: float
    p10_ms: float
    p90_ms: float
    rounds: int


@dataclass
class Result:
    """One line of the results file.

    Attributes:
        timing: How long it took.
        bytes: Size of what it made, median; None where that means nothing.
        vs: For each peer its median divided by ours: 12 means 12 times faster than the peer.
        note: What was done, in words.
    """

    timing: Timing
    bytes: int | None = None
    vs: dict[str, float] = field(default_factory=dict[str, float])
    note: str = ""

    def as_dict(self) -> dict[str, object]:
        """Return the line as it stands in the file."""
        return {
            "name": self.timing.name,
            "median_ms": round(self.timing.median_ms, 4),
            "p10_ms": round(self.timing.p10_ms, 4),
            "p90_ms": round(self.timing.p90_ms, 4),
            "rounds": self.timing.rounds,
            "bytes": self.bytes,
            "vs": {peer: round(ratio, 3) for peer, ratio in self.vs.items()},
            "note": self.note,
        }


def time_in_turn(
    candidates: Iterable[Candidate],
    *,
    rounds: int,
    clock_s: Callable[[], float] = time.perf_counter,
    progress: Callable[[range], Iterable[int]] = iter,
) -> dict[str, Timing]:
    """Call the candidates one after the other, round by round, after a warm-up.

    Raises:
        ValueError: Fewer than 1 round.
    """
    if rounds < 1:
        raise ValueError(f"need rounds >= 1, got {rounds}")
    candidates = list(candidates)
    for candidate in candidates:
        for n in range(WARM_UP_ROUNDS if candidate.every == 1 else 1):
            candidate.call(n)
    taken_ms: Mapping[str, list[float]] = {candidate.name: [] for candidate in candidates}
    for n in progress(range(rounds)):
        for candidate in candidates:
            if n % candidate.every == 0:
                start_s = clock_s()
                candidate.call(n)
                taken_ms[candidate.name].append((clock_s() - start_s) * 1e3)
    return {
        name: Timing(
            name,
            float(np.median(ms)),
            float(np.percentile(ms, 10)),
            float(np.percentile(ms, 90)),
            len(ms),
        )
        for name, ms in taken_ms.items()
    }


def machine() -> dict[str, object]:
    """Describe where the figures were taken, without names of hosts or paths."""
    model = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:  # noqa: PTH123
            names = [line.split(":", 1)[1].strip() for line in file if "model name" in line]
        model = names[0] if names else model
    except OSError:
        pass
    return {
        "cpu": model,
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "load_1min": round(os.getloadavg()[0], 2),
    }
