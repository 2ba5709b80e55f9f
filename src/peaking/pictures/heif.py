"""HEIC, the pictures of newer phones (ISO 23008-12); decoded by the extra `heic`."""

from __future__ import annotations

_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1")
NEEDED = "HEIC pictures are decoded by an extra: run pip install 'peaking[heic]'"


def is_heif(data: bytes) -> bool:
    """Return whether a file begins as a HEIC does."""
    return data[4:8] == b"ftyp" and data[8:12] in _BRANDS
