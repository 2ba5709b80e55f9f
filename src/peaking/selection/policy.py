"""What a policy is: it sees frames one at a time, and says which become views.

A policy that goes by what it has seen so far can be used while somebody captures. A `Chooser` needs
the whole path beforehand; it serves to compare with, and to thin out what was taken.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.mpi import Mpi


@dataclass(frozen=True)
class Decision:
    """What a policy says to a frame.

    Attributes:
        take: Whether the frame becomes a view.
        reason: Why, in a few words.
        dropped: Numbers of views taken before that are given up; all others are kept.
    """

    take: bool
    reason: str
    dropped: tuple[int, ...] = ()


Why = Literal["shows what no other does", "wrong without it", "sharper than its neighbours"]
"""Why a view is kept."""

ALONE: Why = "shows what no other does"
WRONG: Why = "wrong without it"
SHARPER: Why = "sharper than its neighbours"


@dataclass(frozen=True)
class Worth:
    """What a view is worth.

    Attributes:
        psnr_db: How much worse the frames seen are shown without it, in decibels of their mean
            PSNR; about 0 or less where others show the same.
        why: Why it is kept.
    """

    psnr_db: float
    why: Why


@dataclass(frozen=True)
class CurvePoint:
    """How well a number of views shows the frames seen.

    Attributes:
        num_views: So many.
        psnr_db: Mean PSNR of the frames seen, each shown by other views than itself; of those that
            are views, at least 30.
    """

    num_views: int
    psnr_db: float


@runtime_checkable
class Candidate(Protocol):
    """A frame that may become a view, looked at only as far as a policy asks."""

    @property
    def number(self) -> int:
        """What decisions call it; numbers rise along the path."""
        ...

    @property
    def camera(self) -> Camera:
        """Its camera at the working size."""
        ...

    @property
    def accepted(self) -> bool:
        """Whether it can become a view: its depth is known, or can be estimated."""
        ...

    def sharpness(self) -> float:
        """How sharp it is (`peaking.selection.blur.sharpness`), at the working size."""
        ...

    def frame(self, pixels: int) -> Frame:
        """Return the picture and its camera with about so many pixels."""
        ...

    def mpi(self, pixels: int) -> Mpi:
        """Return its MPI with about so many pixels.

        Raises:
            PeakingError: It cannot become a view.
        """
        ...

    def peaked_share(self, views: Sequence[int]) -> float:
        """Return how much of it is red, 0…1, where these views show it."""
        ...


@runtime_checkable
class Policy(Protocol):
    """Chooses views, one frame at a time."""

    @property
    def views(self) -> Sequence[int]:
        """Numbers of the views that are held now, in the order of the path."""
        ...

    @property
    def worth(self) -> Mapping[int, Worth]:
        """What the views held are worth, by number; nothing where the policy does not know."""
        ...

    def observe(self, candidate: Candidate) -> Decision:
        """Look at the next frame of the path, and decide."""
        ...

    def finish(self) -> Decision:
        """Decide what is dropped at the end, after the last frame."""
        ...


@dataclass(frozen=True)
class CandidatePath:
    """A whole path, for what needs to know it beforehand.

    Attributes:
        candidates: In the order of capture.
        scene_depth_m: How far away things typically are.
    """

    candidates: Sequence[Candidate]
    scene_depth_m: float

    def __len__(self) -> int:
        return len(self.candidates)

    @property
    def cameras(self) -> list[Camera]:
        """The cameras, in the order of capture."""
        return [candidate.camera for candidate in self.candidates]

    def numbers(self, places: Sequence[int]) -> list[int]:
        """Return the numbers of the candidates at these places of the path."""
        return [self.candidates[place].number for place in places]


Chooser = Callable[[CandidatePath, int, np.random.Generator], list[int]]
"""Whole path, how many views, random numbers → numbers of the chosen, in the order of the path."""


class Chosen:
    """The policy of somebody who knows beforehand which frames to take."""

    def __init__(self, reasons: dict[int, str]) -> None:
        """Take these frames, for these reasons."""
        self._reasons = reasons
        self._views: list[int] = []

    @property
    def views(self) -> Sequence[int]:
        """Numbers of the views taken so far."""
        return tuple(self._views)

    @property
    def worth(self) -> Mapping[int, Worth]:
        """Nothing is known of it."""
        return {}

    def observe(self, candidate: Candidate) -> Decision:
        """Take the frame if it was chosen."""
        reason = self._reasons.get(candidate.number)
        if reason is None:
            return Decision(False, "not chosen")
        if not candidate.accepted:
            return Decision(False, "no depth")
        self._views.append(candidate.number)
        return Decision(True, reason)

    def finish(self) -> Decision:
        """Drop nothing."""
        return Decision(False, "the end of the path")


def walk(policy: Policy, candidates: Sequence[Candidate]) -> list[int]:
    """Let a policy see all candidates; return the numbers of the views it holds at the end."""
    for candidate in candidates:
        policy.observe(candidate)
    policy.finish()
    return sorted(policy.views)
