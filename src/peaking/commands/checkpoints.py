"""`peaking checkpoints`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from peaking.terminal import say


@dataclass(frozen=True)
class Checkpoints:
    """List the checkpoints of networks that peaking can use: where each goes, licence, hash.

    Nothing is downloaded. A file that is there is compared with the hash its authors published, if
    that is known or the Hugging Face hub stored it beside the file. The backbones of the metrics
    lpips-alex and lpips-vgg go into the same folder (docs/perceptual-metrics.md).

    Examples:
      peaking checkpoints
      peaking checkpoints --folder ~/checkpoints
    """

    folder: Path | None = None
    """Look in this folder instead of the one that PEAKING_CHECKPOINTS names."""

    def run(self) -> None:
        """Print the list; a file with a wrong hash is an error."""
        from peaking.checkpoints import KNOWN, checkpoints_folder, file_of, state_of
        from peaking.errors import CheckpointError

        folder = self.folder or checkpoints_folder()
        say(f"Folder of checkpoints: {folder} (set PEAKING_CHECKPOINTS to use another)")
        wrong: list[Path] = []
        for known in KNOWN:
            state, path = state_of(known, folder), file_of(known, folder)
            said = {
                "missing": f"missing; put it at {folder / known.file}",
                "ok": f"found, hash as published: {path}",
                "not published": f"found, not checked (no published hash is known): {path}",
                "wrong": f"WRONG HASH: {path}",
            }[state]
            say("", f"{known.name}: {known.purpose}", f"  {said}")
            say(f"  licence: {known.licence}", f"  from:    {known.source}")
            if state == "wrong" and path is not None:
                wrong.append(path)
        if wrong:
            names = ", ".join(map(str, wrong))
            raise CheckpointError(
                f"{names}: SHA-256 differs from the published one; download it again"
            )
