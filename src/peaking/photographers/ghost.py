"""The frame to step into next, as the server suggests it (`peaking.guidance.watch`)."""

from __future__ import annotations

import math

from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Rigid, World
from peaking.guidance.watch import Watch, small_views
from peaking.mpi import Mpi
from peaking.options import Options
from peaking.view_builder import ViewBuilder

AGAIN_S = 2.5
"""The walk is looked at again so often, and when a view comes."""


class Ghost:
    """Watches a session, and says where the next view helps."""

    def __init__(self, options: Options) -> None:
        """Begin without views."""
        self._watch = Watch(options)
        self._builder = ViewBuilder(small_views(options))
        self._mpis: list[Mpi] = []
        self._path: list[Rigid[World, Cam]] = []
        self._due_s = -math.inf
        self.place: Rigid[World, Cam] | None = None
        """Where to go; None: nowhere in particular."""

    def add_view(self, frame: Frame) -> None:
        """Take a view in."""
        self._mpis.append(self._builder.build(frame).mpi)
        self._due_s = -math.inf

    def walk(self, time_s: float, camera: Camera) -> None:
        """Note where the phone is, and look again when it is time."""
        self._path.append(camera.world_from_cam)
        if self._mpis and time_s >= self._due_s:
            self._due_s = time_s + AGAIN_S
            suggested = self._watch.advise(self._mpis, self._path).next
            self.place = None if suggested is None else suggested.virtual.camera.world_from_cam
