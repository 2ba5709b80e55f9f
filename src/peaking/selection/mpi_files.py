"""MPIs that all workers of an evaluation share, one file each: every one is made once.

The files are large (4 MB at the paper's size) and taken away when the evaluation is done; the
format for keeps is `.mpi` (`peaking.mpi_file`), which is smaller and not exact.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import zipfile
from collections.abc import Callable, Generator
from pathlib import Path

import numpy as np

from peaking.errors import OutputError
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.limits import MAX_MPI_BYTES
from peaking.mpi import Mpi


class MpiFiles:
    """The MPIs of one recording, made with the same options, by the numbers of their frames."""

    def __init__(self, folder: Path) -> None:
        """Use a folder; it is made when something is kept."""
        self._folder = folder

    def get(self, index: int, make: Callable[[], Mpi]) -> Mpi:
        """Return the MPI of a frame, made and kept unless it was; who finds it in the making waits.

        Raises:
            OutputError: The folder is not writable, or the disk is full.
        """
        path = self._path(index)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with _alone(path.with_suffix(".lock")):
                known = _read(path)
                if known is None:
                    known = make()
                    _write(path, known)
        except OSError as error:
            raise OutputError(
                f"{path}: cannot be written ({error.strerror}); an evaluation needs some 4 MB per "
                "frame there while it runs"
            ) from error
        return known

    def read(self, index: int) -> Mpi | None:
        """Return what was kept; None where nothing was, or it is damaged."""
        return _read(self._path(index))

    def _path(self, index: int) -> Path:
        return self._folder / f"{index:06d}.npz"


@contextlib.contextmanager
def _alone(path: Path) -> Generator[None]:
    """Keep other processes waiting; a lock ends with its process."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _write(path: Path, mpi: Mpi) -> None:
    partial = path.with_suffix(f".{os.getpid()}")
    k, pose = mpi.camera.pinhole, mpi.camera.world_from_cam
    with partial.open("wb") as file:
        np.savez(
            file,
            size_px=np.array(k.size_px),
            intrinsics_px=np.array([k.fx_px, k.fy_px, k.cx_px, k.cy_px]),
            rotation=pose.rotation,
            translation_m=pose.translation_m,
            plane_depths_m=mpi.plane_depths_m,
            tile_places=mpi.tile_places,
            texels=mpi.texels,
            generator=np.array(mpi.generator),
        )
    partial.replace(path)


def _read(path: Path) -> Mpi | None:
    try:
        with path.open("rb") as file, np.load(file) as kept:
            if sum(entry.file_size for entry in kept.zip.infolist()) > MAX_MPI_BYTES:
                return None
            pinhole = Pinhole(*kept["size_px"].tolist(), *kept["intrinsics_px"].tolist())
            return Mpi(
                Camera(pinhole, Rigid(kept["rotation"], kept["translation_m"])),
                kept["plane_depths_m"],
                kept["tile_places"],
                kept["texels"],
                str(kept["generator"]),
            )
    except (OSError, ValueError, KeyError, EOFError, MemoryError, zipfile.BadZipFile):
        return None
