from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.geometry import OPENCV_FROM_OPENGL, Cam, Camera, Pinhole, Rigid, World

PINHOLE = Pinhole(640, 480, 500.0, 510.0, 320.0, 240.0)


def turned(angles: tuple[float, float, float], translation_m: list[float]) -> Rigid[World, Cam]:
    a, b, c = angles
    about_z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(c), -np.sin(c)], [0, np.sin(c), np.cos(c)]])
    return Rigid(about_z @ about_y @ about_x, np.array(translation_m, dtype=np.float64))


angles = st.tuples(*[st.floats(-3, 3) for _ in range(3)])
vectors = st.lists(st.floats(-10, 10), min_size=3, max_size=3)


def test_a_quarter_turn_and_a_step() -> None:
    world_from_cam: Rigid[World, Cam] = Rigid(
        np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([5.0, 0.0, 0.0])
    )
    np.testing.assert_array_equal(world_from_cam.apply(np.array([[1.0, 2.0, 3.0]])), [[3, 1, 3]])


@given(angles, vectors, angles, vectors, vectors)
def test_product_and_inverse(a, t, b, u, p) -> None:  # type: ignore[no-untyped-def]
    x, y = turned(a, t), turned(b, u)
    point = np.array([p])
    np.testing.assert_allclose((x @ y).apply(point), x.apply(y.apply(point)), atol=1e-9)  # type: ignore[operator]
    np.testing.assert_allclose(x.inverse().apply(x.apply(point)), point, atol=1e-9)


def test_opengl_axes_are_turned_by_the_right_factor() -> None:
    gl = np.eye(4)
    gl[:3, 3] = [1, 2, 3]
    cam = Rigid[World, Cam].from_matrix(gl @ OPENCV_FROM_OPENGL)
    # An OpenGL camera looks along -z and has y up.
    np.testing.assert_array_equal(cam.apply(np.array([[0.0, 0.0, 1.0]])), [[1, 2, 2]])
    np.testing.assert_array_equal(cam.apply(np.array([[0.0, 1.0, 0.0]])), [[1, 1, 3]])


@pytest.mark.parametrize(
    ("matrix", "says"),
    [
        (np.diag([2.0, 2.0, 2.0, 1.0]), "need a rotation"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "mirroring"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "last row"),
        (np.full((4, 4), np.nan), "finite"),
    ],
)
def test_what_is_no_pose_is_refused(matrix: np.ndarray, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Rigid.from_matrix(matrix)


@given(angles, vectors)
def test_a_rotation_of_three_decimals_is_one(turn, shift) -> None:  # type: ignore[no-untyped-def]
    exact = turned(turn, shift)
    rounded = exact.matrix()
    rounded[:3, :3] = rounded[:3, :3].round(3)
    read = Rigid.from_matrix(rounded)
    np.testing.assert_allclose(read.rotation @ read.rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(read.rotation, exact.rotation, atol=2e-3)


def test_principal_ray_and_pixel_centres() -> None:
    camera = Camera(PINHOLE, Rigid.identity())
    pixels, depth_m = camera.project(np.array([[0.0, 0.0, 2.0], [0.2, -0.1, 2.0]]))
    np.testing.assert_allclose(pixels, [[320, 240], [370, 214.5]])
    np.testing.assert_allclose(depth_m, [2, 2])
    np.testing.assert_allclose(PINHOLE.pixel_centers()[0, 0], [0.5, 0.5])
    np.testing.assert_allclose(PINHOLE.rays()[240, 320], [0.001, 0.5 / 510, 1])


def test_points_behind_have_no_pixel() -> None:
    pixels, depth_m = Camera(PINHOLE, Rigid.identity()).project(np.array([[0.0, 0.0, -1.0]]))
    assert np.isnan(pixels).all()
    assert depth_m[0] == -1


def test_matrix_of_intrinsics_and_its_inverse() -> None:
    np.testing.assert_allclose(PINHOLE.px_from_cam @ PINHOLE.cam_from_px, np.eye(3), atol=1e-12)


@given(st.integers(1, 2000), st.integers(1, 2000))
def test_resizing_keeps_the_field_of_view(width: int, height: int) -> None:
    small = PINHOLE.resized(width, height)
    corner = np.array([width, height, 1.0])
    ray = small.cam_from_px @ corner
    np.testing.assert_allclose(ray, PINHOLE.cam_from_px @ [640, 480, 1.0])


def test_cropping_moves_the_principal_point() -> None:
    cut = PINHOLE.cropped(100, 40, 200, 300)
    assert (cut.width_px, cut.height_px, cut.cx_px, cut.cy_px) == (200, 300, 220, 200)


@pytest.mark.parametrize("bad", [{"fx_px": 0.0}, {"fy_px": -1.0}, {"cx_px": np.nan}])
def test_impossible_intrinsics_are_refused(bad: dict[str, float]) -> None:
    numbers = {"fx_px": 1.0, "fy_px": 1.0, "cx_px": 1.0, "cy_px": 1.0} | bad
    with pytest.raises(ValueError, match="need"):
        Pinhole(10, 10, **numbers)
