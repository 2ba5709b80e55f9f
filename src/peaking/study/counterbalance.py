"""Who does what in which order: Williams Latin squares, conditions and scenes crossed.

Rows of a design are handed out in blocks: every block holds each row once, in an order that follows
from the seed alone, so that it is the same on every machine and nobody can foresee the next row.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence


def williams(count: int) -> list[list[int]]:
    """Return a Williams design for `count` treatments: rows are orders of 0 … count-1.

    Every treatment stands equally often at every position, and follows every other equally often
    (Williams 1949). An even count needs `count` rows, an odd one twice as many. Two treatments
    give AB/BA.

    Raises:
        ValueError: There is nothing to order.
    """
    if count < 1:
        raise ValueError(f"need count >= 1, got {count}")
    if count == 1:
        return [[0]]
    first = [0]
    low, high = 1, count - 1
    while len(first) < count:
        first.append(low)
        low += 1
        if len(first) < count:
            first.append(high)
            high -= 1
    square = [[(value + shift) % count for value in first] for shift in range(count)]
    if count % 2 == 0:
        return square
    return square + [row[::-1] for row in square]


def row_of(number: int, rows: int, *, seed: int) -> int:
    """Return which row of a design the place `number` (0, 1, 2 …) gets.

    Raises:
        ValueError: There is no such place or no row.
    """
    if number < 0 or rows < 1:
        raise ValueError(f"need number >= 0 and rows >= 1, got {number} and {rows}")
    block, place = divmod(number, rows)
    return _shuffled(range(rows), f"{seed}/{rows}/{block}")[place]


def _shuffled(values: Sequence[int], key: str) -> list[int]:
    """Return the values in an order that depends on the key alone."""
    return sorted(values, key=lambda v: hashlib.sha256(f"{key}/{v}".encode()).digest())
