"""`peaking weights`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Weights:
    """List the learned weights that peaking can use: where they go, licences, soundness.

    Nothing is downloaded. Files are compared with the hash that their authors published, as far as
    it is known here or the Hugging Face hub noted it beside the file. Those of the metrics
    lpips-alex and lpips-vgg go into the same folder: docs/perceptual-metrics.md.

    Examples:
      peaking weights
      peaking weights --folder ~/weights
    """

    folder: Path | None = None
    """Look here instead of in the folder that PEAKING_WEIGHTS names."""

    def run(self) -> None:
        """Look, and print; a file with a wrong hash is an error."""
        from peaking.errors import WeightsError
        from peaking.weights import KNOWN, file_of, state_of, weights_folder

        folder = self.folder or weights_folder()
        print(f"Weights are looked for in {folder} (PEAKING_WEIGHTS names another folder).")
        wrong: list[Path] = []
        for known in KNOWN:
            state, path = state_of(known, folder), file_of(known, folder)
            said = {
                "missing": f"missing; put it at {folder / known.file}",
                "ok": f"there, and as published: {path}",
                "not published": f"there, not checked: no published hash is known: {path}",
                "wrong": f"NOT as published: {path}",
            }[state]
            print(f"\n{known.name}: {known.purpose}\n  {said}")
            print(f"  licence: {known.licence}\n  from:    {known.source}")
            if state == "wrong" and path is not None:
                wrong.append(path)
        if wrong:
            names = ", ".join(map(str, wrong))
            raise WeightsError(f"{names}: SHA-256 is not the published one; fetch it again")
