"""The same drawn shots written as the apps and data sets write them, apart from the readers."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import permutations, product
from pathlib import Path

import cv2
import lzfse  # pyright: ignore
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from peaking.datasets import Recording, open_recording
from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Pinhole, Rigid
from recordings import Room

OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Shot:
    camera: Camera
    rgb: UInt8[np.ndarray, "h w 3"]
    depth_m: Float32[np.ndarray, "dh dw"]
    time_s: float

    @property
    def world_from_cam(self) -> Float64[np.ndarray, "4 4"]:
        return self.camera.world_from_cam.matrix()

    @property
    def x_y_z_w(self) -> Float64[np.ndarray, "4"]:
        return quaternion(self.world_from_cam[:3, :3])


def quaternion(rotation: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "4"]:
    """Return x, y, z, w, by the eigenvector that Bar-Itzhack gives (independent of the readers)."""
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0],
            [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
            [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], 0],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)],
        ]
    )
    return np.linalg.eigh(k / 3)[1][:, -1]


def shots(
    count: int = 4,
    *,
    pinhole: Pinhole | None = None,
    depth: Pinhole | None = None,
    color_from_depth: Rigid[Cam, Cam] | None = None,
) -> list[Shot]:
    """Return shots that move and turn about all axes; depth perhaps of a camera of its own."""
    k = pinhole or Pinhole(160, 120, 140.0, 142.0, 81.5, 58.0)
    room, taken = Room(), []
    for i in range(count):
        turn, _ = cv2.Rodrigues(np.array([0.05 + 0.02 * i, -0.07 - 0.03 * i, 0.3 + 0.04 * i]))
        place = np.array([0.05 * i - 0.1, 0.03 * i - 0.05, 0.02 * i])
        camera = Camera(k, Rigid(np.asarray(turn, dtype=np.float64), place))
        rgb, depth_m = room.photographed(camera)
        if depth is not None:
            world_from_depth = camera.world_from_cam
            if color_from_depth is not None:
                world_from_depth = world_from_depth @ color_from_depth
            _, depth_m = room.photographed(Camera(depth, world_from_depth))
        taken.append(Shot(camera, rgb, depth_m, 100.0 + i / 30))
    return taken


def png(path: Path, picture: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), picture[..., ::-1] if picture.ndim == 3 else picture)


def jpg(path: Path, rgb: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 98])


def in_units(depth_m: np.ndarray, per_m: float) -> np.ndarray:
    return np.round(depth_m.astype(np.float64) * per_m).astype(np.uint16)


def write_tum(root: Path, taken: list[Shot]) -> Path:
    rgb, depth, poses = ["# color images"], ["# depth maps"], ["# timestamp tx ty tz qx qy qz qw"]
    for shot in taken:
        png(root / f"rgb/{shot.time_s:.6f}.png", shot.rgb)
        png(root / f"depth/{shot.time_s + 0.004:.6f}.png", in_units(shot.depth_m, 5000))
        rgb.append(f"{shot.time_s:.6f} rgb/{shot.time_s:.6f}.png")
        depth.append(f"{shot.time_s + 0.004:.6f} depth/{shot.time_s + 0.004:.6f}.png")
        place = " ".join(f"{v:.9f}" for v in (*shot.world_from_cam[:3, 3], *shot.x_y_z_w))
        poses.append(f"{shot.time_s:.6f} {place}")
    for name, lines in (("rgb", rgb), ("depth", depth), ("groundtruth", poses)):
        (root / f"{name}.txt").write_text("\n".join(lines) + "\n")
    k = taken[0].camera.pinhole
    (root / "calibration.txt").write_text(f"{k.fx_px} {k.fy_px} {k.cx_px - 0.5} {k.cy_px - 0.5}\n")
    return root


def _matrix(path: Path, matrix: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(" ".join(f"{v:.9f}" for v in row) for row in matrix) + "\n")


def write_scannet(root: Path, taken: list[Shot], depth: Pinhole) -> Path:
    for i, shot in enumerate(taken):
        jpg(root / f"color/{i}.jpg", shot.rgb)
        png(root / f"depth/{i}.png", in_units(shot.depth_m, 1000))
        _matrix(root / f"pose/{i}.txt", shot.world_from_cam)
    for name, k in (("color", taken[0].camera.pinhole), ("depth", depth)):
        matrix = np.eye(4)
        matrix[:3, :3] = k.px_from_cam
        matrix[:2, 2] -= 0.5
        _matrix(root / f"intrinsic/intrinsic_{name}.txt", matrix)
    return root


def write_seven_scenes(root: Path, taken: list[Shot], color_from_depth: Rigid[Cam, Cam]) -> Path:
    for i, shot in enumerate(taken):
        png(root / f"frame-{i:06d}.color.png", shot.rgb)
        depth = in_units(shot.depth_m, 1000)
        png(root / f"frame-{i:06d}.depth.png", np.where(depth == 0, np.uint16(65535), depth))
        _matrix(root / f"frame-{i:06d}.pose.txt", shot.world_from_cam @ color_from_depth.matrix())
    return root


def write_polycam(root: Path, taken: list[Shot], *, corrected: bool) -> Path:
    prefix = "corrected_" if corrected else ""
    for i, shot in enumerate(taken):
        stem, k = f"{5692384593 + i}", shot.camera.pinhole
        opengl = shot.world_from_cam @ OPENGL
        fields = {f"t_{r}{c}": float(opengl[r, c]) for r in range(3) for c in range(4)}
        fields |= {"fx": k.fx_px, "fy": k.fy_px, "cx": k.cx_px, "cy": k.cy_px}
        text = json.dumps({**fields, "width": k.width_px, "height": k.height_px, "blur_score": 9.5})
        for kind in {"", prefix}:
            jpg(root / f"keyframes/{kind}images/{stem}.jpg", shot.rgb)
            path = root / f"keyframes/{kind}cameras/{stem}.json"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        png(root / f"keyframes/depth/{stem}.png", in_units(shot.depth_m, 1000))
        sure = np.full(shot.depth_m.shape, 255, np.uint8)
        sure[0] = 0
        png(root / f"keyframes/confidence/{stem}.png", sure)
    return root


def write_arkitscenes(root: Path, taken: list[Shot]) -> Path:
    lines: list[str] = []
    for shot in taken:
        name, k = f"{root.name}_{shot.time_s:.3f}", shot.camera.pinhole
        png(root / f"lowres_wide/{name}.png", shot.rgb)
        png(root / f"lowres_depth/{name}.png", in_units(shot.depth_m, 1000))
        png(root / f"confidence/{name}.png", np.full(shot.depth_m.shape, 2, np.uint8))
        pincam = root / f"lowres_wide_intrinsics/{name}.pincam"
        pincam.parent.mkdir(exist_ok=True)
        pincam.write_text(
            f"{k.width_px} {k.height_px} {k.fx_px} {k.fy_px} {k.cx_px - 0.5} {k.cy_px - 0.5}\n"
        )
        cam_from_world = np.linalg.inv(shot.world_from_cam)
        axis, _ = cv2.Rodrigues(cam_from_world[:3, :3])
        numbers = " ".join(f"{v:.9f}" for v in (*np.ravel(axis), *cam_from_world[:3, 3]))
        lines.append(f"{shot.time_s + 0.0004:.9f} {numbers}")
    (root / "lowres_wide.traj").write_text("\n".join(lines) + "\n")
    return root


def write_stray(root: Path, taken: list[Shot], *, intrinsics: bool) -> Path:
    k = taken[0].camera.pinhole
    root.mkdir(parents=True, exist_ok=True)
    four = cv2.VideoWriter.fourcc(*"mp4v")
    video = cv2.VideoWriter(str(root / "rgb.mp4"), four, 30.0, k.size_px)
    extra = ", fx, fy, cx, cy, distortion_center_x, distortion_center_y" if intrinsics else ""
    lines = [f"timestamp, frame, x, y, z, qx, qy, qz, qw{extra}"]
    for i, shot in enumerate(taken):
        video.write(shot.rgb[..., ::-1])
        place = ", ".join(f"{v:.9f}" for v in (*shot.world_from_cam[:3, 3], *shot.x_y_z_w))
        own = f", {k.fx_px}, {k.fy_px}, {k.cx_px}, {k.cy_px}, , " if intrinsics else ""
        lines.append(f"{shot.time_s:.6f}, {i:06d}, {place}{own}")
        png(root / f"depth/{i:06d}.png", in_units(shot.depth_m, 1000))
        sure = np.full(shot.depth_m.shape, 2, np.uint8)
        sure[:, 0] = 0
        png(root / f"confidence/{i:06d}.png", sure)
    video.release()
    (root / "odometry.csv").write_text("\n".join(lines) + "\n")
    rows = [[k.fx_px, 0.0, k.cx_px], [0.0, k.fy_px, k.cy_px], [0.0, 0.0, 1.0]]
    if not intrinsics:
        text = "\n".join(", ".join(str(v) for v in row) for row in rows)
        (root / "camera_matrix.csv").write_text(text + "\n")
    return root


def write_record3d(root: Path, taken: list[Shot], *, per_frame: bool = False) -> Path:
    k = taken[0].camera.pinhole
    poses = []
    for i, shot in enumerate(taken):
        opengl = shot.world_from_cam @ OPENGL
        poses.append([*quaternion(opengl[:3, :3]).tolist(), *opengl[:3, 3].tolist()])
        jpg(root / f"rgbd/{i}.jpg", shot.rgb)
        depth_m = shot.depth_m.astype("<f4")
        depth_m[-1] = np.nan
        (root / f"rgbd/{i}.depth").write_bytes(lzfse.compress(depth_m.tobytes()))  # pyright: ignore
        sure = np.full(depth_m.shape, 2, np.uint8)
        (root / f"rgbd/{i}.conf").write_bytes(lzfse.compress(sure.tobytes()))  # pyright: ignore
    metadata = {
        "w": k.width_px,
        "h": k.height_px,
        "dw": taken[0].depth_m.shape[1],
        "dh": taken[0].depth_m.shape[0],
        "fps": 30,
        "K": [k.fx_px, 0, 0, 0, k.fy_px, 0, k.cx_px, k.cy_px, 1],
        "poses": poses,
    }
    if per_frame:
        del metadata["K"]
        metadata["perFrameIntrinsicCoeffs"] = [[k.fx_px, k.fy_px, k.cx_px, k.cy_px]] * len(taken)
    (root / "metadata").write_text(json.dumps(metadata))
    return root


def with_depth(recording: Recording, taken: list[Shot], out: Path) -> Recording:
    """Put depth beside what was read of a format that has none."""
    folder = recording.write_subset(list(range(len(taken))), out).path.parent
    top = json.loads((folder / "transforms.json").read_text())
    for i, (frame, shot) in enumerate(zip(top["frames"], taken, strict=True)):
        png(folder / f"depths/{i}.png", in_units(shot.depth_m, 1000))
        frame["depth_file_path"] = f"depths/{i}.png"
    (folder / "transforms.json").write_text(json.dumps(top))
    return open_recording(folder)


def misfit(here: Frame, there: Frame, turned: Float64[np.ndarray, "3 3"] | None = None) -> float:
    """Return the mean difference (0…255) of a frame and its neighbour, warped by depth and poses.

    Args:
        here: With depth.
        there: The neighbour.
        turned: Axes by which both cameras are read wrong.
    """
    assert here.depth_m is not None
    rows, columns = here.depth_m.shape
    k = here.camera.pinhole.resized(columns, rows)
    known = here.depth_m > 0
    points = k.rays()[known] * here.depth_m[known, None].astype(np.float64)
    turn = np.eye(3) if turned is None else turned
    a, b = here.camera.world_from_cam, there.camera.world_from_cam
    world = points @ (a.rotation @ turn).T + a.translation_m
    in_b = (world - b.translation_m) @ (b.rotation @ turn)
    xy = there.camera.pinhole.project(in_b)
    inside = (
        (in_b[:, 2] > 0)
        & (xy > 1).all(axis=1)
        & (xy < np.array(there.rgb.shape[1::-1]) - 1).all(axis=1)
    )
    if inside.mean() < 0.3:
        return 255.0
    x, y = np.floor(xy[inside]).astype(int).T
    seen = cv2.blur(there.rgb, (3, 3))[y, x]
    small = cv2.resize(cv2.blur(here.rgb, (3, 3)), (columns, rows), interpolation=cv2.INTER_AREA)
    own = small[known][inside]
    return float(np.abs(seen.astype(np.float64) - own).mean())


def assert_only_these_axes_fit(recording: Recording, *, at_most: float = 5.0) -> None:
    """Warp a neighbour as the recording says, and with every other choice of axes."""
    here, there = recording.read(0), recording.read(1)
    right = misfit(here, there)
    assert right < at_most
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turned = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if not np.array_equal(turned, np.eye(3)):
                assert misfit(here, there, turned) > 3 * right, (order, signs)
