"""The header of a `.mpi` file: what it says, in JSON, and what it may say."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any, Literal, NoReturn, cast, get_args

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Cam, Pinhole, Rigid, World
from peaking.limits import MAX_MPI_PIXELS, MAX_MPI_SIDE_PX, MAX_PLACES, MAX_PLANES, MAX_TILES
from peaking.mpi import tile_grid

Codec = Literal["jpeg", "lossless"]

MAX_HEADER_BYTES = 2**20


@dataclass(frozen=True)
class Header:
    """What is known of an MPI before its texels."""

    pinhole: Pinhole
    world_from_cam: Rigid[World, Cam]
    plane_depths_m: Float64[np.ndarray, "planes"]
    generator: str
    codec: Codec
    num_tiles: int

    def check(self) -> None:
        """Raise ValueError when a value is outside what the format allows."""
        width, height = self.pinhole.size_px
        if max(width, height) > MAX_MPI_SIDE_PX:
            raise ValueError(f"need at most {MAX_MPI_SIDE_PX} pixels a side, got {width}x{height}")
        if width * height > MAX_MPI_PIXELS:
            raise ValueError(f"need at most {MAX_MPI_PIXELS} pixels, got {width}x{height}")
        if len(self.plane_depths_m) > MAX_PLANES:
            raise ValueError(f"need at most {MAX_PLANES} planes, got {len(self.plane_depths_m)}")
        _check_depths(self.plane_depths_m)
        rows, cols = tile_grid(width, height)
        places = len(self.plane_depths_m) * rows * cols
        if places > MAX_PLACES:
            raise ValueError(f"need at most {MAX_PLACES} places of tiles, got {places}")
        if not 0 <= self.num_tiles <= min(MAX_TILES, places):
            most = min(MAX_TILES, places)
            raise ValueError(f"need at most {most} tiles, got {self.num_tiles}")
        if self.codec not in get_args(Codec):
            raise ValueError(f"need codec {' or '.join(get_args(Codec))}, got {self.codec!r}")
        if np.abs(self.world_from_cam.rotation).max() > 2:
            raise ValueError("need a rotation in world_from_cam")
        Rigid[World, Cam].from_matrix(self.world_from_cam.matrix())

    def to_json(self, occupancy_bytes: int, payload_bytes: int) -> bytes:
        """Return the header as UTF-8; floats are written so that they read back the same."""
        k = self.pinhole
        fields = {
            "width_px": k.width_px,
            "height_px": k.height_px,
            "fx_px": float(k.fx_px),
            "fy_px": float(k.fy_px),
            "cx_px": float(k.cx_px),
            "cy_px": float(k.cy_px),
            "world_from_cam": self.world_from_cam.matrix()[:3].tolist(),
            "plane_depths_m": self.plane_depths_m.tolist(),
            "generator": self.generator,
            "codec": self.codec,
            "num_tiles": self.num_tiles,
            "occupancy_bytes": occupancy_bytes,
            "payload_bytes": payload_bytes,
        }
        text = json.dumps(fields, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        data = text.encode()
        if len(data) > MAX_HEADER_BYTES:
            raise ValueError(f"need a header of at most {MAX_HEADER_BYTES} bytes, got {len(data)}")
        return data

    @staticmethod
    def from_json(data: bytes) -> tuple[Header, int, int]:
        """Read a header; return it with the bytes of occupancy and payload that it promises.

        Raises:
            ValueError: It is not JSON, or a field is missing or not of its kind.
        """
        try:
            document = json.loads(data.decode(), parse_constant=_refuse)
        except RecursionError as error:
            raise ValueError("need JSON, got too many brackets") from error
        if not isinstance(document, dict):
            raise ValueError(f"need a JSON object, got {type(document).__name__}")
        fields = _Fields(cast("dict[str, Any]", document))
        codec = fields.text("codec")
        if codec not in get_args(Codec):
            raise ValueError(f"need codec {' or '.join(get_args(Codec))}, got {codec[:40]!r}")
        rows = fields.list_of("world_from_cam", 3)
        matrix = np.array([_numbers(row, "world_from_cam", 4) for row in rows])
        depths_m = fields.list_of("plane_depths_m", MAX_PLANES, at_least=1)
        header = Header(
            pinhole=Pinhole(
                fields.whole("width_px", MAX_MPI_SIDE_PX),
                fields.whole("height_px", MAX_MPI_SIDE_PX),
                fields.number("fx_px"),
                fields.number("fy_px"),
                fields.number("cx_px"),
                fields.number("cy_px"),
            ),
            world_from_cam=Rigid(matrix[:, :3].copy(), matrix[:, 3].copy()),
            plane_depths_m=np.array(_numbers(depths_m, "plane_depths_m", len(depths_m))),
            generator=fields.text("generator"),
            codec=cast("Codec", codec),
            num_tiles=fields.whole("num_tiles", MAX_TILES),
        )
        return header, fields.whole("occupancy_bytes"), fields.whole("payload_bytes")


class _Fields:
    """Typed access to a JSON object; other fields than those asked for are left alone."""

    def __init__(self, fields: dict[str, Any]) -> None:
        self._fields = fields

    def _get(self, name: str) -> Any:
        if name not in self._fields:
            raise ValueError(f"{name} is missing")
        return self._fields[name]

    def text(self, name: str) -> str:
        value = self._get(name)
        if not isinstance(value, str):
            raise ValueError(f"need text as {name}, got {_short(value)}")
        value.encode()  # half of a surrogate pair is no text: UnicodeEncodeError, a ValueError
        return value

    def whole(self, name: str, at_most: int = 2**32, *, at_least: int = 0) -> int:
        value = self._get(name)
        if not isinstance(value, int) or isinstance(value, bool) or value < at_least:
            raise ValueError(f"need a whole number >= {at_least} as {name}, got {_short(value)}")
        if value > at_most:
            raise ValueError(f"need {name} <= {at_most}, got {_short(value)}")
        return value

    def number(self, name: str) -> float:
        return _number(self._get(name), name)

    def list_of(self, name: str, at_most: int, *, at_least: int | None = None) -> list[Any]:
        value = self._get(name)
        least = at_most if at_least is None else at_least
        if not isinstance(value, list) or not least <= len(cast("list[Any]", value)) <= at_most:
            raise ValueError(f"need a list of {least} to {at_most} as {name}, got {_short(value)}")
        return cast("list[Any]", value)


def _numbers(value: Any, name: str, count: int) -> list[float]:
    if not isinstance(value, list) or len(cast("list[Any]", value)) != count:
        raise ValueError(f"need {count} numbers in {name}, got {_short(value)}")
    return [_number(item, name) for item in cast("list[Any]", value)]


def _number(value: Any, name: str) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if math.isfinite(number):
            return number
    raise ValueError(f"need a finite number in {name}, got {_short(value)}")


def _check_depths(depths_m: Float64[np.ndarray, "planes"]) -> None:
    if len(depths_m) == 0 or not np.isfinite(depths_m).all() or depths_m.min() <= 0:
        raise ValueError("need finite plane depths > 0")
    if (np.diff(depths_m) >= 0).any():
        raise ValueError("need plane depths sorted from the farthest to the nearest")


def _short(value: Any) -> str:
    """Return what to quote of a value that may be of any size."""
    if isinstance(value, str):
        return repr(value[:40])
    if isinstance(value, bool | float) or value is None:
        return repr(value)
    if isinstance(value, int):
        return str(value) if abs(value) < 10**12 else "a very large number"
    return f"a {type(value).__name__} of {len(value)}"


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"need finite numbers, got {constant}")
