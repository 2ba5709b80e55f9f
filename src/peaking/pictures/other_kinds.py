"""Decodes a picture of any kind from stdin to stdout, with little memory and time.

`decoding` starts this as a process of its own, with a word that says what is wanted: `pixels`,
`head` of a HEIC (width and height as int32, and then its EXIF), or a channel of an OpenEXR picture.
The first line says type and shape, the values follow. It ends with `MISSING` where the package that
decodes a kind is not installed.
"""

from __future__ import annotations

import importlib
import io
import os
import resource
import sys
from typing import Any

from peaking.limits import DECODER_MEMORY_BYTES, DECODER_SECONDS
from peaking.pictures import exr, heif

PIXELS, HEAD = "pixels", "head"
MISSING = 3


def main() -> None:
    """Decode, or end with 1."""
    resource.setrlimit(resource.RLIMIT_AS, (DECODER_MEMORY_BYTES, DECODER_MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (DECODER_SECONDS, DECODER_SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    import numpy as np

    data, wanted = sys.stdin.buffer.read(), sys.argv[1]
    if heif.is_heif(data):
        stored = _heif_head(data) if wanted == HEAD else _heif_pixels(data)
    elif data.startswith(exr.START):
        stored = _exr_channel(data, wanted)
    else:
        stored = _pixels(data)
    if stored is None:
        raise SystemExit(1)
    head = " ".join([stored.dtype.str, *map(str, stored.shape)])
    sys.stdout.buffer.write(head.encode() + b"\n")
    sys.stdout.buffer.write(np.ascontiguousarray(stored).data.cast("B"))


def _pixels(data: bytes) -> Any:
    import cv2
    import numpy as np

    cv2.setNumThreads(1)
    how = cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
    return cv2.imdecode(np.frombuffer(data, np.uint8), how)


def _heif_pixels(data: bytes) -> Any:
    """Return BGR, upright: a turn is part of how a HEIC is decoded."""
    import numpy as np

    picture = _imported("pi_heif").open_heif(io.BytesIO(data), convert_hdr_to_8bit=True)
    pixels = np.asarray(picture)
    return pixels[..., [2, 1, 0]] if pixels.ndim == 3 else pixels


def _heif_head(data: bytes) -> Any:
    import numpy as np

    picture = _imported("pi_heif").open_heif(io.BytesIO(data))
    size = np.array(picture.size, "<i4").tobytes()
    return np.frombuffer(size + (picture.info.get("exif") or b""), np.uint8)


def _exr_channel(data: bytes, name: str) -> Any:
    package = _imported("OpenEXR")
    descriptor = os.memfd_create("exr")  # OpenEXR opens files by their names
    os.write(descriptor, data)
    with package.File(f"/proc/self/fd/{descriptor}", separate_channels=True) as picture:
        return picture.channels()[name].pixels


def _imported(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise SystemExit(MISSING) from None


if __name__ == "__main__":
    main()
