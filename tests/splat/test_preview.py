"""The picture of what was trained, worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.splat.gaussians import Gaussians
from peaking.splat.preview_picture import GAP_PX, preview
from splat.scenes_of_gaussians import one


def test_photograph_view_and_depth_side_by_side() -> None:
    camera = Camera(Pinhole(41, 30, 100.0, 100.0, 20.5, 15.5), Rigid.identity())
    photo = np.full((30, 41, 3), 77, np.uint8)
    near, far = one(depth_m=1.0, opacity=0.9), one(depth_m=2.0, opacity=0.9)
    near[0, 0], far[0, 0] = -0.1, 0.2
    gaussians = Gaussians.from_parameters(np.concatenate([near, far]).astype(np.float32))
    picture = preview(gaussians, [Frame("a", photo, camera)] * 2)
    assert picture.shape == (2 * 30 + GAP_PX, 3 * 41 + 2 * GAP_PX, 3)
    assert (picture[:30, :41] == 77).all()
    seen = picture[:30, 41 + GAP_PX : 82 + GAP_PX]
    assert seen[15, 10, 0] > 200  # both are red
    assert seen[15, 10, 2] == 0
    depth = picture[:30, 82 + 2 * GAP_PX :].astype(int)
    assert depth[15, 10, 0] > depth[15, 10, 2]  # near is red
    assert depth[15, 30, 2] > depth[15, 30, 0]  # far is blue
    assert not depth[0, 20].any()  # nothing is black


def test_nothing_to_show_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one frame"):
        preview(Gaussians.from_parameters(one().astype(np.float32)), [])
