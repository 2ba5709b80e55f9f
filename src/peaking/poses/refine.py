"""Recorded poses mended: features matched between neighbours, and a bundle adjustment.

Points are triangulated at the recorded poses, then poses and points are adjusted together (Triggs
et al. 2000), three times, with intrinsics as recorded, and recorded positions as priors. A
similarity brings the result back onto the recorded poses, so metres stay. A fifth of the pairs of
pictures takes no part: how far their matches are from each other's epipolar lines tells whether the
poses became better.
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
from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Rigid, World
from peaking.poses.colmap import (
    DATABASE,
    PICTURES,
    match_frames,
    shrunk_for_features,
    similarity_to,
)
from peaking.poses.extra import hush, imported

HELD_OUT = 0.2
ROUNDS_PX = (12.0, 6.0, 4.0)
"""Points that are farther than this from where they were seen are left out, round by round."""
MAX_ITERATIONS = 30
"""Of each adjustment."""
PRIOR = 0.01
"""Standard deviation of recorded positions, in distances of what is shown: it keeps what pictures
hardly tell, a path that is bent as a whole."""
LEAST_SEEN = 30
"""A picture that shows fewer adjusted points keeps its recorded pose."""
LEAST_PAIRS, LEAST_MATCHES = 3, 15
"""So many pairs that were held out, of so many matches each, can tell."""
LEAST_GAIN = 0.05
"""The residual has to shrink by so much; else the recorded poses are kept."""
MOST_MOVED, MOST_TURNED_DEG = 0.25, 15.0
"""What moves by more of the distance of what it shows, or turns more, keeps its recorded pose."""


@dataclass(frozen=True, eq=False)
class Refinement:
    """What was found.

    Attributes:
        cameras: One for each picture; the recorded ones where they are kept.
        before_px: Median distance of held-out matches from their epipolar lines, with recorded
            poses, for each picture; NaN where none tells. In pixels in which features are found.
        after_px: The same with the mended ones.
        kept: Pictures that keep their recorded poses though others were mended.
        is_better: Whether the poses were mended at all.
    """

    cameras: Sequence[Camera]
    before_px: Float64[np.ndarray, "n"]
    after_px: Float64[np.ndarray, "n"]
    kept: Sequence[int]
    is_better: bool

    def words(self) -> str:
        """Say what was done."""
        change = f"{_median(self.before_px):.2f} px before, {_median(self.after_px):.2f} px after"
        if not self.is_better:
            return f"recorded poses are kept: mending them does not help ({change}, median)"
        text = f"poses were mended: matches that took no part lie {change} off (median)"
        if self.kept:
            text += f"; {len(self.kept)} of {len(self.cameras)} pictures keep their recorded ones"
        return text


@dataclass(frozen=True, eq=False)
class Matches:
    """Points of two pictures that show the same, in pixels."""

    a: int
    b: int
    xy_a_px: Float64[np.ndarray, "n 2"]
    xy_b_px: Float64[np.ndarray, "n 2"]


def refine_cameras(
    frames: Sequence[Frame],
    *,
    seed: int = 0,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> Refinement:
    """Mend recorded poses, or keep them where that does not help.

    Args:
        frames: Undistorted pictures, best at full size: features are found in up to 0.5 megapixels.
        seed: Of random samples.
        progress: Told what is done, how much of it is, and of how much.

    Raises:
        BackendUnavailable: pycolmap is not installed.
        CamerasNotFound: Too little can be matched to tell.
    """
    pycolmap = imported()
    hush(pycolmap)
    pycolmap.set_random_seed(seed)
    small = [shrunk_for_features(frame) for frame in frames]
    recorded = [frame.camera for frame in small]
    with tempfile.TemporaryDirectory(prefix="peaking-refine-") as made:
        folder = Path(made)
        count = len(frames) * 12  # about, for the bar
        pairs = match_frames(pycolmap, small, folder, lambda n: progress("matches", n, count))
        drawn = np.random.default_rng(seed).random(len(pairs)) < HELD_OUT
        held = [pair for pair, out in zip(pairs, drawn, strict=True) if out]
        matches = _held_out(pycolmap, folder / DATABASE, held)
        if len(matches) < LEAST_PAIRS:
            raise CamerasNotFound(
                f"only {len(matches)} pairs of pictures could be matched to check poses by; leave "
                "--refine out, or take more pictures that overlap"
            )
        found = _adjusted(pycolmap, folder, recorded, seed, progress)
    adjusted, kept = _aligned(found, recorded)
    before, after = (residuals_px(matches, cameras) for cameras in (recorded, adjusted))
    is_better = _median(after) < (1 - LEAST_GAIN) * _median(before)
    cameras = [
        replace(frame.camera, world_from_cam=mended.world_from_cam) if is_better else frame.camera
        for frame, mended in zip(frames, adjusted, strict=True)
    ]
    return Refinement(cameras, before, after, kept if is_better else (), is_better)


def residuals_px(matches: Sequence[Matches], cameras: Sequence[Camera]) -> Float64[np.ndarray, "n"]:
    """Return for each picture the median distance of its matches from their epipolar lines.

    Args:
        matches: Between pairs of pictures.
        cameras: Of all pictures.

    Returns:
        In pixels; NaN for a picture without matches.
    """
    found: list[list[Float64[np.ndarray, "n"]]] = [[] for _ in cameras]
    for pair in matches:
        off_px = epipolar_px(pair, cameras[pair.a], cameras[pair.b])
        found[pair.a].append(off_px)
        found[pair.b].append(off_px)
    return np.array([np.median(np.concatenate(f)) if f else np.nan for f in found])


def epipolar_px(pair: Matches, a: Camera, b: Camera) -> Float64[np.ndarray, "n"]:
    """Return how far matches are from each other's epipolar lines (mean of both pictures)."""
    b_from_a = b.world_from_cam.inverse() @ a.world_from_cam
    x, y, z = b_from_a.translation_m
    essential = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ b_from_a.rotation
    f = b.pinhole.cam_from_px.T @ essential @ a.pinhole.cam_from_px
    in_a, in_b = (np.c_[xy, np.ones(len(xy))] for xy in (pair.xy_a_px, pair.xy_b_px))
    along_b, along_a = in_a @ f.T, in_b @ f
    off = np.abs((in_b * along_b).sum(axis=1))
    lengths = [np.maximum(np.hypot(line[:, 0], line[:, 1]), 1e-12) for line in (along_a, along_b)]
    return (off / lengths[0] + off / lengths[1]) / 2


def _held_out(pycolmap: Any, database: Path, held: Sequence[tuple[int, int]]) -> list[Matches]:
    """Take the matches of some pairs out of the database, and return them."""
    found: list[Matches] = []
    opened = pycolmap.Database.open(database)
    try:
        ids = {int(Path(image.name).stem): image.image_id for image in opened.read_all_images()}
        at = {i: np.asarray(opened.read_keypoints(ids[i]), np.float64)[:, :2] for i in ids}
        for a, b in held:
            if not opened.exists_two_view_geometry(ids[a], ids[b]):
                continue
            geometry = opened.read_two_view_geometry(ids[a], ids[b])
            pairs = np.asarray(geometry.inlier_matches, np.int64).reshape(-1, 2)
            if len(pairs) >= LEAST_MATCHES:
                found.append(Matches(a, b, at[a][pairs[:, 0]], at[b][pairs[:, 1]]))
            opened.delete_two_view_geometry(ids[a], ids[b])
            opened.delete_matches(ids[a], ids[b])
    finally:
        opened.close()
    return found


def _adjusted(
    pycolmap: Any,
    folder: Path,
    cameras: Sequence[Camera],
    seed: int,
    progress: Callable[[str, int, int], None],
) -> dict[int, tuple[Rigid[World, Cam], float]]:
    """Return poses in a world of their own, and how far away what they show is in the median.

    Pictures that show too few points are left out.
    """
    model = _at_recorded_poses(pycolmap, folder / DATABASE, cameras)
    for number, most_px in enumerate(ROUNDS_PX):
        progress("bundle adjustment", number, len(ROUNDS_PX))
        hush(pycolmap)
        options = pycolmap.IncrementalPipelineOptions()
        options.random_seed = seed
        options.mapper.filter_max_reproj_error = most_px
        options.triangulation.complete_max_reproj_error = most_px
        options.triangulation.merge_max_reproj_error = most_px
        model = pycolmap.triangulate_points(
            model, folder / DATABASE, folder / PICTURES, folder / "models", options=options
        )
        adjustment = pycolmap.BundleAdjustmentOptions()
        adjustment.refine_focal_length = False
        adjustment.refine_extra_params = False
        adjustment.print_summary = False
        adjustment.ceres.solver_options.function_tolerance = 1e-6
        adjustment.ceres.solver_options.max_num_iterations = MAX_ITERATIONS
        adjustment.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
        config = pycolmap.BundleAdjustmentConfig()
        for image_id in model.reg_image_ids():
            config.add_image(image_id)
        priors = _priors(pycolmap, model, cameras)
        held = pycolmap.PosePriorBundleAdjustmentOptions()
        pycolmap.create_pose_prior_bundle_adjuster(adjustment, held, config, priors, model).solve()
    progress("bundle adjustment", len(ROUNDS_PX), len(ROUNDS_PX))
    found: dict[int, tuple[Rigid[World, Cam], float]] = {}
    for image in model.images.values():
        depth = _depth_of(model, image)
        if image.has_pose and depth is not None:
            matrix = np.asarray(image.cam_from_world().matrix(), np.float64)
            cam_from_world = Rigid[Cam, World](matrix[:, :3], matrix[:, 3])
            found[int(Path(image.name).stem)] = cam_from_world.inverse(), depth
    return found


def _priors(pycolmap: Any, model: Any, cameras: Sequence[Camera]) -> list[Any]:
    """Return where pictures were recorded to be, and how surely."""
    depths = [_depth_of(model, image) for image in model.images.values()]
    away = [depth for depth in depths if depth is not None]
    off = PRIOR * float(np.median(away)) if away else 1.0
    return [
        pycolmap.PosePrior(
            corr_data_id=image.data_id,
            position=cameras[int(Path(image.name).stem)].position_m,
            position_covariance=off**2 * np.eye(3),
            coordinate_system=pycolmap.PosePriorCoordinateSystem.CARTESIAN,
        )
        for image in model.images.values()
    ]


def _depth_of(model: Any, image: Any) -> float | None:
    """Return how far away a picture's points are in the median; None where it shows too few."""
    seen = [point.point3D_id for point in image.points2D if point.has_point3D()]
    if len(seen) < LEAST_SEEN:
        return None
    matrix = np.asarray(image.cam_from_world().matrix(), np.float64)
    points = np.array([model.points3D[i].xyz for i in seen], np.float64)
    return float(np.median(points @ matrix[2, :3] + matrix[2, 3]))


def _at_recorded_poses(pycolmap: Any, database: Path, cameras: Sequence[Camera]) -> Any:
    """Return a reconstruction without points, of all pictures that the database holds."""
    model = pycolmap.Reconstruction()
    opened = pycolmap.Database.open(database)
    try:
        for camera in opened.read_all_cameras():
            model.add_camera(camera)
        for rig in opened.read_all_rigs():
            model.add_rig(rig)
        poses: dict[int, Any] = {}
        images = opened.read_all_images()
        for image in images:
            world_from_cam = cameras[int(Path(image.name).stem)].world_from_cam
            cam_from_world = world_from_cam.inverse().matrix()[:3]
            poses[image.frame_id] = pycolmap.Rigid3d(cam_from_world)
        for frame in opened.read_all_frames():
            frame.rig_from_world = poses[frame.frame_id]
            model.add_frame(frame)
            model.register_frame(frame.frame_id)
        for image in images:
            model.add_image(image)
    finally:
        opened.close()
    return model


def _aligned(
    found: dict[int, tuple[Rigid[World, Cam], float]], recorded: Sequence[Camera]
) -> tuple[list[Camera], list[int]]:
    """Return cameras in the recorded world, and which pictures keep their recorded ones."""
    if len(found) < 3:
        raise CamerasNotFound(
            f"only {len(found)} of {len(recorded)} pictures show enough points to mend their poses "
            "by; leave --refine out"
        )
    similarity = similarity_to(
        [pose for pose, _ in found.values()], [recorded[i].world_from_cam for i in found]
    )
    cameras, kept = list(recorded), [i for i in range(len(recorded)) if i not in found]
    for index, (pose, depth) in found.items():
        at_m = similarity.apply(pose.translation_m[None])[0]
        moved = Rigid[World, Cam](similarity.rotation @ pose.rotation, at_m)
        was = recorded[index].world_from_cam
        far = np.linalg.norm(at_m - was.translation_m) > MOST_MOVED * similarity.scale * depth
        cosine = (np.trace(moved.rotation.T @ was.rotation) - 1) / 2
        if far or cosine < np.cos(np.radians(MOST_TURNED_DEG)):
            kept.append(index)
        else:
            cameras[index] = replace(recorded[index], world_from_cam=moved)
    return cameras, sorted(kept)


def _median(values_px: Float64[np.ndarray, "n"]) -> float:
    return float(np.nanmedian(values_px))
