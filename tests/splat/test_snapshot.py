"""A training that stopped goes on as if it had not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from peaking.errors import SplatFileError
from peaking.splat.snapshot import read_snapshot, write_snapshot
from peaking.splat.training import Trainer
from splat.test_training import SHORT, frames


@pytest.mark.parametrize("stop_at", [1, 47, 61])
def test_the_same_gaussians_come_out(tmp_path: Path, stop_at: int) -> None:
    """Before, between and just after refinements."""
    pictures = frames(5)
    whole = Trainer(pictures, SHORT)
    for _ in range(80):
        whole.step()
    first = Trainer(pictures, SHORT)
    for _ in range(stop_at):
        first.step()
    write_snapshot(tmp_path / "snapshot.npz", first.snapshot())
    second = Trainer(pictures, SHORT)
    second.go_on(read_snapshot(tmp_path / "snapshot.npz"))
    assert second.iteration == stop_at
    assert second.num_gaussians == first.num_gaussians
    while second.iteration < 80:
        second.step()
    np.testing.assert_array_equal(second.gaussians().parameters(), whole.gaussians().parameters())


def test_other_pictures_and_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "snapshot.npz"
    with pytest.raises(SplatFileError, match="no training can go on"):
        read_snapshot(path)
    trainer = Trainer(frames(5), SHORT)
    trainer.step()
    write_snapshot(path, trainer.snapshot())
    with pytest.raises(ValueError, match="pictures of the training"):
        Trainer(frames(3), SHORT).go_on(read_snapshot(path))
    others = [replace(frame, name=f"other {frame.name}") for frame in frames(5)]
    with pytest.raises(ValueError, match="pictures of the training"):
        Trainer(others, SHORT).go_on(read_snapshot(path))
    data = path.read_bytes()
    for damaged in (data[: len(data) // 2], b"", b"something else"):
        path.write_bytes(damaged)
        with pytest.raises(SplatFileError, match="no training can go on"):
            read_snapshot(path)
