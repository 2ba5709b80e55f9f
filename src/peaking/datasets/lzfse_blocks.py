"""LZFSE, Apple's packing, unpacked only where its blocks say the size that is expected.

A few kB may unpack to gigabytes. Each block's header states its size unpacked and where the next
one begins (lzfse/lzfse, lzfse_internal.h).
"""

from __future__ import annotations

import struct

from peaking.errors import ToolMissing

_END, _RAW, _LZVN, _LZFSE = b"bvx$", b"bvx-", b"bvxn", b"bvx2"
_MISSING = "depth of Record3D is packed with LZFSE: run pip install 'peaking[record3d]'"


def unpacked(packed: bytes, num_bytes: int) -> bytes:
    """Return what is packed.

    Raises:
        ValueError: It is damaged, or of another size.
        ToolMissing: The extra `record3d` is not installed.
    """
    try:
        import lzfse  # pyright: ignore
    except ImportError as error:
        raise ToolMissing(_MISSING) from error
    stated = stated_bytes(packed)
    if stated != num_bytes:
        raise ValueError(f"would be {stated} bytes unpacked, not {num_bytes}")
    try:
        data = bytes(lzfse.decompress(packed))  # pyright: ignore
    except lzfse.error as error:  # pyright: ignore
        raise ValueError("LZFSE is damaged") from error
    if len(data) != num_bytes:
        raise ValueError(f"is {len(data)} bytes unpacked, not {num_bytes}")
    return data


def stated_bytes(packed: bytes) -> int:
    """Return how many bytes the blocks say that they unpack to.

    Raises:
        ValueError: They are damaged or cut off.
    """
    total, at = 0, 0
    while True:
        magic = packed[at : at + 4]
        if magic == _END:
            return total
        try:
            (raw,) = struct.unpack_from("<I", packed, at + 4)
            if magic == _RAW:
                length = 8 + raw
            elif magic == _LZVN:
                length = 12 + struct.unpack_from("<I", packed, at + 8)[0]
            elif magic == _LZFSE:
                counts, states, sizes = struct.unpack_from("<QQQ", packed, at + 8)
                literals, matches = (counts >> 20) & 0xFFFFF, (states >> 40) & 0xFFFFF
                length = (sizes & 0xFFFFFFFF) + literals + matches
            else:
                raise ValueError("is not packed with LZFSE")
        except struct.error as error:
            raise ValueError("LZFSE is cut off") from error
        if length <= 8 and raw:
            raise ValueError("LZFSE is damaged")
        total, at = total + raw, at + max(length, 8)
