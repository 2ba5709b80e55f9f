"""Decodes JSON that came from elsewhere: what is wrong with it is a ValueError, whatever it is."""

from __future__ import annotations

from typing import TypeVar

import msgspec

T = TypeVar("T")


def decode_json(data: bytes | bytearray | memoryview, kind: type[T]) -> T:
    """Return what JSON says, as a type; fields that the type has not are passed over.

    Raises:
        msgspec.DecodeError: It is not JSON, not of this type, or nested too deep.
        UnicodeDecodeError: It is not UTF-8.
    """
    try:
        return msgspec.json.decode(data, type=kind)
    except RecursionError as error:
        raise msgspec.DecodeError("JSON is nested too deep") from error
