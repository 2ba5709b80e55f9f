"""Fixtures of the evaluation's tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numba
import pytest
from evaluate_factories import FRAMES, SIZE_PX

from recordings import lateral_cameras, write_recording


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    """As in a worker: pictures of this size gain nothing from threads that wait for each other."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(before)


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording that moves sideways; for reading alone."""
    folder = tmp_path_factory.mktemp("scenes") / "walk"
    return write_recording(folder, cameras=lateral_cameras(FRAMES, *SIZE_PX))
