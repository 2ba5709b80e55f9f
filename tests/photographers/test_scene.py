from __future__ import annotations

import numpy as np

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.photographers._raster_numba import NEAR_M
from peaking.photographers.drawn.mesh import MeshParts, Pose
from peaking.photographers.drawn.parts import matte, panel, shape
from peaking.photographers.drawn_mesh import LONGEST_EDGE_M, DrawnMesh, build_mesh, split
from peaking.photographers.scene import TO_LINEAR, Scene, bake, look
from peaking.photographers.tasks import TASKS

PINHOLE = Pinhole(40, 60, 45.0, 47.0, 19.0, 31.0)
FLOAT32_M = 2e-5
"""Depth is computed from float32 points; measured: 4e-7 of the depth."""


def ray_cast_m(mesh: DrawnMesh, camera: Camera, row: int, col: int) -> float:
    """Depth at a pixel's centre, triangle by triangle (Möller and Trumbore 1997); 0: nothing."""
    direction = camera.world_from_cam.rotation @ camera.pinhole.rays()[row, col]
    a, b, c = (mesh.points_m[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    p = np.cross(direction, c - a)
    det = ((b - a) * p).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = camera.position_m - a
        u = (s * p).sum(axis=1) / det
        q = np.cross(s, b - a)
        v = (q @ direction) / det
        depth_m = ((c - a) * q).sum(axis=1) / det
    hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (depth_m >= NEAR_M)
    return float(depth_m[hit].min()) if hit.any() else 0.0


def test_depth_is_that_of_rays(small_scene: Scene) -> None:
    rng = np.random.default_rng(0)
    for k in range(6):
        position_m = rng.uniform((-1, -1, 0.5), (1, 0.5, 2))
        camera = look(PINHOLE, position_m, 2 * np.pi * k / 6, -0.3 + 0.1 * k, 0.05)
        depth_m = small_scene.depth_m(camera)
        _, with_picture_m = small_scene.draw(camera)
        np.testing.assert_array_equal(depth_m, with_picture_m)
        for row, col in rng.integers(0, (60, 40), size=(12, 2)):
            true_m = ray_cast_m(small_scene.mesh, camera, row, col)
            assert abs(depth_m[row, col] - true_m) <= FLOAT32_M * max(1.0, true_m)


def test_triangles_that_reach_behind_the_camera_are_drawn(small_scene: Scene) -> None:
    camera = look(PINHOLE, (-0.3, 0.6, 1.0), np.pi / 2, -1.2)
    low = look(PINHOLE, (0.0, 0.0, 0.06), 0.0, -0.9)
    for at in (camera, low):
        depth_m = small_scene.depth_m(at)
        assert (depth_m > 0).all()
        for row, col in ((59, 20), (30, 0), (0, 39)):
            true_m = ray_cast_m(small_scene.mesh, at, row, col)
            assert abs(depth_m[row, col] - true_m) <= FLOAT32_M


def square(image: np.ndarray, *, at_m: float = 2.0) -> Scene:
    mesh = MeshParts()
    mesh.box((1.0, 0.001, 1.0), Pose((0.0, at_m, 0.0)))
    drawn, _ = build_mesh([{"square": shape("square", mesh, matte(image))}])
    return Scene(drawn, np.ones_like(drawn.points_m))


def test_a_pixel_is_the_texture_times_the_light() -> None:
    image = np.full((64, 64, 3), (200, 120, 40), np.uint8)
    scene = square(image)
    camera = look(Pinhole(31, 31, 20.0, 20.0, 15.5, 15.5), (0.0, 0.0, 0.0), np.pi / 2, 0.0)
    bright, depth_m = scene.draw(camera)
    dim, _ = Scene(scene.mesh, 0.5 * scene.light).draw(camera)
    linear = TO_LINEAR[[200, 120, 40]].astype(np.float64)
    for picture, light in ((bright, 1.0), (dim, 0.5)):
        x = linear * light
        x = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
        srgb = np.where(x > 0.0031308, 1.055 * x ** (1 / 2.4) - 0.055, 12.92 * x)
        assert np.abs(picture[15, 15] - 255 * srgb).max() <= 1
    assert (bright[:, 0] == 0).all()
    assert (depth_m[:, 0] == 0).all()
    assert abs(depth_m[15, 15] - 1.9995) < FLOAT32_M


def test_a_pattern_finer_than_pixels_is_grey() -> None:
    v, u = np.mgrid[0:512, 0:512]
    image = np.repeat((255 * ((u + v) % 2))[..., None], 3, -1).astype(np.uint8)
    camera = look(Pinhole(31, 31, 60.0, 60.0, 15.5, 15.5), (0.0, 0.0, 0.0), np.pi / 2, 0.0)
    picture, _ = square(image).draw(camera)
    middle = picture[5:26, 5:26].astype(float)
    assert middle.std() < 2
    assert 100 < middle.mean() < 220


def test_long_edges_are_halved_without_gaps() -> None:
    points_m = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0.0)])
    flat = np.tile((0.0, 0.0, 1.0), (4, 1))
    points_m, _, _, faces = split(points_m, points_m[:, :2], flat, np.array([(0, 1, 2), (0, 2, 3)]))
    corners = points_m[faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert edges.max() <= LONGEST_EDGE_M
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    assert (areas > 0).all()
    np.testing.assert_allclose(areas.sum(), 1.0)
    ends = {
        tuple(sorted((tuple(a), tuple(b))))
        for t in corners
        for a, b in zip(t, t[[1, 2, 0]], strict=True)
    }
    middles = {tuple((np.array(a) + b) / 2) for a, b in ends}
    assert not middles & {tuple(p) for p in points_m}, "an edge has a corner in its middle"


def test_lamps_light_what_they_see_and_shadows_are_dark() -> None:
    floor, table = MeshParts(), MeshParts()
    floor.box((3.0, 3.0, 0.02), Pose((0.0, 0.0, -0.01)))
    table.box((0.8, 0.8, 0.02), Pose((0.0, 0.0, 0.6)))
    white = matte(np.full((8, 8, 3), 230, np.uint8))
    lamp = {
        "type": "rectangle",
        "to_world": panel((0.4, 0.4), Pose((0.0, 0.0, 2.0), pitch_deg=90)),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": (5.0, 5.0, 5.0)}},
    }
    parts = {"floor": shape("floor", floor, white), "table": shape("table", table, white)}
    mesh, panels = build_mesh([{"lamp": lamp}, parts])
    light = bake(mesh, panels, np.random.default_rng(0)).light[:, 0]
    x, y, z = mesh.points_m.T
    away = np.hypot(x, y)
    top = mesh.normals[:, 2] > 0.5
    under = light[top & (z < 0.1) & (away < 0.2)].mean()
    beside = light[top & (z < 0.1) & (np.abs(away - 1.1) < 0.1)].mean()
    on_table = light[top & (z > 0.5) & (away < 0.2)].mean()
    assert under < 0.5 * beside < 0.5 * on_table


def test_cameras_look_where_they_are_told() -> None:
    camera = look(PINHOLE, (1.0, 2.0, 3.0), np.pi / 2, 0.2)
    np.testing.assert_allclose(camera.forward, (0, np.cos(0.2), np.sin(0.2)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(camera.world_from_cam.rotation), 1.0)
    assert camera.world_from_cam.rotation[2, 1] < 0, "y is down"
    assert isinstance(camera.world_from_cam, Rigid)


def test_test_views_are_always_the_same_and_in_the_volume() -> None:
    for task in TASKS.values():
        cameras = task.test_cameras(8)
        again = task.test_cameras(8)
        for a, b in zip(cameras, again, strict=True):
            np.testing.assert_array_equal(a.world_from_cam.matrix(), b.world_from_cam.matrix())
        positions_m = np.array([camera.position_m for camera in cameras])
        assert np.ptp(positions_m, axis=0).min() > 0.2
