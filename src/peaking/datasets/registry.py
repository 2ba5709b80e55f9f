"""The formats of recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from peaking.datasets import nerfstudio
from peaking.datasets.recording import Recording


@dataclass(frozen=True)
class Format:
    """A format that can be read.

    Attributes:
        name: What people call it.
        recognises: Whether a path looks like it, at a glance.
        open: Opens a recording, confined or not; raises `RecordingError` with file, field and
            remedy.
    """

    name: str
    recognises: Callable[[Path], bool]
    open: Callable[[Path, bool], Recording]


FORMATS: Sequence[Format] = (
    Format(
        "nerfstudio",
        nerfstudio.recognises,
        lambda root, confined: nerfstudio.open_recording(root, confined=confined),
    ),
)
"""Asked in this order; what none recognises is opened as the first, whose complaint is shown."""


def open_recording(path: Path | str, *, confined: bool = False) -> Recording:
    """Open a recording of any format.

    Args:
        path: Where it lies.
        confined: Read no file through a link that leaves the recording, now and later: for what is
            handed on to others.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    root = Path(path)
    chosen = next((known for known in FORMATS if known.recognises(root)), FORMATS[0])
    return chosen.open(root, confined)
