"""The .ply file: layout by hand, and back again."""

from __future__ import annotations

import contextlib
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from peaking.errors import SplatFileError
from peaking.splat.columns import MEANS, NUM_COLUMNS, QUATS
from peaking.splat.gaussians import Gaussians
from peaking.splat.ply import encode_ply, read_ply, write_ply
from splat.scenes_of_gaussians import cloud


@pytest.mark.parametrize("sh_degree", (0, 1))
def test_what_is_written_is_read(tmp_path: Path, sh_degree: int) -> None:
    rows = cloud(17, sh_degree=sh_degree).astype(np.float32)
    write_ply(tmp_path / "a.ply", Gaussians.from_parameters(rows))
    read = read_ply(tmp_path / "a.ply").parameters()
    rows[:, QUATS] /= np.linalg.norm(rows[:, QUATS], axis=1, keepdims=True)
    np.testing.assert_allclose(read[:, QUATS], rows[:, QUATS], atol=1e-7)
    np.testing.assert_array_equal(np.delete(read, QUATS, axis=1), np.delete(rows, QUATS, axis=1))


def test_where_positions_are_counted_from_stands_in_the_file(tmp_path: Path) -> None:
    rows = cloud(3, sh_degree=0).astype(np.float32)
    origin_m = np.array([448262.25, -5411932.0, 0.1])
    data = encode_ply(Gaussians.from_parameters(rows, origin_m=origin_m))
    assert b"\ncomment origin_m 448262.25 -5411932.0 0.1\nelement vertex 3\n" in data
    (tmp_path / "a.ply").write_bytes(data)
    read = read_ply(tmp_path / "a.ply")
    np.testing.assert_array_equal(read.origin_m, origin_m)
    np.testing.assert_array_equal(read.means_m, rows[:, MEANS])
    (tmp_path / "b.ply").write_bytes(data.replace(b"-5411932.0 ", b""))
    with pytest.raises(SplatFileError, match="three numbers"):
        read_ply(tmp_path / "b.ply")


def test_properties_and_their_order() -> None:
    rows = np.zeros((1, NUM_COLUMNS[1]), np.float32)
    rows[0] = np.arange(NUM_COLUMNS[1])
    head, _, body = encode_ply(Gaussians.from_parameters(rows)).partition(b"end_header\n")
    lines = head.decode().splitlines()
    assert lines[:3] == ["ply", "format binary_little_endian 1.0", "element vertex 1"]
    names = [line.removeprefix("property float ") for line in lines[3:]]
    values = dict(zip(names, np.frombuffer(body, "<f4").tolist(), strict=True))
    assert names[:6] == ["x", "y", "z", "nx", "ny", "nz"]
    assert names[-8:] == [
        "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
    ]  # fmt: skip
    assert [values[f"f_dc_{k}"] for k in range(3)] == [11, 12, 13]
    # All 15 coefficients of red, then green, then blue; those of degree 2 and 3 are 0.
    assert len(names) == 62
    rest = [values[f"f_rest_{k}"] for k in range(45)]
    for channel, own in enumerate([[14, 17, 20], [15, 18, 21], [16, 19, 22]]):
        assert rest[15 * channel : 15 * channel + 15] == own + [0] * 12
    assert [values["opacity"], values["scale_0"]] == [10, 3]
    assert values["rot_0"] == pytest.approx(6 / (6**2 + 7**2 + 8**2 + 9**2) ** 0.5)


def test_a_file_of_degree_1_as_others_write_it(tmp_path: Path) -> None:
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", *(f"f_rest_{k}" for k in range(9))]
    names += ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    head = ["ply", "format binary_little_endian 1.0", "comment by hand", "element vertex 1"]
    head += [f"property float {name}" for name in names] + ["end_header", ""]
    values = np.arange(len(names), dtype="<f4")
    (tmp_path / "a.ply").write_bytes("\n".join(head).encode() + values.tobytes())
    read = read_ply(tmp_path / "a.ply")
    np.testing.assert_array_equal(read.sh[0], [[3, 4, 5], [6, 9, 12], [7, 10, 13], [8, 11, 14]])
    np.testing.assert_array_equal(read.quaternions[0], [19, 20, 21, 22])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a binary"),
        (b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nend_header\n", "lacks x"),
        (b"ply\nformat ascii 1.0\nend_header\n", "not a binary"),
        (b"ply\nend_header\n", "not a binary"),
        (b"plyend_header\n", "not a binary"),
        (
            b"ply\nformat binary_little_endian 1.0\nelement vertex "
            + b"9" * 5000
            + b"\nend_header\n",
            "Gaussians",
        ),
    ],
)
def test_other_files_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.raises(SplatFileError, match=message):
        read_ply(tmp_path / "a.ply")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"float f_rest_0\n", b"float f_rest_x\n", "lacks f_rest_0"),
        (b"float f_rest_44\n", b"float f_rest_99\n", "lacks f_rest_44"),
        (b"float nx\n", b"float x\n", "twice"),
        (b"float nx\n", b"float f_rest_45\n", "lacks f_rest_46"),
        (b"vertex 3\n", b"vertex 99999999999\n", "at most 16,777,216"),
    ],
)
def test_odd_properties_are_refused(tmp_path: Path, old: bytes, new: bytes, message: str) -> None:
    data = encode_ply(Gaussians.from_parameters(cloud(3).astype(np.float32)))
    assert old in data
    (tmp_path / "a.ply").write_bytes(data.replace(old, new))
    with pytest.raises(SplatFileError, match=message):
        read_ply(tmp_path / "a.ply")


def test_reading_takes_the_memory_of_the_gaussians(tmp_path: Path) -> None:
    """Of a file with many more properties, most of it a hole."""
    n, own = 20_000, 14 * 4
    data = encode_ply(Gaussians.from_parameters(cloud(3).astype(np.float32)))
    head = data[: data.index(b"end_header")].replace(b"vertex 3\n", b"vertex %d\n" % n)
    head += b"".join(b"property float more_%d\n" % k for k in range(1000)) + b"end_header\n"
    with (tmp_path / "a.ply").open("wb") as file:
        file.write(head)
        file.truncate(len(head) + 4 * n * 1062)
    tracemalloc.start()
    try:
        assert len(read_ply(tmp_path / "a.ply")) == n
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 2 * n * (own + 9 * 4) + 4_000_000


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.integers(0, 1500), st.binary(min_size=1, max_size=8), st.integers(0, 12))
def test_any_damage_is_gaussians_or_a_sentence(
    tmp_path: Path, at: int, damage: bytes, lost: int
) -> None:
    good = encode_ply(Gaussians.from_parameters(cloud(3).astype(np.float32)))
    (tmp_path / "a.ply").write_bytes(good[:at] + damage + good[at + lost :])
    with contextlib.suppress(SplatFileError):  # anything else is a fault
        assert len(read_ply(tmp_path / "a.ply")) <= 3


def test_cut_off_and_missing_files_are_refused(tmp_path: Path) -> None:
    data = encode_ply(Gaussians.from_parameters(cloud(3).astype(np.float32)))
    (tmp_path / "a.ply").write_bytes(data[:-1])
    with pytest.raises(SplatFileError, match="bytes of data"):
        read_ply(tmp_path / "a.ply")
    with pytest.raises(SplatFileError, match="cannot be read"):
        read_ply(tmp_path / "none.ply")


def test_not_finite_parameters_are_refused() -> None:
    rows = cloud(3).astype(np.float32)
    rows[1, 4] = np.nan
    with pytest.raises(ValueError, match="finite log_scales"):
        Gaussians.from_parameters(rows)
