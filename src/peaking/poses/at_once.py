"""Places all pictures at once, in a process of its own: COLMAP cannot be interrupted in that.

    python -m peaking.poses.at_once DATABASE PICTURES OUT SEED

Models are written to OUT/0, OUT/1, …
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from peaking.poses.extra import hush, imported


def run(database: Path, pictures: Path, out: Path, *, seed: int) -> list[Path]:
    """Place all pictures; return the folders of models, none where it failed."""
    out.mkdir()
    files = [str(path) for path in (database, pictures, out)]
    subprocess.run(
        [sys.executable, "-m", "peaking.poses.at_once", *files, str(seed)],
        check=False,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    return sorted(path.parent for path in out.glob("*/points3D.bin"))


def main() -> None:
    """Do it."""
    database, pictures, out = map(Path, sys.argv[1:4])
    pycolmap = imported()
    hush(pycolmap)
    options = pycolmap.GlobalPipelineOptions()
    options.random_seed = int(sys.argv[4])
    pycolmap.global_mapping(database, pictures, out, options=options)


if __name__ == "__main__":
    main()
