"""What the method says of a live picture, and the paper's plain rule on the same rendering.

Whatever else in this folder asks the method, asks here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.error_map import MIN_ALPHA, ErrorMap
from peaking.geometry import Camera
from peaking.light_field import LightField, compare_with
from peaking.metric_depth import CapturedView
from peaking.options import DEFAULT, PAPER, Options
from peaking.pipeline import Reconstruction
from peaking.rendering import Rendering
from peaking.tracking import refine

RuleName = Literal["ours", "paper"]
RULES: tuple[RuleName, ...] = ("ours", "paper")

Change = Callable[[Rendering], Rendering]
"""Puts a fault into a rendering."""


@dataclass(frozen=True)
class Judgement:
    """What a rule says of every pixel of a live picture.

    Attributes:
        score: How wrong, 0…3; 0 where it says that the model is not to blame.
        red: Wrong, and a view from here mends it.
        unseen: Never seen.
        unfixable: No view will help.
    """

    score: Float32[np.ndarray, "h w"]
    red: Bool[np.ndarray, "h w"]
    unseen: Bool[np.ndarray, "h w"]
    unfixable: Bool[np.ndarray, "h w"]

    @property
    def marked(self) -> Bool[np.ndarray, "h w"]:
        """What asks for a view: red or never seen."""
        return self.red | self.unseen


class Judge:
    """Some views, and what is said when a live picture is compared with them."""

    def __init__(self, options: Options = DEFAULT, views: Sequence[CapturedView] = ()) -> None:
        """Begin with views.

        Args:
            options: The method's; the paper's rule is always that of the paper.
            views: Built by the same options.
        """
        self.options = options
        self._model = Reconstruction(options)
        self._rendered: tuple[Camera, Rendering] | None = None
        for view in views:
            self.capture(view)

    def capture(self, view: CapturedView) -> None:
        """Add a view."""
        self._model.views.append(view)
        self._rendered = None

    def render(self, camera: Camera) -> Rendering:
        """Render what the views show from a camera; asked again for the same one, it is there."""
        if self._rendered is None or self._rendered[0] is not camera:
            self._rendered = camera, self._model.light_field.render(camera)
        return self._rendered[1]

    def render_strips(self, camera: Camera, strips: Sequence[Camera]) -> list[Rendering]:
        """Render parts of a camera's picture, all from the views that are chosen for the whole."""
        field = self._model.light_field
        neighbours = field.choose_views(camera)
        return [field.render(strip, neighbours=neighbours) for strip in strips]

    def compare(
        self,
        live: UInt8[np.ndarray, "h w 3"],
        told: Camera,
        *,
        depth_m: Float32[np.ndarray, "dh dw"] | None = None,
        change: Change | None = None,
        corrects: bool = True,
    ) -> Mapping[RuleName, Judgement]:
        """Compare a live picture with the views, by both rules.

        Args:
            live: At the working size.
            told: The camera as the device reports it; the paper's rule has no other.
            depth_m: The live depth of the device, where it has a sensor.
            change: Puts a fault into the rendering.
            corrects: Whether the method may correct the pose; by the rendering without the fault.
        """
        rendering = self.render(told)
        here = rendering if change is None else change(rendering)
        if corrects and change is None:
            ours = self._model.compare(live, told, depth_m=depth_m).errors
        else:
            camera = self.corrected(live, told) if corrects else None
            ours = self._compared(live, camera or told, depth_m, change)
        return {"ours": _of_ours(ours), "paper": _of_paper(compare_with(PAPER, here, live))}

    def _compared(
        self,
        live: UInt8[np.ndarray, "h w 3"],
        camera: Camera,
        depth_m: Float32[np.ndarray, "dh dw"] | None,
        change: Change | None,
    ) -> ErrorMap:
        """Compare as the method does at a pose that it takes as it is."""
        field = self._model.light_field
        rendering = field.render(camera)
        if change is not None:
            rendering = change(rendering)
        return field.errors_of(rendering, live, camera, depth_m=depth_m)

    def corrected(self, live: UInt8[np.ndarray, "h w 3"], told: Camera) -> Camera | None:
        """Return where the picture was taken by the method's own judgement; None if it has none."""
        if not self.options.align_poses:
            return None
        blended = replace(self._model.light_field, options=replace(self.options, filling_views=0))
        alignment = refine(blended.render, told, live)
        return alignment.camera if alignment.ok else None

    def unseen(self, camera: Camera) -> Bool[np.ndarray, "h w"]:
        """Return what the method calls never seen without a live depth."""
        memory = self._model.light_field.memory
        if memory is None:
            return self.render(camera).alpha < MIN_ALPHA
        return memory.look(camera).unseen_at(*camera.pinhole.size_px)

    def paper_unseen(self, camera: Camera) -> Bool[np.ndarray, "h w"]:
        """Return what the paper's blend of three views leaves empty."""
        mpis = tuple(view.mpi for view in self._model.views)
        return LightField(mpis, PAPER).render(camera).alpha < MIN_ALPHA


def _of_ours(errors: ErrorMap) -> Judgement:
    score = np.where(errors.unseen | errors.unfixable, np.float32(0), errors.error)
    return Judgement(score, errors.wrong, errors.unseen, errors.unfixable)


def _of_paper(errors: ErrorMap) -> Judgement:
    nowhere = np.zeros_like(errors.peaked)
    return Judgement(errors.error, errors.peaked, nowhere, nowhere)
