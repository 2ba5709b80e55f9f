"""Where a command looks when no recording is named."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from peaking.errors import RecordingError

SAMPLE = Path("scenes/desk")


def scenes_or_sample(scenes: Sequence[Path]) -> Sequence[Path]:
    """Return the named recordings, or the sample scene of the checkout.

    Raises:
        RecordingError: None is named, and the sample is not below the current folder.
    """
    if scenes:
        return scenes
    if not (SAMPLE / "transforms.json").is_file():
        raise RecordingError(
            SAMPLE,
            "the sample scene is not here",
            remedy="name a recording, or run the command in a checkout of peaking",
        )
    return [SAMPLE]
