"""The frames a policy has seen, and what each costs to be shown by each of the views it holds."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Camera
from peaking.view_weights import (
    CLOSE_M,
    costs_m,
    fading_weights,
    overlap_costs_m,
    overlap_points_m,
)

SAME_PLACE_M = 2 * CLOSE_M
"""Cost (distance over overlap) up to which a view is from where another was: who stands still takes
one. Each would else be missed by the other, which no third one shows as well."""


class SeenFrames:
    """Which frames were seen, which of them are held as views, and who shows whom."""

    def __init__(self, most: int) -> None:
        """Begin without a frame; `most` are remembered at once, at most."""
        self.held: list[int] = []
        self._numbers: list[int] = []
        self._cameras: list[Camera] = []
        self._depths_m: list[float] = []
        self._points_m: list[Float64[np.ndarray, "n 3"]] = []
        self._row: dict[int, int] = {}
        self._cost_m = np.full((most, most), np.inf)
        self._held_rows = np.zeros(0, dtype=np.int64)

    def __len__(self) -> int:
        return len(self._numbers)

    def add(self, number: int, camera: Camera, depth_m: float) -> None:
        """Add a frame, and what it costs to be shown by the views held."""
        row = len(self._numbers)
        self._row[number] = row
        self._numbers.append(number)
        self._cameras.append(camera)
        self._points_m.append(overlap_points_m(camera, depth_m))
        if self.held:
            views = [self._cameras[i] for i in self._held_rows]
            self._cost_m[row, self._held_rows] = overlap_costs_m(views, camera, depth_m)

    def hold(self, number: int) -> None:
        """Let a frame be a view, and find out what all frames cost to be shown by it."""
        row = self._row[number]
        camera = self._cameras[row]
        positions_m = np.array([seen.position_m for seen in self._cameras])
        distance_m = np.linalg.norm(positions_m - camera.position_m, axis=1)
        overlap = camera.sees(np.array(self._points_m)).mean(axis=-1)
        self._cost_m[: len(self), row] = costs_m(distance_m, overlap)
        self.held.append(number)
        self._find_held()

    def release(self, number: int) -> None:
        """Let a view be a frame again."""
        self.held.remove(number)
        self._find_held()

    def from_same_place(self, number: int) -> int | None:
        """Return the view held that was taken where a frame was; None if none was."""
        if not self.held:
            return None
        cost_m = self._cost_m[self._row[number], self._held_rows]
        nearest = int(np.argmin(cost_m))
        return self.held[nearest] if cost_m[nearest] <= SAME_PLACE_M else None

    def neighbours(
        self, target: int, count: int, *, without: int | None = None
    ) -> tuple[tuple[int, ...], Float64[np.ndarray, "k"]]:
        """Return which views show a frame, which is none of them, and their weights."""
        others = [i for i in self.held if i not in (target, without)]
        if not others:
            return (), np.zeros(0)
        rows = [self._row[i] for i in others]
        best, weights = fading_weights(self._cost_m[self._row[target], rows], count)
        return tuple(others[int(k)] for k in best.tolist()), weights

    def shown_by(self, view: int, count: int) -> set[int]:
        """Return the frames that a view held is among the nearest of."""
        cost_m = self._cost_m[: len(self), self._held_rows].copy()
        cost_m[self._held_rows, np.arange(len(self.held))] = np.inf  # none shows itself
        column = self.held.index(view)
        if len(self.held) > count:
            limit_m = np.partition(cost_m, count - 1, axis=1)[:, count - 1]
        else:
            limit_m = np.full(len(self), np.inf)
        near = (cost_m[:, column] <= limit_m) & np.isfinite(cost_m[:, column])
        return {self._numbers[row] for row in np.flatnonzero(near)}

    def remove_closest(self) -> int:
        """Remove the frame, no view and not the last, whose neighbours in time are the closest."""
        rows = [r for r in range(1, len(self) - 1) if self._numbers[r] not in set(self.held)]
        gone = min(rows, key=lambda r: self._numbers[r + 1] - self._numbers[r - 1])
        number = self._numbers.pop(gone)
        del self._cameras[gone], self._points_m[gone]
        kept = np.delete(np.arange(len(self._cost_m)), gone)
        self._cost_m[:-1, :-1] = self._cost_m[np.ix_(kept, kept)]
        self._cost_m[-1], self._cost_m[:, -1] = np.inf, np.inf
        self._row = {number: row for row, number in enumerate(self._numbers)}
        self._find_held()
        return number

    def _find_held(self) -> None:
        self._held_rows = np.array([self._row[i] for i in self.held], dtype=np.int64)
