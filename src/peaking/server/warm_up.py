"""What a server does first: take all kernels through their paces, and say how far it is."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

import numpy as np

from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.mpi_file import encode
from peaking.view_builder import ViewBuilder

KERNELS = 42
"""That are compiled where none of them is in numba's cache; a test counts them."""

_log = logging.getLogger("peaking.server")


class WarmUp:
    """How far the kernels are compiled.

    On the first start that takes a minute. Later on they come from numba's cache, which lies beside
    the sources, in a second or two, and are not counted.
    """

    def __init__(self, told: Callable[[float], None] = lambda share: None) -> None:
        """Have done nothing yet.

        Args:
            told: Hears the share that is done, 0…1: before and after each kernel that is compiled,
                and 1 at the end. Called from a worker.
        """
        self._told = told
        self._compiled = 0
        self._done = threading.Event()

    @property
    def done(self) -> bool:
        """Whether an MPI is made at once."""
        return self._done.is_set()

    @property
    def share(self) -> float:
        """How much is done, 0…1; 1 only when all is."""
        return 1.0 if self.done else min(self._compiled, KERNELS) / (KERNELS + 1)

    def run(self, builder: ViewBuilder) -> None:
        """Make an MPI that uses all kernels. Captures are served whatever comes of it."""
        from peaking.server.compiled_kernels import listened_to  # numba takes a second to load

        try:
            with listened_to(begun=self._tell, compiled=self._count):
                encode(builder.generate(_small_frame()))
        except Exception:
            _log.exception("the kernels could not be tried")
        self._done.set()
        self._tell()

    def _count(self) -> None:
        self._compiled += 1
        self._tell()

    def _tell(self) -> None:
        self._told(self.share)


def _small_frame() -> Frame:
    """Return a frame that takes all kernels through their paces, and compiles them."""
    height, width = 64, 32
    y, x = np.mgrid[0:height, 0:width]
    rgb = np.stack([x * 7 % 256, y * 3 % 256, (x * y) % 256], axis=-1).astype(np.uint8)
    depth_m = np.where(x < width // 2, 1.0, 2.0).astype(np.float32)
    depth_m[:8] = 0.0
    pinhole = Pinhole(width, height, 40.0, 40.0, width / 2, height / 2)
    here = Rigid[World, Cam].identity()
    return Frame("warm-up", rgb, Camera(pinhole, here), depth_m)
