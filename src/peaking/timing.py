"""How long each stage took."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from contextlib import contextmanager


class Stopwatch:
    """Collects milliseconds per named stage."""

    def __init__(self, clock_s: Callable[[], float] = time.perf_counter) -> None:
        """Use a clock in seconds."""
        self._clock_s = clock_s
        self.stage_ms: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Generator[None]:
        """Add the time that the block takes to the stage."""
        start_s = self._clock_s()
        try:
            yield
        finally:
            elapsed_ms = (self._clock_s() - start_s) * 1e3
            self.stage_ms[name] = self.stage_ms.get(name, 0.0) + elapsed_ms

    def take(self) -> dict[str, float]:
        """Return what was collected and begin anew."""
        taken, self.stage_ms = self.stage_ms, {}
        return taken
