"""Files of Gaussians: read by gsply, by hand, and by ourselves; and the way up."""

from __future__ import annotations

import contextlib
import gzip
import json
import struct
from pathlib import Path
from typing import Any

import gsply
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes_of_gaussians import HERE, cloud

import peaking.export.splats
from peaking.errors import BackendUnavailable, OutputError, SplatFileError
from peaking.export.splats import (
    ENDINGS,
    convert_splats,
    ending_of,
    read_splats,
    upright,
    write_splats,
)
from peaking.export.up import AXES, Axis, turn
from peaking.geometry import Cam, Camera, Rigid, World
from peaking.splat.gaussians import NUM_COEFFICIENTS, Gaussians
from peaking.splat.ply import read_ply, write_ply
from peaking.splat.rasterise import render
from peaking.splat.turning import harmonics, turned

FILES = pytest.mark.parametrize("ending", ENDINGS)
TURNS = [turn(up, to, half_turn="x") for up in ("-y",) for to in AXES]


def gaussians(num: int = 700, *, degree: int = 1) -> Gaussians:
    """Return a cloud; those of a higher degree with coefficients of any size."""
    small = Gaussians.from_parameters(cloud(num, seed=4).astype(np.float32))
    rng = np.random.default_rng(5)
    sh = 0.2 * rng.normal(size=(num, NUM_COEFFICIENTS[degree], 3)).astype(np.float32)
    return Gaussians(small.means_m, small.log_scales, small.quaternions, small.opacity_logits, sh)


def any_rotation(seed: int) -> np.ndarray:
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.linalg.det(q)


@FILES
@pytest.mark.parametrize("degree", (0, 1, 2, 3))
def test_what_is_written_is_read_back(ending: str, degree: int, tmp_path: Path) -> None:
    meant = gaussians(degree=degree)
    path = tmp_path / f"scene{ending}"
    write_splats(path, meant)
    got = read_splats(path)
    assert [one.name for one in tmp_path.iterdir()] == [path.name]
    assert got.degree == degree
    order, own = np.lexsort(got.means_m.round(2).T), np.lexsort(meant.means_m.round(2).T)
    packed = ending in (".spz", ".compressed.ply")
    if packed:  # another order, and rounded: nearest neighbours
        apart_m = np.linalg.norm(got.means_m[:, None] - meant.means_m[None], axis=2)
        order, own = np.arange(len(got)), apart_m.argmin(axis=1)
        assert len(set(own.tolist())) > 0.99 * len(meant)
    most = 0.02 if packed else 1e-6
    np.testing.assert_allclose(got.means_m[order], meant.means_m[own], atol=most)
    off = np.abs(got.sh[order] - meant.sh[own])
    assert np.percentile(off, 95) < (0.03 if packed else 1e-7)
    assert np.abs(got.opacities[order] - meant.opacities[own]).max() < (0.01 if packed else 1e-6)


def test_gsply_reads_our_ply(tmp_path: Path) -> None:
    meant = gaussians(degree=1)
    write_splats(tmp_path / "scene.ply", meant)
    got: Any = gsply.plyread(tmp_path / "scene.ply")
    np.testing.assert_array_equal(got.means, meant.means_m)
    np.testing.assert_array_equal(got.scales, meant.log_scales)
    np.testing.assert_array_equal(got.sh0, meant.sh[:, 0])
    rest = got.shN.reshape(len(meant), -1, 3)
    np.testing.assert_array_equal(rest[:, :3], meant.sh[:, 1:])


def by_hand(data: bytes) -> dict[str, np.ndarray]:
    """Read a .glb as glTF's specification says."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    content = json.loads(data[20 : 20 + size])
    buffer_size, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0"
    assert content["extensionsUsed"] == ["KHR_gaussian_splatting"]
    assert content["buffers"] == [{"byteLength": buffer_size}]
    buffer = data[28 + size :]
    primitive = content["meshes"][0]["primitives"][0]
    assert primitive["mode"] == 0
    how = primitive["extensions"]["KHR_gaussian_splatting"]
    assert (how["kernel"], how["colorSpace"]) == ("ellipse", "srgb_rec709_display")
    found: dict[str, np.ndarray] = {}
    for name, number in primitive["attributes"].items():
        accessor = content["accessors"][number]
        view = content["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        kind = {5126: np.float32, 5121: np.uint8}[accessor["componentType"]]
        columns = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        part = buffer[view["byteOffset"] :][: view["byteLength"]]
        found[name] = np.frombuffer(part, kind).reshape(accessor["count"], columns)
    first = content["accessors"][primitive["attributes"]["POSITION"]]
    np.testing.assert_array_equal(first["min"], found["POSITION"].min(axis=0))
    np.testing.assert_array_equal(first["max"], found["POSITION"].max(axis=0))
    return found


def test_a_glb_is_what_the_extension_says(tmp_path: Path) -> None:
    meant = gaussians(degree=2)
    write_splats(tmp_path / "scene.glb", meant)
    found = by_hand((tmp_path / "scene.glb").read_bytes())
    prefix = "KHR_gaussian_splatting:"
    np.testing.assert_array_equal(found["POSITION"], meant.means_m)
    np.testing.assert_allclose(found[prefix + "SCALE"], np.exp(meant.log_scales), rtol=1e-6)
    np.testing.assert_allclose(found[prefix + "OPACITY"][:, 0], meant.opacities, rtol=1e-6)
    xyzw = found[prefix + "ROTATION"]
    np.testing.assert_allclose(np.linalg.norm(xyzw, axis=1), 1, atol=1e-6)
    wxyz = meant.quaternions / np.linalg.norm(meant.quaternions, axis=1, keepdims=True)
    np.testing.assert_allclose(xyzw, wxyz[:, [1, 2, 3, 0]], atol=1e-6)
    names = [f"SH_DEGREE_{d}_COEF_{k}" for d in range(3) for k in range(2 * d + 1)]
    for number, name in enumerate(names):
        np.testing.assert_array_equal(found[prefix + name], meant.sh[:, number])
    assert len(found) == 5 + len(names)


def test_harmonics_are_orthonormal_and_those_of_the_renderer() -> None:
    at = np.linspace(-1, 1, 201)[:-1] + 0.005
    around = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    z, angle = (grid.ravel() for grid in np.meshgrid(at, around))
    ring = np.sqrt(1 - z * z)
    values = harmonics(np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z]))
    products = values.T @ values * 4 * np.pi / len(z)
    np.testing.assert_allclose(products, np.eye(16), atol=2e-3)
    x_up = harmonics(np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]))[:, 1:4]
    np.testing.assert_allclose(
        x_up, 0.4886025 * np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]]), atol=1e-7
    )


@pytest.mark.parametrize("degree", (0, 1, 2, 3))
@pytest.mark.parametrize("rotation", [*TURNS, any_rotation(0), any_rotation(1)])
def test_what_is_turned_shows_the_same_in_turned_directions(
    degree: int, rotation: np.ndarray
) -> None:
    before = gaussians(30, degree=degree)
    after = turned(before, rotation)
    directions = np.random.default_rng(2).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    k = NUM_COEFFICIENTS[degree]
    shown = np.einsum("dk,nkc->ndc", harmonics(directions)[:, :k], before.sh)
    turned_shown = np.einsum("dk,nkc->ndc", harmonics(directions @ rotation.T)[:, :k], after.sh)
    np.testing.assert_allclose(turned_shown, shown, atol=2e-6)


@pytest.mark.parametrize("rotation", [*TURNS, any_rotation(3)])
def test_a_turned_scene_is_rendered_as_before(rotation: np.ndarray) -> None:
    before = gaussians(60)
    here = HERE.world_from_cam
    there = Camera(HERE.pinhole, Rigid[World, Cam](rotation @ here.rotation, np.zeros(3)))
    seen, again = render(before, HERE), render(turned(before, rotation), there)
    np.testing.assert_allclose(again.rgb, seen.rgb, atol=2e-5)
    np.testing.assert_allclose(again.depth_m, seen.depth_m, atol=2e-4)
    assert seen.alpha.max() > 0.5


def test_a_far_origin_turns_along(tmp_path: Path) -> None:
    origin_m = np.array([5e5, 5.4e6, 100.0])
    before = gaussians(20)
    far = Gaussians(
        before.means_m,
        before.log_scales,
        before.quaternions,
        before.opacity_logits,
        before.sh,
        origin_m,
    )
    rotation = turn("+z", "-y")
    after = turned(far, rotation)
    meant = (far.means_m + origin_m) @ rotation.T
    np.testing.assert_allclose(after.means_m + after.origin_m, meant, atol=1e-6)
    for ending in (".ply", ".glb", ".gltf"):
        write_splats(tmp_path / f"far{ending}", after)
        np.testing.assert_array_equal(
            read_splats(tmp_path / f"far{ending}").origin_m, after.origin_m
        )


UP: dict[str, Axis] = {
    ".ply": "-y",
    ".compressed.ply": "-y",
    ".spz": "+y",
    ".glb": "+y",
    ".gltf": "+y",
}


@FILES
@pytest.mark.parametrize("up", ("+y", "+z", "-y"))
def test_a_scene_stands_upright_where_it_is_read(ending: str, up: Axis, tmp_path: Path) -> None:
    """A tower along the scene's up is a tower along the up of the format."""
    low, high = gaussians(2), 1
    means_m = np.zeros((2, 3), np.float32)
    means_m[high] = 2.0 * np.float32(1) * turn("+y", up)[:, 1].astype(np.float32)
    tower = Gaussians(means_m, low.log_scales, low.quaternions, low.opacity_logits, low.sh)
    path = tmp_path / f"tower{ending}"
    write_splats(path, upright(tower, up, path))
    got = read_splats(path).means_m
    got = got[np.argsort(np.linalg.norm(got, axis=1))]
    np.testing.assert_allclose(got[1] - got[0], 2 * turn("+y", UP[ending])[:, 1], atol=0.01)


def test_formats_face_the_ways_that_others_turn_them(tmp_path: Path) -> None:
    """Niantic (.spz) turns .ply files about x, PlayCanvas (glTF) about z.

    The same was measured with splat-transform 2.7.1: it reads our .spz, and writes our .glb's
    numbers from our .ply.
    """
    source = gaussians(50)
    write_ply(tmp_path / "a.ply", source)
    convert_splats(tmp_path / "a.ply", tmp_path / "a.spz")
    convert_splats(tmp_path / "a.ply", tmp_path / "a.glb")
    spz: Any = gsply.read_spz(tmp_path / "a.spz")
    np.testing.assert_allclose(spz.means, source.means_m * [1, -1, -1], atol=2e-4)
    glb = by_hand((tmp_path / "a.glb").read_bytes())
    np.testing.assert_array_equal(
        glb["POSITION"], source.means_m * np.array([-1, -1, 1], np.float32)
    )
    convert_splats(tmp_path / "a.spz", tmp_path / "again.ply")
    again = read_ply(tmp_path / "again.ply")
    np.testing.assert_allclose(again.means_m, source.means_m, atol=2e-4)
    seen, there = render(source, HERE), render(again, HERE)
    assert np.abs(seen.rgb - there.rgb).mean() < 0.01


def test_spz_versions_hold_the_same(tmp_path: Path) -> None:
    meant = gaussians()
    write_splats(tmp_path / "3.spz", meant)
    write_splats(tmp_path / "4.spz", meant, spz_version=4)
    assert (tmp_path / "3.spz").read_bytes()[:2] == b"\x1f\x8b"
    assert (tmp_path / "4.spz").read_bytes()[:8] == b"NGSP\4\0\0\0"
    three, four = read_splats(tmp_path / "3.spz"), read_splats(tmp_path / "4.spz")
    np.testing.assert_array_equal(three.means_m, four.means_m)
    np.testing.assert_array_equal(three.sh, four.sh)


def test_spz_makes_room_for_large_scenes(tmp_path: Path) -> None:
    small = gaussians()
    wide = Gaussians(
        small.means_m * np.float32(3000),
        small.log_scales,
        small.quaternions,
        small.opacity_logits,
        small.sh,
    )
    write_splats(tmp_path / "wide.spz", wide)
    got = read_splats(tmp_path / "wide.spz")
    np.testing.assert_allclose(got.means_m, wide.means_m, atol=0.003)


def test_what_is_read_back_otherwise_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    meant = gaussians()
    moved = turned(meant, turn("+y", "+z"))

    def read(path: Path, ending: str) -> Gaussians:
        return moved

    monkeypatch.setattr(peaking.export.splats, "_read", read)
    for ending in ENDINGS:
        with pytest.raises(OutputError, match="read back with positions"):
            write_splats(tmp_path / f"x{ending}", meant)
    assert list(tmp_path.iterdir()) == []


def test_without_gsply_one_sentence_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(peaking.export.splats.importlib, "import_module", missing)
    with pytest.raises(BackendUnavailable, match=r"pip install 'peaking\[formats\]'"):
        write_splats(tmp_path / "x.spz", gaussians())
    write_splats(tmp_path / "x.glb", gaussians())


def test_endings_are_told_apart() -> None:
    assert ending_of(Path("a/x.compressed.ply")) == ".compressed.ply"
    assert ending_of(Path("a/x.PLY")) == ".ply"
    assert ending_of(Path("a.ply/x.obj")) is None
    with pytest.raises(OutputError, match="ends in one of"):
        read_splats(Path("x.obj"))


@pytest.mark.parametrize("ending", (".glb", ".gltf", ".spz", ".compressed.ply", ".ply"))
def test_damaged_files_are_refused(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"x{ending}"
    write_splats(path, gaussians(40))
    sound = path.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(60):
        damaged = bytearray(sound)
        for at in rng.integers(0, min(len(damaged), 2000), 5):
            damaged[at] = rng.integers(256)
        data = bytes(damaged[: rng.integers(1, len(damaged))]) if rng.random() < 0.3 else damaged
        path.write_bytes(bytes(data))
        with contextlib.suppress(SplatFileError):
            read_splats(path)


def test_an_spz_that_unpacks_to_more_than_it_says_is_refused(tmp_path: Path) -> None:
    """Before it is unpacked: a small file may hold gigabytes of zeros."""
    head = struct.pack("<4sIIBBBB", b"NGSP", 3, 10, 0, 12, 0, 0)
    path = tmp_path / "bomb.spz"
    path.write_bytes(gzip.compress(head + bytes(200_000_000), compresslevel=9))
    with pytest.raises(SplatFileError, match="more than its Gaussians take"):
        read_splats(path)
    write_splats(tmp_path / "4.spz", gaussians(10), spz_version=4)
    sound = (tmp_path / "4.spz").read_bytes()
    frame = zstandard.ZstdCompressor(level=19).compress(bytes(200_000_000))
    path.write_bytes(sound[:32] + struct.pack("<QQ", len(frame), 90) + sound[48:128] + frame)
    with pytest.raises(SplatFileError, match=r"more than its Gaussians take|no sound"):
        read_splats(path)
    path.write_bytes(struct.pack("<4sIIBBBB", b"NGSP", 4, 2**31, 0, 12, 0, 5) + bytes(100))
    with pytest.raises(SplatFileError, match="at most"):
        read_splats(path)


@given(data=st.binary(max_size=200))
@settings(max_examples=60, deadline=None)
@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("start", (b"", b"glTF\2\0\0\0", b"NGSP\4\0\0\0", b"\x1f\x8b", b"{}"))
def test_any_bytes_are_refused(
    tmp_path_factory: pytest.TempPathFactory, ending: str, start: bytes, data: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / f"any{ending}"
    path.write_bytes(start + data)
    with pytest.raises(SplatFileError):
        read_splats(path)
