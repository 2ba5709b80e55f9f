"""What an evaluation costs: processor seconds by kind of work, and memory."""

from __future__ import annotations

import os
import platform
import resource
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

KINDS = (
    "placing",
    "reading",
    "generating",
    "choosing",
    "photographing",
    "training",
    "rendering",
    "scoring",
)
"""Kinds of work: COLMAP; pictures, depth and kept MPIs; new MPIs; strategies, with the renderings
that they look at; simulated photographers, with their screens; 3D Gaussians; test views; measures.
Each second counts for one of them."""


@dataclass(frozen=True)
class Costs:
    """What the steps of an evaluation took together.

    Attributes:
        processor_s: Seconds of processors by kind, one of `KINDS`; of all steps, also of those
            that an earlier run did.
        mpis_made: How many MPIs were made, of any size.
        peak_mb: Highest memory of this process and of the workers that it had at once in this
            run, added up as if all had theirs at the same moment.
        processes: How many these are.
    """

    processor_s: Mapping[str, float]
    mpis_made: int
    peak_mb: float
    processes: int

    def line(self) -> str:
        """Return all of it in one line."""
        total_s = sum(self.processor_s.values())
        shares = ", ".join(
            f"{kind} {self.processor_s[kind] / max(total_s, 1e-9):.0%}"
            for kind in KINDS
            if self.processor_s.get(kind, 0.0) > 0
        )
        return (
            f"{total_s:.0f} processor seconds: {shares}; {self.mpis_made} MPIs made; "
            f"at most {self.peak_mb / 1e3:.1f} GB in {self.processes} processes"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return it as it is written into results."""
        return asdict(self)


def worker_name() -> str:
    """Return what tells this process from all others."""
    return f"{platform.node()}:{os.getpid()}"


def peak_mb() -> float:
    """Return the most memory that this process ever had, in megabytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def took(
    rest: str, total_s: float, stages_ms: Mapping[str, float], mpis_made: int
) -> dict[str, Any]:
    """Return what one step took, as plain data.

    Args:
        rest: The kind of the seconds that no stage has.
        total_s: Processor seconds of the step.
        stages_ms: Milliseconds of stages, which do not overlap.
        mpis_made: By this step.
    """
    seconds = {kind: ms / 1e3 for kind, ms in stages_ms.items()}
    seconds[rest] = max(0.0, total_s - sum(seconds.values()))
    return {
        "processor_s": seconds,
        "mpis_made": mpis_made,
        "worker": worker_name(),
        "peak_mb": peak_mb(),
    }


def added(steps: Iterable[Mapping[str, Any]], peaks_mb: Mapping[str, float]) -> Costs:
    """Add up what steps took; `peaks_mb` are the workers of this run, by name."""
    seconds: dict[str, float] = dict.fromkeys(KINDS, 0.0)
    made = 0
    for step in steps:
        made += step["mpis_made"]
        for kind, s in step["processor_s"].items():
            seconds[kind] += s
    peaks = {**peaks_mb, worker_name(): peak_mb()}
    return Costs(seconds, made, sum(peaks.values()), len(peaks))
