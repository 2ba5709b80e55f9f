"""Reads an AdaMPI checkpoint, `{"num_planes": int, "weight": state dict}`; nothing in it is run.

A pickle can hold code. It is read by PyTorch's restricted unpickler (`weights_only`), which builds
tensors and plain containers and refuses all else.
"""

# PyTorch is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import pickle
import warnings
import zipfile
from pathlib import Path
from typing import NamedTuple

import torch

from peaking.errors import CheckpointError
from peaking.generators.adampi.network import AdaMpiNetwork
from peaking.limits import MAX_CHECKPOINT_BYTES, MAX_CHECKPOINT_PICKLE_BYTES

MAX_NAMED = 3
"""Names of wrong entries, of each kind, that a message gives."""


class Checkpoint(NamedTuple):
    """A network ready for use, and the number of planes that it was trained for."""

    network: AdaMpiNetwork
    num_planes: int


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint of the official layout, strictly.

    Raises:
        CheckpointError: It is missing, damaged, holds more than tensors, or is of another network.
    """
    document = _unpickled(path)
    if not isinstance(document, dict):
        raise CheckpointError(
            f"{path}: holds no dictionary, but {type(document).__name__}; {_REMEDY}"
        )
    if "mpi_predict_network" in document:
        raise CheckpointError(f"{path}: is a training checkpoint; {_REMEDY}")
    for field in ("num_planes", "weight"):
        if field not in document:
            raise CheckpointError(f"{path}: {field}: is not there; {_REMEDY}")
    num_planes, weight = document["num_planes"], document["weight"]
    if not isinstance(num_planes, int) or not 2 <= num_planes <= 256:
        raise CheckpointError(f"{path}: num_planes: need 2…256, got {num_planes!r}; {_REMEDY}")
    if not isinstance(weight, dict):
        raise CheckpointError(f"{path}: weight: need a state dict, got {type(weight).__name__}")
    network = AdaMpiNetwork().eval().requires_grad_(False)
    _check_entries(path, weight, network.state_dict())
    network.load_state_dict(weight, strict=True)
    return Checkpoint(network, num_planes)


_REMEDY = "`peaking checkpoints` says which file is needed"


def _unpickled(path: Path) -> object:
    if not path.is_file():
        raise CheckpointError(f"{path}: there is no such file; {_REMEDY}")
    sizes = _unpacked_bytes(path)
    pickled = sum(size for name, size in sizes.items() if name.endswith(".pkl"))
    if sum(sizes.values()) > MAX_CHECKPOINT_BYTES or pickled > MAX_CHECKPOINT_PICKLE_BYTES:
        raise CheckpointError(
            f"{path}: has more than {MAX_CHECKPOINT_BYTES:,} bytes when it is unpacked, or "
            f"{MAX_CHECKPOINT_PICKLE_BYTES:,} without its tensors; {_REMEDY}"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of pickles that it may not know all of
            return torch.load(path, map_location="cpu", weights_only=True)
    except PermissionError as error:
        raise CheckpointError(f"{path}: may not be read by this user") from error
    except Exception as error:  # damaged bytes raise anything
        if isinstance(error, pickle.UnpicklingError) and "unsupported global" in str(error).lower():
            raise CheckpointError(
                f"{path}: holds more than tensors (objects or code), and was not run; {_REMEDY}"
            ) from error
        raise CheckpointError(
            f"{path}: is cut off, damaged or no PyTorch checkpoint; fetch it again"
        ) from error


def _unpacked_bytes(path: Path) -> dict[str, int]:
    """Return how much is read of what: checkpoints are zip files, those of old versions are not."""
    try:
        with zipfile.ZipFile(path) as archive:
            return {entry.filename: entry.file_size for entry in archive.infolist()}
    except Exception:  # damaged bytes raise anything
        return {"all of it": path.stat().st_size}


def _check_entries(
    path: Path, given: dict[object, object], wanted: dict[str, torch.Tensor]
) -> None:
    missing = [name for name in wanted if name not in given]
    unexpected = [str(name) for name in given if name not in wanted]
    if missing or unexpected:
        parts = [
            f"{len(names)} {what}: {', '.join(names[:MAX_NAMED])}"
            for what, names in (("missing", missing), ("unexpected", unexpected))
            if names
        ]
        raise CheckpointError(f"{path}: weight: entries: {'; '.join(parts)}; {_REMEDY}")
    for name, tensor in wanted.items():
        value = given[name]
        if not isinstance(value, torch.Tensor) or value.shape != tensor.shape:
            got = tuple(value.shape) if isinstance(value, torch.Tensor) else type(value).__name__
            raise CheckpointError(
                f"{path}: weight: {name}: need shape {tuple(tensor.shape)}, got {got}; {_REMEDY}"
            )
        if not _is_plain(value) or value.is_floating_point() != tensor.is_floating_point():
            raise CheckpointError(
                f"{path}: weight: {name}: need a tensor like {tensor.dtype}, got {value.dtype}, "
                f"{value.layout}, on {value.device}; {_REMEDY}"
            )
        if not torch.isfinite(value).all():
            raise CheckpointError(f"{path}: weight: {name}: holds NaN or infinity; fetch it again")


def _is_plain(tensor: torch.Tensor) -> bool:
    """Return whether a tensor is real numbers in memory, one after the other."""
    stored = tensor.layout == torch.strided and tensor.device.type == "cpu"
    return stored and not (tensor.is_complex() or tensor.is_quantized)
