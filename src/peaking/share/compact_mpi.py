"""Multi-plane images for the road: without what hardly shows, in fewer planes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from peaking.mpi import TILE_PX, Mpi
from peaking.mpi_file import DEFAULT_QUALITY, encode
from peaking.options import Options


@dataclass(frozen=True)
class Coding:
    """How much of a multi-plane image is kept.

    Attributes:
        quality: JPEG quality of the colours.
        num_planes: Planes of the layered generator, at most; None: as the options say.
        least_share: Tiles go of which no texel makes up more of a pixel than this, seen from where
            the view was taken; 0 keeps all.
    """

    quality: int
    num_planes: int | None = None
    least_share: float = 0.0

    def options(self, options: Options) -> Options:
        """Return the options by which such images are generated."""
        if self.num_planes is None or options.generator != "layered":
            return options
        return replace(options, num_planes=min(self.num_planes, options.num_planes))

    def encode(self, mpi: Mpi) -> bytes:
        """Return the bytes of an image that was generated so."""
        if self.least_share > 0:
            mpi = without_hidden(mpi, self.least_share)
        return encode(mpi, quality=self.quality)


WHOLE = Coding(DEFAULT_QUALITY)
BETWEEN = (
    Coding(90, least_share=0.1),
    Coding(90, num_planes=24, least_share=0.1),
    Coding(90, num_planes=18, least_share=0.1),
)
"""From large to small; each loses less than leaving out views."""
COMPACT = Coding(85, num_planes=16, least_share=0.1)
"""Half the bytes: twice as many views show more than what each of them loses (docs/viewing.md)."""


def without_hidden(mpi: Mpi, least_share: float) -> Mpi:
    """Return an image without the tiles that others hide from where it was taken.

    Of many views, the others show what lies behind.
    """
    kept = _shows(mpi, least_share)
    return replace(mpi, tile_places=mpi.tile_places[kept], texels=mpi.texels[kept])


def _shows(mpi: Mpi, least_share: float) -> Bool[np.ndarray, "tiles"]:
    index = mpi.tile_index
    passes = np.ones((*index.shape[1:], TILE_PX, TILE_PX), np.float32)
    shows = np.zeros(len(mpi.texels), np.bool_)
    for plane in reversed(range(mpi.num_planes)):
        rows, cols = np.nonzero(index[plane] >= 0)
        tiles = index[plane][rows, cols]
        alpha = mpi.texels[tiles, ..., 3].astype(np.float32) / np.float32(255)
        shows[tiles] = (passes[rows, cols] * alpha).max(axis=(1, 2)) > least_share
        passes[rows, cols] *= 1 - alpha
    return shows
