"""Cameras and points from the pictures alone, by COLMAP (extra `colmap`), in the recorded metres.

COLMAP's world has its own axes and scale. One similarity aligns it with the recorded cameras, so
that what is trained on COLMAP's cameras can be rendered from recorded ones, and the reverse. Apart
from that, the recorded poses only decide which pictures are matched.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from peaking.errors import CamerasNotFound
from peaking.frame import Frame, working_size_px
from peaking.geometry import Cam, Camera, Rigid, World
from peaking.output import encode_png
from peaking.point_cloud import PointCloud
from peaking.poses.extra import hush, imported

FEATURE_PIXELS = 540 * 960
"""Features are found in pictures no larger than this."""
NUM_FEATURES = 4096
DATABASE, PICTURES = "database.db", "pictures"
PAIRS_AT_ONCE = 200
NUM_PARTNERS = 20
"""Every picture is matched with this many others: those before and after it, and the nearest."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """What COLMAP found.

    Attributes:
        cameras: One for each picture, in the recorded world; None where COLMAP could not place it.
        points: Triangulated features, in the recorded world.
        scale: Recorded metres per unit of COLMAP's own world.
        residual_m: Root mean square distance of its camera centres from the recorded ones.
    """

    cameras: Sequence[Camera | None]
    points: PointCloud
    scale: float
    residual_m: float


def estimate_cameras(frames: Sequence[Frame], *, seed: int = 0) -> Estimate:
    """Estimate where pictures were taken (Schönberger & Frahm 2016); intrinsics stay.

    Args:
        frames: Undistorted pictures, best at full size: features are found in up to 0.5 megapixels.
        seed: Seed of COLMAP's random samples.

    Raises:
        BackendUnavailable: pycolmap is not installed.
        CamerasNotFound: Fewer than three pictures could be joined.
    """
    pycolmap = imported(", or take --cameras recorded")
    hush(pycolmap)
    pycolmap.set_random_seed(seed)
    small = [shrunk_for_features(frame) for frame in frames]
    with tempfile.TemporaryDirectory(prefix="peaking-colmap-") as folder:
        model = _reconstruct(pycolmap, small, Path(folder), seed)
    if model is None or model.num_reg_images() < 3:
        raise CamerasNotFound(
            f"COLMAP could not join three of the {len(frames)} pictures; take more pictures that "
            "overlap, or use the recorded cameras"
        )
    own_from_cam: dict[int, Rigid[World, Cam]] = {}
    for image in model.images.values():
        if image.has_pose:
            cam_from_own = np.eye(4)
            cam_from_own[:3] = image.cam_from_world().matrix()
            own_from_cam[int(Path(image.name).stem)] = Rigid.from_matrix(cam_from_own).inverse()
    similarity = similarity_to(
        list(own_from_cam.values()), [frames[index].camera.world_from_cam for index in own_from_cam]
    )
    cameras: list[Camera | None] = [None] * len(frames)
    for index, pose in own_from_cam.items():
        moved = Rigid[World, Cam](
            similarity.rotation @ pose.rotation, similarity.apply(pose.translation_m[None])[0]
        )
        cameras[index] = replace(frames[index].camera, world_from_cam=moved)
    off_m = [
        np.linalg.norm(camera.position_m - frame.camera.position_m)
        for camera, frame in zip(cameras, frames, strict=True)
        if camera is not None
    ]
    return Estimate(
        cameras,
        _points(model, small, similarity),
        scale=similarity.scale,
        residual_m=float(np.sqrt(np.mean(np.square(off_m)))),
    )


@dataclass(frozen=True, eq=False)
class Similarity:
    """`p_to = scale * rotation @ p_from + translation_m`."""

    scale: float
    rotation: Float64[np.ndarray, "3 3"]
    translation_m: Float64[np.ndarray, "3"]

    def apply(self, points: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
        """Move points."""
        return self.scale * points @ self.rotation.T + self.translation_m


def similarity_to(
    poses: Sequence[Rigid[World, Cam]], recorded: Sequence[Rigid[World, Cam]]
) -> Similarity:
    """Return the similarity that aligns cameras with the recorded ones by least squares.

    The rotation is the one that best turns all camera axes into the recorded ones, so that a
    straight path is enough; scale and translation are Umeyama's (1991, equations 41 and 42) for it.

    Raises:
        CamerasNotFound: The cameras, or the recorded ones, are all at one point.
    """
    rotations = sum(
        there.rotation @ here.rotation.T for here, there in zip(poses, recorded, strict=True)
    )
    u, _, vt = np.linalg.svd(rotations)
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    here = np.array([pose.translation_m for pose in poses])
    there = np.array([pose.translation_m for pose in recorded])
    away, away_m = here - here.mean(axis=0), there - there.mean(axis=0)
    along = float(np.sum((away @ rotation.T) * away_m))
    if along <= 1e-12:
        raise CamerasNotFound(
            "COLMAP's cameras do not move as the recorded ones do, so its scale stays unknown; "
            "use the recorded cameras"
        )
    scale = along / float(np.sum(away**2))
    return Similarity(scale, rotation, there.mean(axis=0) - scale * rotation @ here.mean(axis=0))


def pairs_to_match(cameras: Sequence[Camera], count: int) -> list[tuple[int, int]]:
    """Pair each picture with its successors and the nearest that face the same way."""
    positions = np.array([camera.position_m for camera in cameras])
    forward = np.array([camera.forward for camera in cameras])
    pairs: set[tuple[int, int]] = set()
    for index in range(len(cameras)):
        away_m = np.linalg.norm(positions - positions[index], axis=1)
        away_m = np.where(forward @ forward[index] > 0.3, away_m, np.inf)
        away_m[index] = np.inf
        near = [int(i) for i in np.argsort(away_m, kind="stable")[:count] if np.isfinite(away_m[i])]
        later = range(index + 1, min(index + 1 + count // 4, len(cameras)))
        pairs |= {(min(index, other), max(index, other)) for other in (*near, *later)}
    return sorted(pairs)


def shrunk_for_features(frame: Frame) -> Frame:
    """Return the frame at the size at which features are found, if it is larger."""
    width, height = frame.camera.pinhole.size_px
    if width * height <= FEATURE_PIXELS:
        return frame
    return frame.resized(*working_size_px(width, height, pixels=FEATURE_PIXELS))


def match_frames(
    pycolmap: Any,
    frames: Sequence[Frame],
    folder: Path,
    told: Callable[[int], None] = lambda _: None,
) -> list[tuple[int, int]]:
    """Find features in pictures and match them, in `database.db`; return which pairs were tried.

    Args:
        pycolmap: The extra.
        frames: Undistorted, small; their intrinsics are believed, their poses decide the pairs.
        folder: Empty.
        told: Told how many pairs are done.
    """
    database, pictures = folder / DATABASE, folder / PICTURES
    pictures.mkdir()
    (folder / "models").mkdir()
    for index, frame in enumerate(frames):
        (pictures / file_name(index)).write_bytes(encode_png(frame.rgb))
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.sift.max_num_features = NUM_FEATURES
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = "PINHOLE"
    pycolmap.extract_features(
        database,
        pictures,
        camera_mode=pycolmap.CameraMode.PER_IMAGE,
        reader_options=reader,
        extraction_options=extraction,
        device=pycolmap.Device.cpu,
    )
    _write_intrinsics(pycolmap, database, frames)
    pairs = pairs_to_match([frame.camera for frame in frames], NUM_PARTNERS)
    listed = folder / "pairs.txt"
    for start in range(0, len(pairs), PAIRS_AT_ONCE):
        told(start)
        chunk = pairs[start : start + PAIRS_AT_ONCE]
        lines = [f"{file_name(a)} {file_name(b)}\n" for a, b in chunk]
        listed.write_text("".join(lines), encoding="ascii")
        pairing = pycolmap.ImportedPairingOptions()
        pairing.match_list_path = listed
        pycolmap.match_image_pairs(database, pairing_options=pairing, device=pycolmap.Device.cpu)
    return pairs


def _reconstruct(pycolmap: Any, frames: Sequence[Frame], folder: Path, seed: int) -> Any:
    """Return the largest reconstruction, or None."""
    match_frames(pycolmap, frames, folder)
    mapping = pycolmap.IncrementalPipelineOptions()
    mapping.random_seed = seed
    mapping.min_model_size = 3
    mapping.ba_refine_focal_length = False
    mapping.ba_refine_extra_params = False
    mapping.mapper.abs_pose_refine_focal_length = False
    mapping.mapper.abs_pose_refine_extra_params = False
    found = pycolmap.incremental_mapping(
        folder / DATABASE, folder / PICTURES, folder / "models", options=mapping
    )
    return max(found.values(), key=lambda model: model.num_reg_images(), default=None)


def _write_intrinsics(pycolmap: Any, database: Path, frames: Sequence[Frame]) -> None:
    opened = pycolmap.Database.open(database)
    try:
        for image in opened.read_all_images():
            pinhole = frames[int(Path(image.name).stem)].camera.pinhole
            camera = opened.read_camera(image.camera_id)
            camera.params = [pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px]
            camera.has_prior_focal_length = True
            opened.update_camera(camera)
    finally:
        opened.close()


def _points(model: Any, frames: Sequence[Frame], similarity: Similarity) -> PointCloud:
    """Return the points that at least three pictures see."""
    found = [point for point in model.points3D.values() if point.track.length() >= 3]
    own = np.array([point.xyz for point in found]).reshape(-1, 3)
    eyes = {i: image.projection_center() for i, image in model.images.items() if image.has_pose}
    names = {i: int(Path(image.name).stem) for i, image in model.images.items()}
    pixel: list[float] = []
    for point in found:
        seen_by = point.track.elements[0].image_id
        distance = float(np.linalg.norm(point.xyz - eyes[seen_by]))
        pixel.append(distance / frames[names[seen_by]].camera.pinhole.fx_px)
    rgb = np.array([point.color for point in found], np.float32).reshape(-1, 3) / np.float32(255)
    return PointCloud(similarity.apply(own), rgb, similarity.scale * np.array(pixel))


def file_name(index: int) -> str:
    """Return the name under which a picture lies in `PICTURES`."""
    return f"{index:06d}.png"
