from __future__ import annotations

import numpy as np
import pytest

from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera, Pinhole, Rigid


def test_the_papers_size_stays() -> None:
    assert working_size_px(294, 639) == (294, 639)


def test_other_aspects_keep_the_number_of_pixels() -> None:
    assert working_size_px(640, 480) == (500, 375)
    assert working_size_px(1080, 1920) == (325, 578)


def test_a_frame_is_resized_with_its_camera() -> None:
    camera = Camera(Pinhole(40, 20, 30.0, 30.0, 20.0, 10.0), Rigid.identity())
    rgb = np.zeros((20, 40, 3), np.uint8)
    rgb[:, 20:] = 200
    small = Frame("a", rgb, camera).resized(20, 10)
    assert small.camera.pinhole == Pinhole(20, 10, 15.0, 15.0, 10.0, 5.0)
    assert small.rgb[:, :10].max() == 0
    assert small.rgb[:, 10:].min() == 200


def test_a_picture_of_another_size_than_its_camera_is_refused() -> None:
    camera = Camera(Pinhole(40, 20, 30.0, 30.0, 20.0, 10.0), Rigid.identity())
    with pytest.raises(ValueError, match="camera's size"):
        Frame("a", np.zeros((20, 41, 3), np.uint8), camera)
