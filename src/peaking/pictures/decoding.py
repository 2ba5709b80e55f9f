"""Decodes pictures from anywhere, within `peaking.limits`.

JPEG, PNG and WebP are looked at first and decoded here. Of other kinds nothing can be said
beforehand: they are decoded in a process that may take so much memory and time and no more.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys

import cv2
import numpy as np
import simplejpeg
from jaxtyping import UInt8

from peaking.errors import ToolMissing
from peaking.limits import DECODER_SECONDS, MAX_PIXELS
from peaking.pictures import exr, heif, png, webp
from peaking.pictures.jpeg import check_jpeg, tidied
from peaking.pictures.other_kinds import HEAD, MISSING, PIXELS
from peaking.pictures.too_costly import TooCostly, check_pixels

AS_STORED = cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
_NO_PICTURE = "is not a picture that can be decoded"


def decode_jpeg(data: bytes) -> UInt8[np.ndarray, "h w 3"]:
    """Decode a JPEG to RGB; a turn that EXIF notes is ignored.

    Raises:
        ValueError: It is damaged, cut off, or of a kind that is not read.
        TooCostly: It would take too much memory or time.
    """
    check_jpeg(data)
    try:
        return simplejpeg.decode_jpeg(data, "RGB")
    except ValueError as error:
        for zeros, spare in [(False, 0), (True, 0), *((False, n) for n in _spare_bytes(error))]:
            with contextlib.suppress(ValueError):
                return simplejpeg.decode_jpeg(tidied(data, zeros=zeros, spare=spare), "RGB")
        raise ValueError(f"is not a sound JPEG ({error})") from error


def _spare_bytes(error: ValueError) -> range:
    """Return how many bytes too many a decoder may have found before the end marker.

    It counts those that it has not read ahead, which may be eight.
    """
    found = re.search(r"(\d+) extraneous bytes before marker 0xd9", str(error))
    return range(0) if found is None else range(int(found[1]), int(found[1]) + 9)


def decode_stored(data: bytes) -> np.ndarray:
    """Decode another picture to what is stored: BGR or BGRA or grey, of any type.

    Raises:
        ValueError: It is damaged, cut off, or no picture.
        TooCostly: It would take too much memory or time.
    """
    if data.startswith(png.START):
        pixels = png.png_of(data, png.PIXELS)
    elif webp.is_webp(data):
        webp.check_webp(data)
        pixels = webp.without_metadata(data)
    else:
        return decode_elsewhere(data)
    try:
        stored = cv2.imdecode(np.frombuffer(pixels, np.uint8), AS_STORED)
    except cv2.error as error:
        raise ValueError(_NO_PICTURE) from error
    if stored is None:
        raise ValueError(_NO_PICTURE)
    return stored


def decode_elsewhere(data: bytes, wanted: str = PIXELS) -> np.ndarray:
    """Decode a picture of any kind in a process with bounded memory and time, to what is stored.

    Args:
        data: The file.
        wanted: `other_kinds.PIXELS` or `HEAD`, or a channel of an OpenEXR picture.

    Raises:
        ValueError: It is damaged or no picture, or needs too much memory.
        TooCostly: It takes too long.
        ToolMissing: The extra that decodes its kind is not installed.
    """
    environment = os.environ | {
        "OPENCV_IO_MAX_IMAGE_PIXELS": str(MAX_PIXELS),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }
    command = [sys.executable, "-m", "peaking.pictures.other_kinds", wanted]
    try:
        done = subprocess.run(
            command, input=data, capture_output=True, timeout=DECODER_SECONDS, env=environment
        )
    except subprocess.TimeoutExpired:
        raise TooCostly("takes too long to decode", remedy="store it as JPEG or PNG") from None
    if done.returncode == MISSING:
        raise ToolMissing(exr.NEEDED if data.startswith(exr.START) else heif.NEEDED)
    start = done.stdout.find(b"\n") + 1
    if done.returncode != 0 or start == 0:
        raise ValueError(_NO_PICTURE)
    kind, *shape = done.stdout[:start].decode().split()
    pixels = np.frombuffer(done.stdout, np.uint8, offset=start)  # not copied: it may be gigabytes
    return pixels.view(kind).reshape([int(side) for side in shape])


def heif_head(data: bytes) -> tuple[int, int, bytes]:
    """Return width and height of a HEIC as it is seen, and its EXIF, which may be empty.

    Raises:
        ValueError: It is damaged.
        TooCostly: It would take too much memory or time.
        ToolMissing: The extra `heic` is not installed.
    """
    told = decode_elsewhere(data, HEAD)
    if told.dtype != np.uint8 or told.ndim != 1 or len(told) < 8:
        raise ValueError(_NO_PICTURE)
    width, height = told[:8].view("<i4").tolist()
    check_pixels(width, height)
    return width, height, told[8:].tobytes()
