"""COLMAP's sparse models as numbers: cameras, images and points, binary or text.

The layout is that of COLMAP's doc/format.rst and scene/reconstruction_io_{binary,text}.cc. Newer
versions add rigs and frames, and keep writing each image's own pose, which is what is read.
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from peaking.datasets.foreign_files import read_bytes
from peaking.errors import RecordingError
from peaking.limits import MAX_MODEL_BYTES, MAX_TEXT_BYTES

MODELS: Mapping[int, tuple[str, int]] = {
    0: ("SIMPLE_PINHOLE", 3),
    1: ("PINHOLE", 4),
    2: ("SIMPLE_RADIAL", 4),
    3: ("RADIAL", 5),
    4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8),
    6: ("FULL_OPENCV", 12),
    7: ("FOV", 5),
    8: ("SIMPLE_RADIAL_FISHEYE", 4),
    9: ("RADIAL_FISHEYE", 5),
    10: ("THIN_PRISM_FISHEYE", 12),
    11: ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    12: ("SIMPLE_DIVISION", 4),
    13: ("DIVISION", 5),
    14: ("SIMPLE_FISHEYE", 3),
    15: ("FISHEYE", 4),
    16: ("EUCM", 6),
    17: ("EQUIRECTANGULAR", 2),
}
"""Names of camera models and how many parameters they have, by the number that stands in files."""
_COUNTS = dict(MODELS.values())

_COUNT = struct.Struct("<Q")
_CAMERA = struct.Struct("<IiQQ")
_IMAGE = struct.Struct("<I7dI")
_SEEN = np.dtype([("xy", "<f8", 2), ("id", "<i8")])
_POINT = np.dtype([("id", "<u8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8")])
_TRACK_BYTES = 8
"""Of one picture that sees a point."""
_AGAIN = "export the model again from COLMAP (colmap model_converter)"


@dataclass(frozen=True)
class ModelCamera:
    """Intrinsics: a model's name, the picture's size and the model's parameters."""

    model: str
    width_px: int
    height_px: int
    params: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class ModelImage:
    """A registered picture.

    Attributes:
        name: Relative to the folder of pictures.
        camera_id: Which of the cameras took it.
        w_x_y_z: The rotation, camera from world, real part first.
        translation: The same.
        seen: The ids of the points that it sees, or the line of text that holds them.
    """

    name: str
    camera_id: int
    w_x_y_z: Float64[np.ndarray, "4"]
    translation: Float64[np.ndarray, "3"]
    seen: Int64[np.ndarray, "n"] | bytes


@dataclass(frozen=True, eq=False)
class ModelPoints:
    """The points of a model, by ascending id."""

    ids: Int64[np.ndarray, "n"]
    xyz: Float64[np.ndarray, "n 3"]

    def of(self, image: ModelImage) -> Float64[np.ndarray, "m 3"]:
        """Return the points that a picture sees; ids that stand for no point are passed over."""
        wanted = image.seen if isinstance(image.seen, np.ndarray) else _ids_of(image.seen)
        if len(self.ids) == 0 or len(wanted) == 0:
            return np.zeros((0, 3))
        rows = np.minimum(np.searchsorted(self.ids, wanted), len(self.ids) - 1)
        return self.xyz[np.unique(rows[self.ids[rows] == wanted])]


@dataclass(frozen=True, eq=False)
class Model:
    """What a folder of a sparse model holds; `points` is None where it has no file of them."""

    cameras: Mapping[int, ModelCamera]
    images: tuple[ModelImage, ...]
    points: ModelPoints | None


def ending_of(folder: Path) -> str | None:
    """Return ".bin" or ".txt" of a model's files, as COLMAP prefers them; None: it holds none."""
    for ending in (".bin", ".txt"):
        if all((folder / f"{name}{ending}").is_file() for name in ("cameras", "images")):
            return ending
    return None


def read_model(folder: Path, *, within: Path | None = None) -> Model:
    """Read a sparse model.

    Args:
        folder: Holds cameras, images and perhaps points3D, all .bin or all .txt.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: A file cannot be read, is cut off, or is of another format.
    """
    ending = ending_of(folder) or ".bin"
    is_binary = ending == ".bin"
    at_most = MAX_MODEL_BYTES if is_binary else MAX_TEXT_BYTES
    paths = [folder / f"{name}{ending}" for name in ("cameras", "images", "points3D")]
    readers = (
        (_binary_cameras, _binary_images, _binary_points)
        if is_binary
        else (_text_cameras, _text_images, _text_points)
    )
    cameras = readers[0](paths[0], read_bytes(paths[0], within=within, at_most=at_most))
    images = readers[1](paths[1], read_bytes(paths[1], within=within, at_most=at_most))
    points = None
    if paths[2].is_file():
        points = readers[2](paths[2], read_bytes(paths[2], within=within, at_most=at_most))
    return Model(cameras, images, points)


def _binary_cameras(path: Path, data: bytes) -> Mapping[int, ModelCamera]:
    cameras: dict[int, ModelCamera] = {}
    try:
        (count,) = _COUNT.unpack_from(data)
        offset = _COUNT.size
        for _ in range(count):
            number, model, width_px, height_px = _CAMERA.unpack_from(data, offset)
            offset += _CAMERA.size
            if model not in MODELS:
                problem = f"has a camera of model number {model}, which is none of COLMAP's"
                raise RecordingError(path, problem, remedy=_AGAIN)
            name, num_params = MODELS[model]
            params = struct.unpack_from(f"<{num_params}d", data, offset)
            offset += 8 * num_params
            cameras[number] = ModelCamera(name, width_px, height_px, params)
    except struct.error as error:
        raise _cut_off(path) from error
    return cameras


def _binary_images(path: Path, data: bytes) -> tuple[ModelImage, ...]:
    images: list[ModelImage] = []
    try:
        (count,) = _COUNT.unpack_from(data)
        offset = _COUNT.size
        for _ in range(count):
            _, *pose, camera_id = _IMAGE.unpack_from(data, offset)
            offset += _IMAGE.size
            end = data.find(b"\0", offset)
            if end < 0:
                raise _cut_off(path)
            name = _name(path, data[offset:end])
            (num_seen,) = _COUNT.unpack_from(data, end + 1)
            offset = end + 1 + _COUNT.size
            if num_seen * _SEEN.itemsize > len(data) - offset:
                raise _cut_off(path)
            seen = np.frombuffer(data, _SEEN, num_seen, offset)["id"]
            offset += num_seen * _SEEN.itemsize
            numbers = np.array(pose)
            images.append(ModelImage(name, camera_id, numbers[:4], numbers[4:], seen[seen >= 0]))
    except struct.error as error:
        raise _cut_off(path) from error
    return tuple(images)


def _binary_points(path: Path, data: bytes) -> ModelPoints:
    size = _POINT.itemsize
    starts: list[int] = []
    try:
        (count,) = _COUNT.unpack_from(data)
        if count * (size + _COUNT.size) > len(data):
            raise _cut_off(path)
        offset, length_of = _COUNT.size, _COUNT.unpack_from
        for _ in range(count):  # tracks differ in length, so no more than one can be told ahead
            starts.append(offset)
            offset += size + _COUNT.size + _TRACK_BYTES * length_of(data, offset + size)[0]
    except struct.error as error:
        raise _cut_off(path) from error
    if offset > len(data):
        raise _cut_off(path)
    if not starts:
        return ModelPoints(np.zeros(0, np.int64), np.zeros((0, 3)))
    octets = np.frombuffer(data, np.uint8)
    points = octets[np.array(starts)[:, None] + np.arange(size)].view(_POINT)[:, 0]
    return _in_order(points["id"].astype(np.int64), points["xyz"])


def _text_cameras(path: Path, data: bytes) -> Mapping[int, ModelCamera]:
    cameras: dict[int, ModelCamera] = {}
    for number, line in _lines(data):
        words = line.split()
        if not words:
            continue
        model = words[1].decode("utf-8", "replace") if len(words) > 1 else ""
        if model not in _COUNTS or len(words) != 4 + _COUNTS[model]:
            problem = "need CAMERA_ID MODEL WIDTH HEIGHT and the model's parameters"
            raise _wrong(path, number, problem)
        try:
            sizes = int(words[2]), int(words[3])
            params = tuple(float(word) for word in words[4:])
            cameras[int(words[0])] = ModelCamera(model, *sizes, params)
        except ValueError as error:
            raise _wrong(path, number, "need numbers after the model's name") from error
    return cameras


def _text_images(path: Path, data: bytes) -> tuple[ModelImage, ...]:
    images: list[ModelImage] = []
    lines = _lines(data)
    for number, line in lines:
        if not line.strip():
            continue
        words = line.split(None, 9)
        try:
            numbers = np.array([float(word) for word in words[1:8]])
            camera_id, name = int(words[8]), _name(path, words[9].strip())
        except (ValueError, IndexError) as error:
            problem = "need IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
            raise _wrong(path, number, problem) from error
        number, seen = next(lines, (number, b""))
        if len(seen.split(None, 3)) not in (0, 3, 4):
            raise _wrong(path, number, "need X Y POINT3D_ID for each feature, or an empty line")
        images.append(ModelImage(name, camera_id, numbers[:4], numbers[4:], seen))
    return tuple(images)


def _text_points(path: Path, data: bytes) -> ModelPoints:
    ids: list[int] = []
    xyz: list[tuple[float, float, float]] = []
    for number, line in _lines(data):
        words = line.split(None, 4)
        if not words:
            continue
        try:
            ids.append(int(words[0]))
            xyz.append((float(words[1]), float(words[2]), float(words[3])))
        except (ValueError, IndexError) as error:
            raise _wrong(path, number, "need POINT3D_ID X Y Z and more") from error
    if any(not 0 <= one < 2**63 for one in ids):
        raise RecordingError(path, "has a point whose id is too large", remedy=_AGAIN)
    return _in_order(np.array(ids, np.int64), np.array(xyz, np.float64).reshape(-1, 3))


def _in_order(ids: Int64[np.ndarray, "n"], xyz: Float64[np.ndarray, "n 3"]) -> ModelPoints:
    finite = np.isfinite(xyz).all(axis=1)
    ids, xyz = ids[finite], xyz[finite]
    order = np.argsort(ids, kind="stable")
    return ModelPoints(ids[order], xyz[order])


def _ids_of(line: bytes) -> Int64[np.ndarray, "n"]:
    """Return the ids of the points in an image's second line; words that are no numbers are -1."""
    words = line.split()[2::3]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of words that are no numbers
            ids = np.fromstring(b" ".join(words).decode("ascii"), np.int64, sep=" ")
    except (ValueError, DeprecationWarning):
        return np.zeros(0, np.int64)
    return ids[ids >= 0]


def _lines(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the numbers and lines of a text, those that are empty too, but no comments."""
    start, number = 0, 0
    while start < len(data):
        end = data.find(b"\n", start)
        end = len(data) if end < 0 else end
        number += 1
        if data[start : start + 1] != b"#":
            yield number, data[start:end]
        start = end + 1


def _name(path: Path, data: bytes) -> str:
    try:
        return data.decode("utf-8").replace("\\", "/")
    except UnicodeDecodeError as error:
        raise RecordingError(path, "has a name that is no text", remedy=_AGAIN) from error


def _wrong(path: Path, line: int, problem: str) -> RecordingError:
    return RecordingError(path, problem, field=f"line {line}", remedy=_AGAIN)


def _cut_off(path: Path) -> RecordingError:
    return RecordingError(path, "is cut off, or is no model of COLMAP's", remedy=_AGAIN)
