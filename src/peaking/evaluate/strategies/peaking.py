"""Our default: shoot all the time, and let go of the view that is least missed.

The plain threshold shoots where it is red now, and cannot know whether the next view, taken for
another reason, would have shown the same. Where it is hard it shoots every frame, and where it is
easy none, so that its views are worse than evenly spread ones on average. Here every frame is tried
as a view, and only so many are held: the one that goes is the one without which the frames seen so
far would be shown least worse by the others. So the error decides, and coverage comes by itself,
since a frame that nothing shows is wrong altogether. Nothing of the future is known; neither the
length of the path nor a threshold has to be.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float32

from peaking.evaluate.scene import MOST_MPIS, Scene
from peaking.frame import working_size_px
from peaking.nearest import CLOSE_M, fading_weights, overlap_costs_m
from peaking.render import render
from peaking.render.blend import blend

HELD_PER_VIEW = 4
"""Views held while shooting, per view wanted; the rest goes at the end. With 2 the mean PSNR was up
to 0.5 dB lower, with 8 it was the same (docs/evaluation.md)."""

SMALLER = 16
"""The errors are looked at with so many times fewer pixels than the views are made with."""

EXPONENT = 0.25
"""What a frame's mean squared error is raised to before it is summed. Towards 0 the mean PSNR over
frames counts, towards 1 the worst frames alone."""

SAME_PLACE_M = 2 * CLOSE_M
"""Cost (distance over overlap) up to which a view is from where another was: who stands still takes
one. Each would else be missed by the other, which no third one shows as well."""

ALL_WRONG = 0.3
"""Mean squared error of a frame that no view shows."""

MOST_RENDERINGS = 1500
"""Renderings that are kept; at the paper's size they take 0.3 GB."""


def peaking(
    scene: Scene, candidates: Sequence[int], count: int, rng: np.random.Generator
) -> list[int]:
    """Walk the candidates, hold at most `HELD_PER_VIEW` times `count`, and keep `count`."""
    keeper = Keeper(scene)
    for i in candidates:
        keeper.offer(i)
        if len(keeper.held) > HELD_PER_VIEW * count:
            keeper.let_go()
    while len(keeper.held) > count:
        keeper.let_go()
    keeper.forget()
    return sorted(keeper.held)


class Keeper:
    """The views that are held, and how well they show every frame seen so far.

    A frame is never shown by its own MPI: that it could show itself says nothing about its
    neighbours.
    """

    def __init__(self, scene: Scene) -> None:
        """Begin without a view."""
        options = scene.options
        size_px = working_size_px(
            *scene.recording.cameras[0].pinhole.size_px, pixels=options.pixels
        )
        pixels = max(256, size_px[0] * size_px[1] // SMALLER)
        # So many times more of the small MPIs are in memory: all of them, as a rule.
        self._small = scene.smaller(pixels, most_mpis=SMALLER * MOST_MPIS)
        self._rendered = lru_cache(maxsize=MOST_RENDERINGS)(self._render)
        self._cost_m: dict[int, Float[np.ndarray, "n"]] = {}
        self._known: dict[tuple[object, ...], float] = {}
        self._error: dict[int, float] = {}
        self._shown_by: dict[int, frozenset[int]] = {}
        self._shows: dict[int, set[int]] = {}
        self._missed: dict[int, float] = {}
        self.held: list[int] = []

    def offer(self, index: int) -> None:
        """See a frame, and hold it unless a view from the same place is held."""
        depth_m = float(np.median(self._small.mpi(index).plane_depths_m))
        camera = self._small.cameras[index]
        self._cost_m[index] = overlap_costs_m(self._small.cameras, camera, depth_m)
        self._shown_by[index] = frozenset()
        new = not self.held or self._cost_m[index][self.held].min() > SAME_PLACE_M
        if new:
            self.held.append(index)
            self._shows[index] = set()
        changed = [
            t for t in self._cost_m if t == index or index in self._neighbours(t, self.held)[0]
        ]
        self._look_again(changed, also=set(self.held[-1:]) if new else set())

    def let_go(self) -> None:
        """Give up the view that is least missed."""
        least = min(self.held, key=lambda i: self._missed[i])
        self.held.remove(least)
        del self._missed[least]
        self._look_again(list(self._shows[least]), also=set())
        del self._shows[least]

    def forget(self) -> None:
        """Give up the renderings that are kept; they take the most room."""
        self._rendered.cache_clear()

    def _look_again(self, frames: Sequence[int], *, also: set[int]) -> None:
        """Update the errors of frames, and how much the views that show them would be missed."""
        touched = set(also)
        for t in frames:
            touched |= self._shown_by[t]
            for i in self._shown_by[t]:
                self._shows[i].discard(t)
            self._error[t], self._shown_by[t] = self._look(t, self.held)
            for i in self._shown_by[t]:
                self._shows[i].add(t)
            touched |= self._shown_by[t]
        for i in touched & set(self.held):
            without = [k for k in self.held if k != i]
            self._missed[i] = sum(
                self._look(t, without)[0] ** EXPONENT - self._error[t] ** EXPONENT
                for t in self._shows[i]
            )

    def _neighbours(
        self, target: int, views: Sequence[int]
    ) -> tuple[list[int], Float[np.ndarray, "k"]]:
        """Return the views that show a frame, and their weights."""
        others = [i for i in views if i != target]
        if not others:
            return [], np.zeros(0)
        best, weights = fading_weights(self._cost_m[target][others], self._small.options.neighbours)
        return [others[k] for k in best], weights

    def _look(self, target: int, views: Sequence[int]) -> tuple[float, frozenset[int]]:
        """Return the mean squared error of a frame as some views show it, and which do."""
        neighbours, weights = self._neighbours(target, views)
        if not neighbours:
            return ALL_WRONG, frozenset()
        key = (target, *neighbours, *np.round(weights, 2).tolist())
        if key not in self._known:
            rgba = np.stack([self._rendered(i, target) for i in neighbours])
            nowhere = np.zeros(rgba.shape[:3], np.float32)
            view = blend(rgba, nowhere, weights.tolist(), opacity=self._small.options.opacity)
            photo = self._small.frame(target).rgb.astype(np.float32) / np.float32(255)
            wrong = np.clip(view.rgba[..., :3], 0, 1) - photo
            self._known[key] = float(np.mean(wrong * wrong))
        return self._known[key], frozenset(neighbours)

    def _render(self, view: int, target: int) -> Float32[np.ndarray, "h w 4"]:
        return render(self._small.mpi(view), self._small.cameras[target]).rgba
