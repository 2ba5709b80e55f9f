"""The .ply file: layout by hand, and back again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from peaking.splat.errors import SplatFileError
from peaking.splat.gaussians import Gaussians
from peaking.splat.ply import encode_ply, read_ply, write_ply
from splat.scenes_of_gaussians import cloud


@pytest.mark.parametrize("sh_degree", (0, 1))
def test_what_is_written_is_read(tmp_path: Path, sh_degree: int) -> None:
    rows = cloud(17, sh_degree=sh_degree).astype(np.float32)
    write_ply(tmp_path / "a.ply", Gaussians.unpacked(rows))
    np.testing.assert_array_equal(read_ply(tmp_path / "a.ply").packed(), rows)


def test_properties_and_their_order() -> None:
    rows = np.zeros((1, 23), np.float32)
    rows[0] = np.arange(23)
    head, _, body = encode_ply(Gaussians.unpacked(rows)).partition(b"end_header\n")
    lines = head.decode().splitlines()
    assert lines[:3] == ["ply", "format binary_little_endian 1.0", "element vertex 1"]
    names = [line.removeprefix("property float ") for line in lines[3:]]
    values = dict(zip(names, np.frombuffer(body, "<f4").tolist(), strict=True))
    assert names[:6] == ["x", "y", "z", "nx", "ny", "nz"]
    assert names[-8:] == [
        "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
    ]  # fmt: skip
    assert [values[f"f_dc_{k}"] for k in range(3)] == [11, 12, 13]
    # All coefficients of red, then green, then blue.
    assert [values[f"f_rest_{k}"] for k in range(9)] == [14, 17, 20, 15, 18, 21, 16, 19, 22]
    assert [values["opacity"], values["scale_0"], values["rot_0"]] == [10, 3, 6]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a binary"),
        (b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nend_header\n", "lacks x"),
        (b"ply\nformat ascii 1.0\nend_header\n", "not a binary"),
        (b"ply\nend_header\n", "not a binary"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.raises(SplatFileError, match=message):
        read_ply(tmp_path / "a.ply")


def test_cut_off_and_missing_files_are_refused(tmp_path: Path) -> None:
    data = encode_ply(Gaussians.unpacked(cloud(3).astype(np.float32)))
    (tmp_path / "a.ply").write_bytes(data[:-1])
    with pytest.raises(SplatFileError, match="bytes of data"):
        read_ply(tmp_path / "a.ply")
    with pytest.raises(SplatFileError, match="cannot be read"):
        read_ply(tmp_path / "none.ply")


def test_not_finite_parameters_are_refused() -> None:
    rows = cloud(3).astype(np.float32)
    rows[1, 4] = np.nan
    with pytest.raises(ValueError, match="finite log_scales"):
        Gaussians.unpacked(rows)
