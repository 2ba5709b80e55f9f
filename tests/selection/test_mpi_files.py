"""MPIs that workers share: a file that would take too much memory counts as damaged."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.mpi import Mpi
from peaking.selection import mpi_files
from peaking.selection.mpi_files import MpiFiles


def small_mpi() -> Mpi:
    return Mpi(
        Camera(Pinhole(10, 10, 9.0, 9.0, 5.0, 5.0), Rigid.identity()),
        np.array([2.0, 1.0]),
        np.zeros((1, 3), np.int32),
        np.zeros((1, 16, 16, 4), np.uint8),
        "layered",
    )


def test_what_unpacks_to_too_much_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = MpiFiles(tmp_path)
    files.get(0, small_mpi)
    assert files.read(0) is not None
    monkeypatch.setattr(mpi_files, "MAX_MPI_BYTES", 100)
    assert files.read(0) is None


def test_an_array_that_claims_too_much_is_not_made(tmp_path: Path) -> None:
    files = MpiFiles(tmp_path)
    files.get(0, small_mpi)
    head = io.BytesIO()
    shape = (2**50,)
    np.lib.format.write_array_header_1_0(
        head, {"descr": "|u1", "fortran_order": False, "shape": shape}
    )
    path = tmp_path / "000000.npz"
    with zipfile.ZipFile(path) as archive:
        kept = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in (kept | {"texels.npy": head.getvalue()}).items():
            archive.writestr(name, data)
    assert files.read(0) is None
