"""The recordings that commands open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from peaking.commands.arguments import with_plain_help
from peaking.errors import RecordingError
from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.datasets import Recording

SAMPLE = Path("scenes/desk")


@tyro.conf.configure(tyro.conf.OmitArgPrefixes)
@with_plain_help
@dataclass(frozen=True)
class SceneOptions:
    """How the recording is read."""

    format: str | None = None
    """Its format by name (docs/formats.md), where looking at it does not tell."""
    images: Path | None = None
    """The folder of its pictures, where these lie elsewhere: of a COLMAP model, say."""
    refine: bool = False
    """Mend the recorded poses by what the pictures show (extra `colmap`; takes minutes, once), and
    keep them where that does not help."""

    def open(self, scene: Path, *, confined: bool = False, with_notes: bool = True) -> Recording:
        """Open a recording, and print what was left out or guessed.

        Raises:
            RecordingError: It cannot be used.
        """
        from peaking.datasets import Reading, open_recording

        recording = open_recording(scene, Reading(self.format, self.images), confined=confined)
        if self.refine:
            from peaking.datasets.mended_poses import refined

            recording = refined(recording)
        for note in recording.notes if with_notes else ():
            say(f"{scene}: {note}")
        return recording


def residuals_of(recording: Recording) -> dict[str, object]:
    """Return for `--json` how far off the matches of each picture are, where --refine looked."""
    from peaking.datasets.mended_poses import RefinedRecording

    if not isinstance(recording, RefinedRecording):
        return {}
    frames = [asdict(residual) for residual in recording.residuals]
    return {"refined": {"is_better": recording.mended.is_better, "frames": frames}}


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
