from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.errors import NothingToAlign
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.mpi import Mpi
from peaking.options import ScaleMethod
from peaking.scale_alignment import align_scale, fit_scale

methods = pytest.mark.parametrize("method", ("paper", "robust"))


@methods
def test_a_prediction_2_7_times_too_near_gives_2_7(method: ScaleMethod) -> None:
    depth_m = np.array([[1.0, 2.0, 4.0]])
    found = fit_scale(2.7 / depth_m, depth_m, method=method)
    assert found.scale == pytest.approx(2.7)
    assert found.spread == pytest.approx(0.0, abs=1e-12)
    assert found.num_pixels == 3


def test_the_paper_takes_the_geometric_mean_of_disparity_times_depth() -> None:
    disparity, depth_m = np.array([[1.0, 1.0, 4.0]]), np.array([[1.0, 2.0, 1.0]])
    # Products 1, 2, 4: geometric mean 2; logs 0, ln 2, 2 ln 2 with deviation ln 2 · sqrt(2/3).
    found = fit_scale(disparity, depth_m, method="paper")
    assert found.scale == pytest.approx(2.0)
    assert found.spread == pytest.approx(np.log(2) * np.sqrt(2 / 3))


def test_the_median_bears_two_wild_pixels_of_five() -> None:
    depth_m = np.array([[1.0, 1.0, 1.0, 50.0, 80.0]])
    found = fit_scale(np.full((1, 5), 3.0), depth_m)
    assert found.scale == pytest.approx(3.0)
    assert fit_scale(np.full((1, 5), 3.0), depth_m, method="paper").scale > 10


@methods
def test_unknown_pixels_do_not_count(method: ScaleMethod) -> None:
    depth_m = np.array([[2.0, 0.0, np.nan, 2.0, 2.0]])
    disparity = np.array([[0.5, 9.0, 9.0, 0.0, np.inf]])
    found = fit_scale(disparity, depth_m, method=method)
    assert (found.scale, found.num_pixels) == (pytest.approx(1.0), 1)


@methods
def test_nothing_in_common_is_an_error(method: ScaleMethod) -> None:
    with pytest.raises(NothingToAlign, match="no pixel"):
        fit_scale(np.zeros((2, 2)), np.ones((2, 2)), method=method)


@given(st.floats(0.05, 20.0))
def test_aligning_a_scaled_mpi_gives_the_scale_back(scale: float) -> None:
    camera = Camera(Pinhole(20, 16, 20.0, 20.0, 10.0, 8.0), Rigid.identity())
    planes = np.zeros((2, 16, 20, 4), np.uint8)
    planes[0], planes[1, :, :10] = 255, 255
    mpi = Mpi.from_dense(planes, np.array([3.0, 1.5]), camera)
    depth_m = np.full((8, 10), 3.0, np.float32)
    depth_m[:, :5] = 1.5
    found = align_scale(mpi.scaled(scale), depth_m)
    assert found.scale == pytest.approx(1 / scale, rel=1e-4)
    assert align_scale(mpi.scaled(scale * found.scale), depth_m).scale == pytest.approx(
        1.0, rel=1e-4
    )
