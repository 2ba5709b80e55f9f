"""Looks at what was written: it has to say what was meant, or it is not kept."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64, UInt16

from peaking.datasets.stored_images import picture_size_px, read_grey
from peaking.errors import OutputError, RecordingError
from peaking.export.material import Material, points_seen_m
from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole

NUM_POINTS = 2000
"""Of all frames together, whose depth is projected through what was read back."""
LEAST_OF_A_FRAME = 8
MOST_OFF_PX = 1e-3
LAST_BITS = 1e-14
"""Of intrinsics: TUM's pixels begin half a pixel later."""
BINARY, TEXT = 1e-9, 1e-6
"""How far poses may be off: entries of rotations, metres."""


@dataclass(frozen=True, eq=False)
class Meant:
    """What was meant by the files of a frame.

    Attributes:
        camera: As written.
        picture: Its file, in the folder.
        picture_crc: Of its bytes.
        depth: The file of its depth, None without.
        depth_crc: Of the numbers in it.
        depth_unit_m: Of these numbers.
        num_lost: Known values that are too far for the file.
        seen: Some (x, y, depth in metres) of the frame.
    """

    camera: Camera
    picture: str
    picture_crc: int
    depth: str | None
    depth_crc: int
    depth_unit_m: float
    num_lost: int
    seen: Float64[np.ndarray, "n 3"]


def meant(
    material: Material,
    frame: Frame,
    picture: tuple[str, bytes],
    *,
    depth: tuple[str, UInt16[np.ndarray, "h w"]] | None = None,
    depth_unit_m: float = 0.001,
) -> Meant:
    """Note what the files of a frame have to say.

    Args:
        material: The frames.
        frame: Which was written.
        picture: Its file and its bytes.
        depth: The file of its depth, and the numbers in it.
        depth_unit_m: Of these numbers.
    """
    seen = material.seen_m(frame)
    count = max(LEAST_OF_A_FRAME, NUM_POINTS // len(material))
    if not len(seen):  # any distance tells whether cameras agree
        grid = frame.camera.pinhole.resized(5, 5).pixel_centers().reshape(-1, 2)
        scale = np.array(frame.camera.pinhole.size_px) / 5
        seen = np.column_stack([grid * scale, np.ones(len(grid))])
    some = np.unique(np.linspace(0, len(seen) - 1, min(count, len(seen))).astype(int))
    return Meant(
        frame.camera,
        picture[0],
        zlib.crc32(picture[1]),
        None if depth is None else depth[0],
        0 if depth is None else zlib.crc32(np.ascontiguousarray(depth[1]).tobytes()),
        depth_unit_m,
        _num_known(frame.depth_m) - _num_known(depth[1]) if depth is not None else 0,
        seen[some],
    )


def _num_known(depth: np.ndarray | None) -> int:
    return 0 if depth is None else int(np.count_nonzero(depth))


def check(
    folder: Path, out: Path, meant: Sequence[Meant], read: Sequence[tuple[str, Camera]], most: float
) -> int:
    """Compare what was read back with what was meant; return how many points were projected.

    Args:
        folder: Where it lies.
        out: What messages call it.
        meant: Of each frame.
        read: Picture and camera of each frame, as a reader found them.
        most: How far poses may be off (`BINARY`, `TEXT`).

    Raises:
        OutputError: It says something else.
    """
    cameras = dict(read)
    if len(read) != len(meant) or set(cameras) != {one.picture for one in meant}:
        raise OutputError(f"{out}: {len(read)} of {len(meant)} frames were read back; nothing kept")
    for one in meant:
        _check_camera(out, one, cameras[one.picture], most)
    projected = 0
    for place, one in enumerate(meant):
        camera, following = cameras[one.picture], meant[(place + 1) % len(meant)]
        points_m = points_seen_m(one.camera, one.seen)
        pairs = (camera, one.camera), (cameras[following.picture], following.camera)
        for got, wanted in pairs:
            off_px = np.abs(got.project(points_m)[0] - wanted.project(points_m)[0])
            ahead = wanted.sees(points_m)
            if ahead.any() and not off_px[ahead].max() <= MOST_OFF_PX:
                raise _otherwise(out, one, f"points that are {off_px[ahead].max():.2g} px off")
        projected += len(points_m)
        _check_files(folder, out, one)
    return projected


def _same(got: Pinhole, wanted: Pinhole) -> bool:
    """Return whether intrinsics are equal, but for the last bits of 64."""
    pairs = zip(astuple(got), astuple(wanted), strict=True)
    return all(math.isclose(a, b, rel_tol=LAST_BITS) for a, b in pairs)


def _check_camera(out: Path, one: Meant, camera: Camera, most: float) -> None:
    if not _same(camera.pinhole, one.camera.pinhole):
        raise _otherwise(out, one, f"intrinsics {camera.pinhole}, not {one.camera.pinhole}")
    off = np.abs(camera.world_from_cam.matrix() - one.camera.world_from_cam.matrix()).max()
    # What 64 bits have no room for at the other end of a map is no fault.
    room = 4 * np.finfo(float).eps * np.abs(one.camera.position_m).max()
    if not off <= most + room:
        raise _otherwise(out, one, f"a pose that is {off:.2g} off")


def _check_files(folder: Path, out: Path, one: Meant) -> None:
    """Read picture and depth of a frame again."""
    try:
        size_px = picture_size_px(folder / one.picture)
        stored = None if one.depth is None else read_grey(folder / one.depth)
    except RecordingError as error:
        raise _otherwise(out, one, f"files that cannot be read ({error.problem})") from error
    if size_px != one.camera.pinhole.size_px:
        raise _otherwise(out, one, f"a picture of {size_px} pixels")
    if zlib.crc32((folder / one.picture).read_bytes()) != one.picture_crc:
        raise _otherwise(out, one, "another picture")
    if stored is None:
        return
    if zlib.crc32(np.ascontiguousarray(stored).tobytes()) != one.depth_crc:
        raise _otherwise(out, one, "other depth")
    height, width = stored.shape
    column = (one.seen[:, 0] * width / size_px[0]).astype(int)
    row = (one.seen[:, 1] * height / size_px[1]).astype(int)
    depth_m = stored[row, column] * one.depth_unit_m
    off_m = np.abs(depth_m - one.seen[:, 2])[depth_m > 0]
    if len(off_m) and not off_m.max() <= 0.5 * one.depth_unit_m + 1e-6 * one.seen[:, 2].max():
        raise _otherwise(out, one, f"depth that is {off_m.max():.2g} m off")


def _otherwise(out: Path, one: Meant, problem: str) -> OutputError:
    return OutputError(
        f"{out}: {one.picture} was read back with {problem}; nothing was kept: please report this"
    )
