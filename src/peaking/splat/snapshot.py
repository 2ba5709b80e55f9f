"""A training as it stands, to go on with it later as if it had not stopped."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from peaking.errors import SplatFileError
from peaking.output import write_atomically
from peaking.splat.optimiser import AdamState, Progress

_ARRAYS = ("parameters", "first_moment", "second_moment", "grad2d", "count")


@dataclass(frozen=True, eq=False)
class Snapshot:
    """All that changes while one trains.

    Attributes:
        state: Parameters and their moments.
        progress: What else the optimiser remembers.
        iteration: Steps that were taken.
        waiting: Pictures that are due before any is used again; the last is the next.
        random: State of the random numbers, as numpy's bit generators give it.
        pictures: Names of the pictures, in the order in which they were given.
    """

    state: AdamState
    progress: Progress
    iteration: int
    waiting: tuple[int, ...]
    random: dict[str, Any]
    pictures: tuple[str, ...]


def write_snapshot(path: Path, snapshot: Snapshot) -> None:
    """Write it, or replace the file.

    Raises:
        OutputError: There is no room for it, or the folder is not writable.
    """
    kept = {
        "steps": snapshot.progress.steps,
        "iteration": snapshot.iteration,
        "waiting": snapshot.waiting,
        "random": snapshot.random,
        "pictures": snapshot.pictures,
    }
    data = io.BytesIO()
    np.savez(
        data,
        parameters=snapshot.state.parameters,
        first_moment=snapshot.state.first_moment,
        second_moment=snapshot.state.second_moment,
        grad2d=snapshot.progress.grad2d,
        count=snapshot.progress.count,
        kept=np.array(json.dumps(kept)),
    )
    write_atomically(path, data.getvalue())


def read_snapshot(path: Path) -> Snapshot:
    """Read what `write_snapshot` wrote.

    Raises:
        SplatFileError: It is not there, or damaged.
    """
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            arrays = {name: _float32(file[name]) for name in _ARRAYS}
            kept = json.loads(str(file["kept"]))
        return Snapshot(
            AdamState(arrays["parameters"], arrays["first_moment"], arrays["second_moment"]),
            Progress(int(kept["steps"]), arrays["grad2d"], arrays["count"]),
            int(kept["iteration"]),
            tuple(map(int, kept["waiting"])),
            dict(kept["random"]),
            tuple(map(str, kept["pictures"])),
        )
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise SplatFileError(f"{path}: no training can go on from it ({error})") from error


def _float32(values: np.ndarray) -> Float32[np.ndarray, "..."]:
    if values.dtype != np.float32:
        raise ValueError(f"need float32, got {values.dtype}")
    return values
