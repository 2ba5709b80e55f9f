"""A recording out of a zip: what is said of it names the zip and the file in it."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.datasets.recording import Recording
from peaking.errors import RecordingError
from peaking.frame import Frame
from peaking.geometry import Camera


@runtime_checkable
class _KeepsPictures(Protocol):
    def picture_bytes(self, index: int, *, keep_exif: bool = False) -> bytes | None: ...


@contextlib.contextmanager
def named_in(archive: Path, folder: Path) -> Generator[None]:
    """Let errors about files in a folder be about those in the archive that it was unpacked from.

    Raises:
        RecordingError: Whatever was raised.
    """
    try:
        yield
    except RecordingError as error:
        if not error.path.is_relative_to(folder):
            raise
        inside = archive / error.path.relative_to(folder)
        problem = error.problem.replace(str(folder), str(archive))
        raise RecordingError(inside, problem, field=error.field, remedy=error.remedy) from error


@dataclass(frozen=True, eq=False)
class ArchivedRecording:
    """A recording seen in its archive (`datasets.recording.Recording`)."""

    unpacked: Recording
    """As it was unpacked."""
    archive: Path
    """The zip."""
    folder: Path
    """Where it was unpacked."""

    def __len__(self) -> int:
        return len(self.unpacked)

    @property
    def name(self) -> str:
        """As it was unpacked."""
        return self.unpacked.name

    @property
    def path(self) -> Path:
        """The zip."""
        return self.archive

    @property
    def format(self) -> str:
        """As it was unpacked."""
        return self.unpacked.format

    @property
    def notes(self) -> Sequence[str]:
        """The same, of the zip."""
        return tuple(
            note.replace(str(self.folder), str(self.archive)) for note in self.unpacked.notes
        )

    @property
    def names(self) -> Sequence[str]:
        """As they were unpacked."""
        return self.unpacked.names

    @property
    def cameras(self) -> Sequence[Camera]:
        """As they were unpacked."""
        return self.unpacked.cameras

    @property
    def timestamps_s(self) -> Sequence[float | None]:
        """As they were unpacked."""
        return self.unpacked.timestamps_s

    @property
    def has_depth(self) -> Sequence[bool]:
        """As it was unpacked."""
        with named_in(self.archive, self.folder):
            return self.unpacked.has_depth

    def read(self, index: int) -> Frame:
        """Decode one frame."""
        with named_in(self.archive, self.folder):
            return self.unpacked.read(index)

    def picture_bytes(self, index: int, *, keep_exif: bool = False) -> bytes | None:
        """Return a straight picture as it is stored; None where it has to be encoded."""
        with named_in(self.archive, self.folder):
            if isinstance(self.unpacked, _KeepsPictures):
                return self.unpacked.picture_bytes(index, keep_exif=keep_exif)
            return None

    def depth_size_px(self, index: int) -> tuple[int, int] | None:
        """Return it as it was unpacked."""
        with named_in(self.archive, self.folder):
            return self.unpacked.depth_size_px(index)

    def true_depth_m(self, index: int) -> Float32[np.ndarray, "h w"] | None:
        """Return it as it was unpacked."""
        with named_in(self.archive, self.folder):
            return self.unpacked.true_depth_m(index)

    def materials(self, index: int) -> UInt8[np.ndarray, "h w"] | None:
        """Return them as they were unpacked."""
        with named_in(self.archive, self.folder):
            return self.unpacked.materials(index)

    def group(self, index: int) -> str | None:
        """Return it as it was unpacked."""
        with named_in(self.archive, self.folder):
            return self.unpacked.group(index)

    def fingerprint(self) -> str:
        """Return it as it was unpacked."""
        return self.unpacked.fingerprint()

    def check_subset(
        self, indices: Sequence[int], *, follow_links: bool = False, keep_exif: bool = False
    ) -> None:
        """Refuse what is refused of the folder."""
        with named_in(self.archive, self.folder):
            self.unpacked.check_subset(indices, follow_links=follow_links, keep_exif=keep_exif)

    def write_subset(
        self,
        indices: Sequence[int],
        out: Path,
        *,
        follow_links: bool = False,
        keep_exif: bool = False,
    ) -> Recording:
        """Write some frames, as the folder does."""
        with named_in(self.archive, self.folder):
            return self.unpacked.write_subset(
                indices, out, follow_links=follow_links, keep_exif=keep_exif
            )
