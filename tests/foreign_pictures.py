"""Pictures as strangers make them: small files that cost much, and files that tell much."""

from __future__ import annotations

import re
import struct
import zlib

import cv2
import numpy as np

GPS = b"GPSLatitude 48.2082 N Secret Road 7"


def jpeg(
    width: int = 64, height: int = 48, *, progressive: bool = False, grey: bool = False
) -> bytes:
    """Return a JPEG of a gradient."""
    row = np.linspace(0, 255, width).astype(np.uint8)
    rgb = np.broadcast_to(row[None, :, None], (height, width, 3)).copy()
    rgb[height // 2 :] //= 2
    how = [cv2.IMWRITE_JPEG_PROGRESSIVE, int(progressive)]
    return cv2.imencode(".jpg", rgb[..., 0] if grey else rgb, how)[1].tobytes()


def with_scans(data: bytes, more: int) -> bytes:
    """Return a progressive JPEG whose last scan comes again and again."""
    last = data[[m.start() for m in re.finditer(b"\xff\xda", data)][-1] : -2]
    return data[:-2] + more * last + b"\xff\xd9"


def with_size(data: bytes, width: int, height: int) -> bytes:
    """Return a JPEG that claims another size."""
    found = re.search(b"\xff[\xc0-\xc2]", data)
    assert found is not None
    at = found.end() + 3
    return data[:at] + struct.pack(">HH", height, width) + data[at + 4 :]


def with_frame(data: bytes, marker: int) -> bytes:
    """Return a JPEG that says that it is coded in another way."""
    return re.sub(b"\xff[\xc0-\xc2]", bytes([0xFF, marker]), data, count=1)


def segment(marker: int, body: bytes) -> bytes:
    return bytes([0xFF, marker]) + struct.pack(">H", len(body) + 2) + body


def exif(orientation: int = 1, extra: bytes = GPS) -> bytes:
    """Return an EXIF block with a turn, a maker's note and a thumbnail."""
    entry = struct.pack("<HHIHH", 0x0112, 3, 1, orientation, 0)
    tiff = b"II*\0" + struct.pack("<IH", 8, 1) + entry + struct.pack("<I", 0)
    return b"Exif\0\0" + tiff + extra + jpeg(16, 16)


def telling_jpeg(plain: bytes) -> bytes:
    """Return a JPEG with metadata in every place where one may have some."""
    icc = segment(0xE2, b"ICC_PROFILE\0\x01\x01" + b"profile")
    head = b"".join(
        [
            segment(0xE1, exif(6)),
            segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0<x:xmpmeta>" + GPS),
            segment(0xE2, b"MPF\0" + GPS),
            icc,
            segment(0xED, b"Photoshop 3.0\0" + GPS),
            segment(0xFE, GPS),
            segment(0xE0, b"JFXX\0\x10" + GPS),
            segment(0xEB, GPS),
            b"junk" + GPS,
        ]
    )
    scan = plain.rindex(b"\xff\xda")
    start, middle, end = plain[:2], plain[2:scan], plain[scan:]
    late = segment(0xFE, GPS) + segment(0xE1, exif())
    return start + head + middle + late + end + GPS + jpeg(16, 16)


def chunk(kind: bytes, body: bytes = b"") -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png_of_zeros(width: int, height: int, *, bits: int = 8, color: int = 2) -> bytes:
    """Return a PNG of black, a few bytes long."""
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[color]
    row = 1 + (width * channels * bits + 7) // 8
    deflate = zlib.compressobj(9)
    parts = [deflate.compress(bytes(row)) for _ in range(height)]
    data = b"".join([*parts, deflate.flush()])
    header = struct.pack(">IIBBBBB", width, height, bits, color, 0, 0, 0)
    start = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    palette = chunk(b"PLTE", bytes(3)) if color == 3 else b""
    return start + palette + chunk(b"IDAT", data) + chunk(b"IEND")


def claiming_png(width: int, height: int, *, bits: int = 16, color: int = 6) -> bytes:
    """Return a PNG that claims a size, and holds nothing of it."""
    header = struct.pack(">IIBBBBB", width, height, bits, color, 0, 0, 0)
    start = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    return start + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND")


def telling_png(plain: bytes) -> bytes:
    """Return a PNG with metadata, before and after its pixels and behind its end."""
    told = [
        chunk(b"tEXt", b"Comment\0" + GPS),
        chunk(b"zTXt", b"Comment\0\0" + zlib.compress(bytes(10_000_000))),
        chunk(b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + GPS),
        chunk(b"eXIf", exif()[6:]),
        chunk(b"tIME", struct.pack(">HBBBBB", 2026, 11, 30, 1, 2, 3)),
        chunk(b"meTa", GPS),
    ]
    head = 8 + 25
    return plain[:head] + b"".join(told) + plain[head:-12] + told[0] + plain[-12:] + GPS


def claiming_webp(
    width: int, height: int, kind: bytes, *, frame_px: int | None = None, moves: bool = False
) -> bytes:
    """Return a WebP that claims a size, perhaps in a header of another size, and holds nothing."""
    sides = (width - 1 | (height - 1) << 14) if kind == b"VP8L" else 0
    body = b"\x2f" + struct.pack("<I", sides & 0xFFFFFFFF)
    if kind == b"VP8 ":
        body = b"\0\0\0\x9d\x01\x2a" + struct.pack("<HH", width, height)
    parts = kind + struct.pack("<I", len(body)) + body + b"\0" * (len(body) % 2)
    if frame_px is not None:
        side = (frame_px - 1).to_bytes(3, "little")
        parts = b"VP8X" + struct.pack("<I", 10) + bytes([2 * moves, 0, 0, 0]) + 2 * side + parts
    return b"RIFF" + struct.pack("<I", 4 + len(parts)) + b"WEBP" + parts
