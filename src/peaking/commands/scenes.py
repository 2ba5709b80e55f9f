"""The recording that commands use when none is named."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from peaking.errors import RecordingError

SAMPLE = Path("scenes/desk")


def scenes_or_sample(scenes: Sequence[Path]) -> Sequence[Path]:
    """Return the named recordings, or the sample scene of the repository.

    Raises:
        RecordingError: None is named, and the current folder has no sample scene.
    """
    if scenes:
        return scenes
    if not (SAMPLE / "transforms.json").is_file():
        raise RecordingError(
            SAMPLE,
            "the sample scene is not in the current folder",
            remedy="name a recording, or run the command in a clone of the peaking repository",
        )
    return [SAMPLE]
