"""A drawn scene as a recording: the frames, their files, and the command line that makes them."""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from drawn_scenes.rendering import (
    FOCAL_PX,
    GLASS_LIKE,
    HEIGHT_PX,
    MIRROR_LIKE,
    OTHER,
    OVEREXPOSED,
    WIDTH_PX,
    DrawnScene,
    MovingParts,
    develop,
    first_hit,
    is_clipped,
    phone_camera,
    render_linear,
)
from peaking.photographers.drawn.mesh import Pose
from peaking.photographers.drawn.phone import DEPTH_SIZE_PX, phone_depth, scale_errors

FOLDERS = ("images", "depths", "depths_exact", "materials")
CLIPPED_FROM = 250
"""All channels of an over-exposed pixel are at least so bright in the stored picture."""


@dataclass(frozen=True)
class Shot:
    """One frame to make."""

    world_from_cam: np.ndarray
    """4x4, OpenGL camera axes, metres."""
    timestamp_s: float
    group: str | None = None
    """What the frame is for: "view", or what it is held out for."""
    moving: Pose | None = None
    """Where the moving parts stand."""


@dataclass(frozen=True)
class Files:
    """How the pictures are stored."""

    quality: int
    """JPEG quality of the colour pictures."""
    exact_size_px: tuple[int, int] = (WIDTH_PX, HEIGHT_PX)
    """Width and height of the exact depth."""
    marks_overexposed: bool = False


def parser(description: str, *, seed: int) -> argparse.ArgumentParser:
    """The command line that all drawn scenes share."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder to write")
    parser.add_argument("--spp", type=int, default=14, help="light paths per pixel")
    parser.add_argument(
        "--only", default=":", metavar="START:END[:STEP]", help="render these frames only"
    )
    parser.add_argument(
        "--seed", type=int, default=seed, help="of textures, tremor, light paths and sensor noise"
    )
    return parser


def make_recording(
    scene: DrawnScene, shots: Sequence[Shot], files: Files, options: argparse.Namespace
) -> None:
    """Write transforms.json with every frame, and render what was asked for."""
    for folder in FOLDERS:
        (options.out / folder).mkdir(parents=True, exist_ok=True)
    text = json.dumps(_transforms(shots), indent=1) + "\n"
    (options.out / "transforms.json").write_text(text)
    wanted = range(len(shots))[slice(*(int(n) if n else None for n in options.only.split(":")))]
    sensor, moving = phone_camera(), MovingParts(scene)
    scales = scale_errors(len(shots), options.seed)
    start_s = time.monotonic()
    for done, frame in enumerate(wanted, start=1):
        place = shots[frame].moving
        if place is not None:
            moving.place(place)
        pose, rng = shots[frame].world_from_cam, np.random.default_rng((options.seed, 1000 + frame))
        linear = render_linear(
            scene, sensor, pose, spp=options.spp, seed=options.seed * 100_003 + frame
        )
        _write_frame(
            scene, pose, linear, files,
            out=options.out, frame=frame, scale=float(scales[frame]), rng=rng,
        )  # fmt: skip
        spent_s = time.monotonic() - start_s
        left_min = spent_s / done * (len(wanted) - done) / 60
        print(f"frame {frame}: {done} of {len(wanted)}, {left_min:.1f} min left", flush=True)
    print(f"depth pictures are {DEPTH_SIZE_PX[0]}x{DEPTH_SIZE_PX[1]}; all in {options.out}")


def _write_frame(
    scene: DrawnScene,
    pose: np.ndarray,
    linear: np.ndarray,
    files: Files,
    *,
    out: Path,
    frame: int,
    scale: float,
    rng: np.random.Generator,
) -> None:
    """Write the four pictures of a frame."""
    image = develop(linear, rng)
    hit = first_hit(scene, pose, (WIDTH_PX, HEIGHT_PX))
    dropout = np.select([hit.material == MIRROR_LIKE, hit.material == GLASS_LIKE], [0.35, 0.4], 0.0)
    sensed = phone_depth(hit.seen_m, image, dropout, scale=scale, rng=rng)
    jpeg = [
        cv2.IMWRITE_JPEG_QUALITY, files.quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1,
        cv2.IMWRITE_JPEG_PROGRESSIVE, 1,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420,
    ]  # fmt: skip
    picture = out / f"images/frame_{frame:05d}.jpg"
    cv2.imwrite(str(picture), image[..., ::-1], jpeg)
    exact_m = first_hit(scene, pose, files.exact_size_px).exact_m
    if files.marks_overexposed:
        stored = cv2.imread(str(picture))
        clipped = is_clipped(linear) & (stored >= CLIPPED_FROM).all(axis=-1)
        hit.material[clipped & (hit.material == OTHER)] = OVEREXPOSED
    _write_png(out / f"depths/frame_{frame:05d}.png", sensed)
    _write_png(out / f"depths_exact/frame_{frame:05d}.png", _millimetres(exact_m))
    _write_png(out / f"materials/frame_{frame:05d}.png", hit.material)


def _write_png(path: Path, image: np.ndarray) -> None:
    """Write a PNG as small as it gets."""
    labels = image.dtype == np.uint8
    choice = cv2.IMWRITE_PNG_ALL_FILTERS if labels else cv2.IMWRITE_PNG_FILTER_PAETH
    strategy = cv2.IMWRITE_PNG_STRATEGY_FILTERED
    small = [
        cv2.IMWRITE_PNG_COMPRESSION,
        9,
        cv2.IMWRITE_PNG_FILTER,
        choice,
        cv2.IMWRITE_PNG_STRATEGY,
        strategy,
    ]
    cv2.imwrite(str(path), image, small)


def _millimetres(depth_m: np.ndarray) -> np.ndarray:
    """Depth as stored."""
    return np.clip(depth_m * 1000.0 + 0.5, 0, 65535).astype(np.uint16)


def _transforms(shots: Sequence[Shot]) -> dict[str, Any]:
    """The scene's description in nerfstudio's format, with keys of ours for the extra pictures."""
    frames = [
        {
            "file_path": f"images/frame_{k:05d}.jpg",
            "depth_file_path": f"depths/frame_{k:05d}.png",
            "exact_depth_file_path": f"depths_exact/frame_{k:05d}.png",
            "materials_file_path": f"materials/frame_{k:05d}.png",
            **({} if shot.group is None else {"group": shot.group}),
            "timestamp_s": round(shot.timestamp_s, 6),
            "transform_matrix": np.round(shot.world_from_cam, 9).tolist(),
        }
        for k, shot in enumerate(shots)
    ]
    lens = {
        "fl_x": FOCAL_PX,
        "fl_y": FOCAL_PX,
        "cx": WIDTH_PX / 2,
        "cy": HEIGHT_PX / 2,
        "w": WIDTH_PX,
        "h": HEIGHT_PX,
    }
    still = dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0)
    return {
        "camera_model": "PINHOLE",
        **lens,
        **still,
        "depth_unit_scale_factor": 0.001,
        "frames": frames,
    }
