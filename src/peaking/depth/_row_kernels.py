# pyright: basic
"""What the kernels of depth completion do with whole rows.

Loops over rows become SIMD, and SIMD works on blocks of `BLOCK` numbers: what is left of a row is
done one by one. So rows are padded to whole blocks.

None of these kernels, nor those of `generate`, is compiled with fastmath: numba compiles a kernel
differently when it is called at once than when it comes from the cache, and only exact arithmetic
gives the same MPI in every process of a machine, to the last bit. It costs some 0.3 of 14 ms.

Numba's cache does not see that another file has changed: after a change here, touch the files that
import it.
"""

from __future__ import annotations

import numba as nb

BLOCK = 32


def padded_size(count: int) -> int:
    """Return the size of the least number of whole blocks that hold so many."""
    return -(-count // BLOCK) * BLOCK


@nb.njit(cache=True)
def add_scaled(total, row, weight):
    """Add a weighted row to another of whole blocks."""
    for n in range(total.shape[0]):
        total[n] += weight * row[n]


@nb.njit(cache=True)
def add_levered(total, first, row, lever):
    """Add a row to one of whole blocks, and times a lever to a second."""
    for n in range(total.shape[0]):
        total[n] += row[n]
        first[n] += lever * row[n]


@nb.njit(cache=True)
def add_powers(total, first, second, row, lever):
    """Add a row to one of whole blocks, and times a lever and its square to two others."""
    for n in range(total.shape[0]):
        levered = lever * row[n]
        total[n] += row[n]
        first[n] += levered
        second[n] += lever * levered


@nb.njit(cache=True)
def copy_row(to, row):
    """Write a row over another; an assignment of slices takes seconds to compile."""
    for n in range(to.shape[0]):
        to[n] = row[n]
