"""What phones told about the peaked share: a file that only grows, whose damaged lines are lost."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

import msgspec

from peaking.event_log import append, lines_of
from peaking.foreign_json import decode_json
from peaking.server import wire

FILE_NAME = "peaked.jsonl"
MAX_SAMPLES = 200_000
"""In a session: two days of one a second."""


class _OlderSample(msgspec.Struct, frozen=True):
    """A line of version 0.1.0."""

    time_s: float
    peaked_share: wire.Share
    missing_share: wire.Share
    views: int
    world_from_cam: wire.Pose


class PeakedSamples:
    """The samples of a session. Reading is for any thread, adding for one at a time."""

    def __init__(self, path: Path) -> None:
        """Read them; `damaged` counts those that cannot be read."""
        self.path = path
        samples, self.damaged = _read(path)
        self.last = samples[-1].peaked_share if samples else None
        self._times_s = {sample.time_s for sample in samples}

    def read(self) -> list[wire.PeakedSample]:
        """Return all samples, in the order they came."""
        return _read(self.path)[0]

    def add(self, samples: Sequence[wire.PeakedSample]) -> None:
        """Append each sample once; not waited for until it is on the disk.

        Beyond `MAX_SAMPLES` nothing more is kept.

        Raises:
            OSError: The disk is full, or fails; none of it was kept.
        """
        new = {s.time_s: s for s in samples if s.time_s not in self._times_s}
        if not new or len(self._times_s) + len(new) > MAX_SAMPLES:
            return
        lines = b"".join(msgspec.json.encode(sample) + b"\n" for sample in new.values())
        append(self.path, lines, durably=False)
        self._times_s.update(new)
        self.last = samples[-1].peaked_share


def _read(path: Path) -> tuple[list[wire.PeakedSample], int]:
    """Return the samples, and how many lines are damaged."""
    samples: list[wire.PeakedSample] = []
    damaged = 0
    with contextlib.suppress(FileNotFoundError):
        for line in lines_of(path):
            try:
                samples.append(_sample_of(line))
            except ValueError:
                damaged += 1
    return samples, damaged


def _sample_of(line: bytes) -> wire.PeakedSample:
    if b'"missing_share"' not in line:
        return decode_json(line, wire.PeakedSample)
    old = decode_json(line, _OlderSample)
    return wire.PeakedSample(
        old.time_s, old.peaked_share, old.views, old.world_from_cam, unseen_share=old.missing_share
    )
