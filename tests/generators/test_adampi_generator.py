"""The generator as the rest of the program sees it, and bad weights and pictures."""

from __future__ import annotations

import pickle
import random
import subprocess
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from jaxtyping import Float32, UInt8

from adampi_checkpoints import write_checkpoint
from peaking.cli import main
from peaking.errors import BackendUnavailable, CheckpointError, PeakingError
from peaking.generators import Generator
from peaking.generators.adampi import checkpoint as checkpoint_module
from peaking.generators.adampi.checkpoint import read_checkpoint
from peaking.generators.adampi.generator import AdaMpi
from peaking.generators.adampi.inputs import inputs_of, sharp_edges
from peaking.generators.adampi.network import random_network
from peaking.generators.registry import create_generator
from peaking.geometry import Camera
from peaking.mpi_file import read_mpi
from peaking.options import DEFAULT
from peaking.rendering import render
from recordings import Room, lateral_cameras, write_recording

Weights = dict[str, torch.Tensor]


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_checkpoint(tmp_path_factory.mktemp("weights") / "adampi_4p.pth")


@pytest.fixture(scope="module")
def weights() -> Weights:
    return random_network(1).state_dict()


@pytest.fixture(scope="module")
def adampi(checkpoint: Path) -> Generator:
    return create_generator(
        replace(DEFAULT, generator="adampi", num_planes=4, checkpoint=checkpoint, device="cpu")
    )


def photographed(
    width_px: int, height_px: int
) -> tuple[UInt8[np.ndarray, "h w 3"], Float32[np.ndarray, "h w"], Camera]:
    camera = lateral_cameras(1, width_px, height_px)[0]
    return *Room().photographed(camera), camera


# What it makes


def test_it_is_a_generator_of_sparse_metric_mpis(adampi: Generator) -> None:
    rgb, depth_m, camera = photographed(140, 128)  # padded to 256×128, cropped again
    mpi = adampi(rgb, depth_m, camera)
    assert mpi.generator == adampi.name == "adampi"
    assert mpi.camera is camera
    assert mpi.num_planes == 4
    assert depth_m.min() - 1e-3 < mpi.plane_depths_m[-1]
    assert mpi.plane_depths_m[0] < depth_m.max() + 1e-3
    seen = render(mpi, camera)
    assert seen.rgba.shape == (128, 140, 4)
    assert seen.alpha.mean() > 0.9


def test_padding_leaves_the_picture_where_it_is() -> None:
    rgb, depth_m, _ = photographed(140, 200)
    shown = inputs_of(rgb, depth_m)
    assert shown.rgb.shape == (256, 256, 3)
    np.testing.assert_allclose(shown.rgb[:200, :140], rgb / np.float32(255))
    np.testing.assert_array_equal(shown.rgb[200:, :140], np.repeat(shown.rgb[199:200, :140], 56, 0))
    assert shown.disparity.min() == 0
    assert shown.disparity.max() == 1
    assert shown.range_per_m == pytest.approx((1 / depth_m.max(), 1 / depth_m.min()))


def test_a_wall_seen_head_on_has_a_range_too() -> None:
    shown = inputs_of(np.zeros((128, 128, 3), np.uint8), np.full((128, 128), 2.0, np.float32))
    assert np.isfinite(shown.disparity).all()
    assert shown.range_per_m[0] < shown.range_per_m[1] == 0.5


def test_slopes_between_surfaces_become_steps() -> None:
    row = np.array([0, 0, 0, 0, 0.25, 0.5, 0.75, 1, 1, 1, 1], np.float32)
    sharp = sharp_edges(np.tile(row, (5, 1)))
    assert set(np.unique(sharp)) == {0.0, 1.0}
    assert (np.diff(sharp[2]) >= 0).all()


def test_slants_stay_as_they_are() -> None:
    slant = np.tile(np.linspace(0, 1, 64, dtype=np.float32), (8, 1))
    np.testing.assert_array_equal(sharp_edges(slant), slant)


def test_the_command_line_makes_a_file(
    tmp_path: Path, checkpoint: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = write_recording(tmp_path / "scene", num_frames=1, width_px=128, height_px=128)
    out = tmp_path / "view.mpi"
    flags = ["--generator", "adampi", "--checkpoint", str(checkpoint), "--device", "cpu"]
    sizes = ["--pixels", str(128 * 128), "--num-planes", "4"]
    main(["generate", str(scene), "--out", str(out), *flags, *sizes])
    assert "128x128x4" in capsys.readouterr().out
    assert read_mpi(out).generator == "adampi"


# Bad input


def saved(path: Path, document: object) -> Path:
    torch.save(document, path)
    return path


def without_three(weights: Weights) -> object:
    kept = dict(list(weights.items())[3:])
    return {"num_planes": 4, "weight": {**kept, "module.extra": torch.zeros(1)}}


BAD_DOCUMENTS: dict[str, tuple[Callable[[Weights], object], str]] = {
    "a list": (lambda _: [1], "holds no dictionary, but list"),
    "no planes": (lambda w: {"weight": w}, "num_planes: is not there"),
    "no weights": (lambda _: {"num_planes": 4}, "weight: is not there"),
    "half a plane": (lambda w: {"num_planes": 1.5, "weight": w}, "num_planes: need 2…256"),
    "training": (lambda w: {"mpi_predict_network": w}, "training checkpoint"),
    "other names": (
        without_three,
        r"3 missing: encoder.encoder.conv1.weight, .*; 1 unexpected: module.extra",
    ),
    "another shape": (
        lambda w: {"num_planes": 4, "weight": {**w, "fmn.conv9.layer.0.bias": torch.zeros(2)}},
        r"fmn.conv9.layer.0.bias: need shape \(1,\), got \(2,\)",
    ),
    "no tensor": (
        lambda w: {"num_planes": 4, "weight": {**w, "fmn.conv9.layer.0.bias": 3}},
        r"fmn.conv9.layer.0.bias: need shape \(1,\), got int",
    ),
    "NaN": (
        lambda w: {
            "num_planes": 4,
            "weight": {**w, "fmn.conv9.layer.0.bias": torch.tensor([float("nan")])},
        },
        "fmn.conv9.layer.0.bias: holds NaN",
    ),
}


@pytest.mark.parametrize("name", BAD_DOCUMENTS)
def test_wrong_checkpoints_are_refused_by_name(tmp_path: Path, weights: Weights, name: str) -> None:
    make, message = BAD_DOCUMENTS[name]
    path = saved(tmp_path / "bad.pth", make(weights))
    with pytest.raises(CheckpointError, match=message) as caught:
        read_checkpoint(path)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("kept", [0, 1, 100, 40_000, 0.5, 0.999])
@pytest.mark.parametrize("zipped", [True, False])
def test_truncated_files_are_refused(tmp_path: Path, kept: float, zipped: bool) -> None:
    path = tmp_path / "cut.pth"
    small = {"num_planes": 4, "weight": {"x": torch.zeros(100_000)}}
    torch.save(small, path, _use_new_zipfile_serialization=zipped)
    whole = path.read_bytes()
    path.write_bytes(whole[: kept if isinstance(kept, int) else int(kept * len(whole))])
    with pytest.raises(CheckpointError, match=r"damaged|no dictionary"):
        read_checkpoint(path)


def test_a_file_that_unpacks_to_too_much_is_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "bomb.pth"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bomb/data.pkl", bytes(2_000_000))
    assert path.stat().st_size < 10_000
    monkeypatch.setattr(checkpoint_module, "MAX_CHECKPOINT_BYTES", 1_000_000)
    monkeypatch.setattr(torch, "load", None)
    with pytest.raises(CheckpointError, match="when it is unpacked"):
        read_checkpoint(path)


@pytest.mark.parametrize("damage", range(40))
def test_any_damage_is_a_sentence(tmp_path: Path, damage: int) -> None:
    path = saved(tmp_path / "bad.pth", {"num_planes": 4, "weight": {"x": torch.zeros(3)}})
    data = bytearray(path.read_bytes())
    drawn = random.Random(damage)
    for _ in range(3):
        at = drawn.randrange(len(data))
        data[at : at + drawn.randrange(5)] = drawn.randbytes(drawn.randrange(5))
    path.write_bytes(data)
    with pytest.raises(CheckpointError):
        read_checkpoint(path)


@pytest.mark.parametrize(
    "value",
    [
        torch.zeros(1).to_sparse(),
        torch.zeros(1, device="meta"),
        torch.zeros(1, dtype=torch.complex64),
    ],
    ids=["sparse", "meta", "complex"],
)
def test_tensors_of_other_kinds_are_refused(
    tmp_path: Path, weights: Weights, value: torch.Tensor
) -> None:
    weight = weights | {"fmn.conv9.layer.0.bias": value}
    path = saved(tmp_path / "bad.pth", {"num_planes": 4, "weight": weight})
    with pytest.raises(CheckpointError, match=r"fmn\.conv9\.layer\.0\.bias|more than"):
        read_checkpoint(path)


def test_a_pickle_of_too_many_objects_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "bomb.pth"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bomb/data.pkl", b"\x80\x02(" + b"]" * 5_000_000 + b"l.")
    monkeypatch.setattr(torch, "load", None)
    with pytest.raises(CheckpointError, match="without its tensors"):
        read_checkpoint(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        CheckpointError, match=r"nowhere\.pth: there is no such file; `peaking checkpoints`"
    ):
        read_checkpoint(tmp_path / "nowhere.pth")


class Touches:
    """When unpickled without care, makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., int], tuple[list[str]]]:
        return subprocess.call, (["touch", str(self.path)],)


def test_code_in_a_pickle_is_not_run(tmp_path: Path) -> None:
    proof = tmp_path / "proof"
    path = saved(tmp_path / "code.pth", {"num_planes": 4, "weight": Touches(proof)})
    with pytest.raises(CheckpointError, match="objects or code"):
        read_checkpoint(path)
    path.write_bytes(pickle.dumps(Touches(proof)))
    with pytest.raises(CheckpointError):
        read_checkpoint(path)
    assert not proof.exists()


def test_another_number_of_planes_is_refused(checkpoint: Path) -> None:
    with pytest.raises(CheckpointError, match="is made for 4 planes, 32 were asked for"):
        AdaMpi.load(checkpoint, num_planes=32, device="cpu")


def test_small_pictures_are_refused(adampi: Generator) -> None:
    with pytest.raises(PeakingError, match="96x128, AdaMPI needs 128 pixels per side"):
        adampi(*photographed(96, 128))


def test_depth_must_be_complete(adampi: Generator) -> None:
    rgb, depth_m, camera = photographed(128, 128)
    depth_m[3, 4] = 0
    with pytest.raises(ValueError, match="complete the depth first"):
        adampi(rgb, depth_m, camera)


@pytest.mark.skipif(torch.cuda.is_available(), reason="needs a machine without CUDA")
def test_cuda_that_is_not_there_is_refused(checkpoint: Path) -> None:
    with pytest.raises(BackendUnavailable, match="finds no CUDA"):
        AdaMpi.load(checkpoint, num_planes=4, device="cuda")


def test_reduced_precision_is_for_cuda(checkpoint: Path) -> None:
    with pytest.raises(BackendUnavailable, match="bfloat16 needs CUDA"):
        AdaMpi.load(checkpoint, num_planes=4, device="cpu", precision="bfloat16")


def test_bad_weights_end_the_command_with_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = write_recording(tmp_path / "scene", num_frames=1)
    flags = ["--generator", "adampi", "--checkpoint", str(tmp_path / "none.pth")]
    with pytest.raises(SystemExit) as left:
        main(["generate", str(scene), "--out", str(tmp_path / "out.mpi"), *flags])
    assert left.value.code == 2
    assert "none.pth: there is no such file" in capsys.readouterr().err
    assert not (tmp_path / "out.mpi").exists()
