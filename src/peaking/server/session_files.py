"""Where the files of a session lie.

What was sent lies in `images/`, `depth/` and `points/`; of captures that were undone or set aside
it lies below `removed/`. What is made of it lies in `mpi/`.
"""

from __future__ import annotations

import contextlib
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from peaking.datasets.foreign_files import read_bytes
from peaking.errors import RecordingError
from peaking.output import write_atomically
from peaking.server import wire
from peaking.server.dataset import photo_name

TRANSFORMS = "transforms.json"
KEPT = ("images", "depth", "points")
"""Folders of what was sent."""

FOLDERS = (*KEPT, "mpi", "removed", *(f"removed/{name}" for name in KEPT))


@dataclass(frozen=True)
class SessionFiles:
    """The folder of a session."""

    folder: Path

    def path(self, capture: wire.Capture, name: str) -> Path:
        """Return where a file of a capture lies, by its name in the data set."""
        return self.folder / "removed" / name if capture.removed else self.folder / name

    def photo(self, capture: wire.Capture) -> Path:
        """Return where the photo of a capture lies."""
        return self.path(capture, photo_name(capture.number))

    def mpi(self, capture: wire.Capture, version: int) -> Path:
        """Return where a version of an MPI lies, or will."""
        suffix = "mpi" if version == 1 else f"{version}.mpi"
        return self.folder / "mpi" / f"{capture.number:06d}.{suffix}"

    def bytes_of(self, capture: wire.Capture, names: Iterable[str]) -> int:
        """Return how many bytes files of a capture have; those that are not there have none."""
        return sum(size_bytes(self.path(capture, name)) for name in names)

    def place(self, capture: wire.Capture, names: Iterable[str]) -> None:
        """Put the files of a capture where they belong; delete those that cannot be restored.

        Those of a capture that is not there and was never ended are left alone: they may come back.
        """
        if capture.removed and capture.ending is None:
            return
        lost = is_lost(capture)
        for name in names:
            kept, aside = self.folder / name, self.folder / "removed" / name
            if lost:
                kept.unlink(missing_ok=True)
                aside.unlink(missing_ok=True)
                continue
            source, target = (kept, aside) if capture.removed else (aside, kept)
            if source.exists() and not target.exists():
                source.rename(target)
        if lost:
            for made in (self.folder / "mpi").glob(f"{capture.number:06d}.*"):
                made.unlink(missing_ok=True)

    def drop_removed(self, kept: Iterable[wire.Capture]) -> None:
        """Delete what lies below `removed/`, except of these captures."""
        numbers = {capture.number for capture in kept}
        for name in KEPT:
            for path in (self.folder / "removed" / name).iterdir():
                if number_in(path) not in numbers:
                    path.unlink()

    def thumbnail(self, capture: wire.Capture) -> bytes | None:
        """Return a capture's thumbnail; None where there is none yet, or it is damaged."""
        for path in (self.folder / "mpi").glob(f"{capture.number:06d}.thumbnail.*.jpg"):
            with contextlib.suppress(RecordingError):
                data = read_bytes(path, within=self.folder)
                if path.name == _thumbnail_name(capture, data):
                    return data
        return None

    def keep_thumbnail(self, capture: wire.Capture, data: bytes) -> None:
        """Keep a capture's thumbnail in the place of any other.

        Raises:
            OSError: The disk is full, or fails.
        """
        for damaged in (self.folder / "mpi").glob(f"{capture.number:06d}.thumbnail.*"):
            damaged.unlink(missing_ok=True)
        write_atomically(self.folder / "mpi" / _thumbnail_name(capture, data), data)


def is_lost(capture: wire.Capture) -> bool:
    """Return whether the files of a capture are deleted, and must not be made again."""
    return capture.removed and not capture.restorable


def number_in(path: Path) -> int | None:
    """Return the number of the capture that a file is of; None where its name says none."""
    stem = path.name.split(".")[0]
    return int(stem) if stem.isascii() and stem.isdigit() and len(stem) < 10 else None


def size_bytes(path: Path) -> int:
    """Return the size of a file; 0 where there is none."""
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _thumbnail_name(capture: wire.Capture, data: bytes) -> str:
    return f"{capture.number:06d}.thumbnail.{zlib.crc32(data):08x}.jpg"
