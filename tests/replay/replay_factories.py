"""Records and pictures for the tests of the replay's writers."""

import math

import numpy as np
from jaxtyping import UInt8

from peaking.replay.overlay_video import Panels
from peaking.replay.records import FrameRecord, ReplayHeader

FRAMES = 150
THRESHOLD_SHARE = 0.0428


def path_record(index: int, **changes: object) -> FrameRecord:
    """A frame of a walk on half a circle, 1 m wide, around a thing in its centre; z is up."""
    angle = math.pi * index / (FRAMES - 1)
    out = np.array([math.cos(angle), math.sin(angle), 0.0])
    since = index % 12
    fields: dict[str, object] = {
        "index": index,
        "name": f"frame_{index:05d}.jpg",
        "timestamp_s": index / 30,
        "position_m": 0.5 * out + np.array([0.0, 0.0, 1.5]),
        "forward": -out,
        "up": np.array([0.0, 0.0, 1.0]),
        "captured": since == 0,
        "nearest_distance_m": None if index == 0 else 0.01 * (since or 12),
        "peaked_share": None if index == 0 else 0.0038 * (since or 12),
        "unseen_share": None if index == 0 else 0.001 * (since or 12),
        "mean_error": None if index == 0 else 0.1,
        "stage_ms": {"read": 2.0, "render": 10.0 + index} if index else {"read": 3.0},
    }
    return FrameRecord(**{**fields, **changes})  # type: ignore[arg-type]


def walk() -> list[FrameRecord]:
    """The whole walk: 13 of 150 frames are captured."""
    return [path_record(index) for index in range(FRAMES)]


def settings(**changes: object) -> ReplayHeader:
    """Settings with something nested and something that HTML would take amiss."""
    fields: dict[str, object] = {
        "version": "9.8.7",
        "preset": "paper",
        "options": {"views": 3, "error": {"kind": "<l1>", "threshold": 0.4}},
        "scene": "desk & <lamp>",
        "size_px": (40, 30),
        "fps": 30.0,
        "threshold_share": THRESHOLD_SHARE,
    }
    return ReplayHeader(**{**fields, **changes})  # type: ignore[arg-type]


def plain(size_px: tuple[int, int], color: tuple[int, int, int]) -> UInt8[np.ndarray, "h w 3"]:
    """A picture of one colour."""
    width, height = size_px
    return np.full((height, width, 3), color, dtype=np.uint8)


def panels(size_px: tuple[int, int] = (40, 30), *, seed: int = 0) -> Panels:
    """Three pictures that differ."""
    noise = np.random.default_rng(seed).integers(0, 256, (size_px[1], size_px[0], 3))
    return Panels(
        noise.astype(np.uint8), plain(size_px, (20, 120, 60)), plain(size_px, (255, 0, 0))
    )
