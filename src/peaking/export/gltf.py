"""Gaussians in glTF 2.0 with KHR_gaussian_splatting (ratified 2026; Khronos' glTF repository).

Points with attributes: scales (m) and opacities are as they are used, quaternions are x y z w, and
up is +y. COLOR_0 is for who does not know the extension. `asset.extras.origin_m` is ours: where in
the world positions are counted from.
"""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from peaking.errors import SplatFileError
from peaking.limits import MAX_GAUSSIANS
from peaking.splat.gaussians import Gaussians
from peaking.splat.rendering import C0

EXTENSION = "KHR_gaussian_splatting"
_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_FLOAT, _BYTE = 5126, 5121
_ARRAYS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_EMBEDDED = "data:application/octet-stream;base64,"
MIN_OPACITY = 1e-7
"""Opacities of 0 and 1 have no finite logit."""


def encode_gltf(gaussians: Gaussians, *, binary: bool) -> bytes:
    """Return the bytes of a .glb, or of a .gltf that holds all in itself."""
    attributes = _attributes(gaussians)
    accessors: list[dict[str, Any]] = []
    views: list[dict[str, Any]] = []
    data = b""
    for values in attributes.values():
        part = values.tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(part)})
        views[-1]["target"] = 34962
        is_float = values.dtype == np.float32
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[values.size // len(values)]
        accessor: dict[str, Any] = {"bufferView": len(accessors), "count": len(values)}
        accessor |= {"componentType": _FLOAT if is_float else _BYTE, "type": kind}
        accessors.append(accessor if is_float else {**accessor, "normalized": True})
        data += part + bytes(-len(part) % 4)
    least, most = gaussians.means_m.min(axis=0), gaussians.means_m.max(axis=0)
    accessors[0] |= {"min": least.tolist(), "max": most.tolist()}
    asset: dict[str, Any] = {"version": "2.0", "generator": "peaking"}
    if gaussians.origin_m.any():
        asset["extras"] = {"origin_m": gaussians.origin_m.tolist()}
    how = {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
    how |= {"projection": "perspective", "sortingMethod": "cameraDistance"}
    primitive = {
        "mode": 0,
        "attributes": {name: number for number, name in enumerate(attributes)},
        "extensions": {EXTENSION: how},
    }
    buffer: dict[str, Any] = {"byteLength": len(data)}
    if not binary:
        buffer["uri"] = _EMBEDDED + base64.b64encode(data).decode()
    content = {
        "asset": asset,
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [buffer],
    }
    text = json.dumps(content, separators=(",", ":")).encode()
    if not binary:
        return text
    text += b" " * (-len(text) % 4)
    head = struct.pack("<III", _MAGIC, 2, 28 + len(text) + len(data))
    parts = [head, struct.pack("<II", len(text), _JSON), text]
    return b"".join([*parts, struct.pack("<II", len(data), _BIN), data])


def _attributes(gaussians: Gaussians) -> dict[str, np.ndarray]:
    """Return the values of all attributes, positions first."""
    q = gaussians.quaternions.astype(np.float64)
    q /= np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-12)
    rgb = np.clip(0.5 + C0 * gaussians.sh[:, 0], 0, 1)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    fallback = np.rint(255 * np.column_stack([linear, gaussians.opacities])).astype(np.uint8)
    values = {
        "POSITION": gaussians.means_m,
        "COLOR_0": fallback,
        f"{EXTENSION}:ROTATION": q[:, [1, 2, 3, 0]].astype(np.float32),
        f"{EXTENSION}:SCALE": np.exp(gaussians.log_scales),
        f"{EXTENSION}:OPACITY": gaussians.opacities,
    }
    for number, name in enumerate(_sh_names(gaussians.degree)):
        values[name] = gaussians.sh[:, number]
    return {name: np.ascontiguousarray(array) for name, array in values.items()}


def _sh_names(degree: int) -> list[str]:
    return [
        f"{EXTENSION}:SH_DEGREE_{d}_COEF_{k}" for d in range(degree + 1) for k in range(2 * d + 1)
    ]


def read_gltf(path: Path, data: bytes) -> Gaussians:
    """Read Gaussians from a .glb or a .gltf that holds all in itself: its first mesh that has them.

    Transforms of nodes are not applied, nor are attributes that were quantised read.

    Raises:
        SplatFileError: It is no such file, or is damaged.
    """
    try:
        content, buffer = _parts(data)
        primitives = [one for mesh in content["meshes"] for one in mesh["primitives"]]
        found = next(one for one in primitives if EXTENSION in one.get("extensions", {}))
        names = found["attributes"]
        degree = 0
        while degree < 3 and _sh_names(degree + 1)[-1] in names:
            degree += 1

        def values(name: str) -> np.ndarray:
            return _values(content, buffer, int(names[name]))

        opacity = np.clip(
            values(f"{EXTENSION}:OPACITY").astype(float), MIN_OPACITY, 1 - MIN_OPACITY
        )
        sh = np.stack([values(name) for name in _sh_names(degree)], axis=1)
        origin = content["asset"].get("extras", {}).get("origin_m", [0.0, 0.0, 0.0])
        with np.errstate(divide="ignore", invalid="ignore"):
            log_scales = np.log(np.maximum(values(f"{EXTENSION}:SCALE"), np.float32(1e-30)))
        return Gaussians(
            means_m=values("POSITION").astype(np.float32),
            log_scales=log_scales.astype(np.float32),
            quaternions=values(f"{EXTENSION}:ROTATION")[:, [3, 0, 1, 2]].astype(np.float32),
            opacity_logits=np.log(opacity / (1 - opacity))[:, 0].astype(np.float32),
            sh=sh.astype(np.float32),
            origin_m=np.array(origin, np.float64).reshape(3),
        )
    except StopIteration as error:
        raise SplatFileError(f"{path}: holds no Gaussians ({EXTENSION})") from error
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, struct.error) as error:
        raise SplatFileError(f"{path}: is no sound glTF of Gaussians ({error})") from error
    except RecursionError as error:
        raise SplatFileError(f"{path}: is no sound glTF of Gaussians") from error


def _parts(data: bytes) -> tuple[Any, bytes]:
    """Return the JSON and the buffer."""
    if data.startswith(b"glTF"):
        (length,) = struct.unpack_from("<I", data, 12)
        content = json.loads(data[20 : 20 + length])
        (size,) = struct.unpack_from("<I", data, 20 + length)
        return content, data[28 + length : 28 + length + size]
    content = json.loads(data)
    uri = content["buffers"][0]["uri"]
    if not isinstance(uri, str) or not uri.startswith("data:"):
        raise ValueError("its numbers lie in another file: make a .glb of it")
    return content, base64.b64decode(uri.partition(",")[2], validate=True)


def _values(content: Any, buffer: bytes, number: int) -> np.ndarray:
    """Return what an accessor of floats names, as a matrix."""
    accessor = content["accessors"][number]
    view = content["bufferViews"][accessor["bufferView"]]
    if accessor["componentType"] != _FLOAT:
        raise ValueError("numbers that are not 32-bit floats are not read")
    columns, count = _ARRAYS[accessor["type"]], int(accessor["count"])
    start = int(view.get("byteOffset", 0)) + int(accessor.get("byteOffset", 0))
    stride = int(view.get("byteStride", 4 * columns))
    if not 0 <= count <= MAX_GAUSSIANS:
        raise ValueError(f"at most {MAX_GAUSSIANS:,} Gaussians are read")
    if start < 0 or stride < 4 * columns:
        raise ValueError("an accessor lies outside of its buffer")
    end = start + stride * max(count - 1, 0) + (4 * columns if count else 0)
    if end > len(buffer):
        raise ValueError("it is cut off")
    rows = np.ndarray((count, columns), "<f4", buffer, start, (stride, 4))
    return rows.astype(np.float32)
