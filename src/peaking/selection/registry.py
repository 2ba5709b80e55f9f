"""The policies by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from peaking.options import DEFAULT, PAPER_PEAKED_SHARE, Options, PolicyName
from peaking.selection.all_frames import choose_all
from peaking.selection.auto_shutter import AutoShutter
from peaking.selection.backward_elimination import BackwardElimination
from peaking.selection.coverage import choose_by_coverage
from peaking.selection.every_nth import choose_every_nth
from peaking.selection.farthest import choose_farthest
from peaking.selection.policy import CandidatePath, Chooser, Chosen, Policy, walk
from peaking.selection.random_subset import choose_randomly
from peaking.selection.sharpest import choose_sharpest
from peaking.selection.spacing import Spacing, choose_by_spacing
from peaking.selection.threshold import Threshold, choose_by_threshold
from peaking.selection.uniform import choose_uniform


class NeedsWholePath(ValueError):
    """A policy that needs the whole path was asked for without it."""


@dataclass(frozen=True)
class SelectionOptions:
    """Which policy chooses views, and by what."""

    policy: PolicyName = "threshold"
    """Which one."""
    num_views: int | None = None
    """How many views; `threshold` and `plenoptic` need the whole path to reach a number. `peaking`
    needs none: it keeps as many as are worth it."""
    threshold_share: float = PAPER_PEAKED_SHARE
    """Of `threshold` without a number: the peaked share, 0…1, above which a frame is taken."""
    spacing_m: float | None = None
    """Of `plenoptic` without a number: metres between views."""
    uniform_metres_per_rad: float = 0.0
    """Of `uniform`: what a rotation counts as, in metres of path; 0 leaves rotations out."""
    seed: int = 0
    """Of `random`."""

    def __post_init__(self) -> None:
        if self.policy not in POLICIES:
            raise ValueError(f"need a policy among {', '.join(POLICIES)}, got {self.policy}")
        if not 0 <= self.threshold_share < 1:
            raise ValueError(f"need 0 <= threshold_share < 1, got {self.threshold_share}")
        if self.num_views is not None and self.num_views < 1:
            raise ValueError(f"need num_views >= 1, got {self.num_views}")
        if self.seed < 0:
            raise ValueError(f"need seed >= 0, got {self.seed}")
        kind = POLICIES[self.policy]
        alone = kind.all_frames or (kind.create is not None and kind.create(self, DEFAULT))
        if self.num_views is None and not alone:
            other = " or a spacing" if self.policy == "plenoptic" else ""
            raise ValueError(f"need a number of views{other} for the policy {self.policy}")


Create = Callable[[SelectionOptions, Options], Policy | None]
"""Makes a policy that can be used while somebody captures; None without what it goes by."""


@dataclass(frozen=True)
class PolicyKind:
    """What is known of a policy before it is used.

    Attributes:
        choose: Chooses a number of views from a whole path.
        create: Makes the policy for use while somebody captures; None where that cannot be.
        needs_depth: It makes MPIs, so frames without depth are no candidates.
        is_random: Its choice depends on the seed.
        all_frames: It takes all candidates, however many are asked for.
    """

    choose: Chooser | None = None
    create: Create | None = None
    needs_depth: bool = False
    is_random: bool = False
    all_frames: bool = False

    @property
    def needs_whole_path(self) -> bool:
        """Whether it can only be used when the whole path is known."""
        return self.create is None


def _backward_elimination(selection: SelectionOptions, options: Options) -> Policy:
    return BackwardElimination(selection.num_views, options)


def _auto_shutter(selection: SelectionOptions, options: Options) -> Policy:
    return AutoShutter(selection.num_views, options)


def _threshold(selection: SelectionOptions, options: Options) -> Policy | None:
    return Threshold(selection.threshold_share) if selection.num_views is None else None


def _spacing(selection: SelectionOptions, options: Options) -> Policy | None:
    return (
        None
        if selection.spacing_m is None or selection.num_views is not None
        else Spacing(selection.spacing_m)
    )


POLICIES: Mapping[PolicyName, PolicyKind] = {
    "peaking": PolicyKind(create=_backward_elimination, needs_depth=True),
    "auto-shutter": PolicyKind(create=_auto_shutter, needs_depth=True),
    "threshold": PolicyKind(create=_threshold, choose=choose_by_threshold, needs_depth=True),
    "uniform": PolicyKind(choose=choose_uniform),
    "every-nth": PolicyKind(choose=choose_every_nth),
    "sharpest": PolicyKind(choose=choose_sharpest),
    "farthest": PolicyKind(choose=choose_farthest),
    "coverage": PolicyKind(choose=choose_by_coverage),
    "plenoptic": PolicyKind(create=_spacing, choose=choose_by_spacing),
    "random": PolicyKind(choose=choose_randomly, is_random=True),
    "all": PolicyKind(choose=choose_all, all_frames=True),
}
"""`peaking` is the product's own, greedy backward elimination, and `auto-shutter` the same over the
frames that the capture page takes by itself; `threshold` is the paper's rule; `plenoptic` is LLFF's
spacing. The others need the whole path."""


def create_policy(
    selection: SelectionOptions, options: Options = DEFAULT, *, path: CandidatePath | None = None
) -> Policy:
    """Return a policy, ready to observe the first frame.

    Args:
        selection: Which policy, and by what it goes.
        options: How views are built and shown.
        path: All candidates, where they are known: policies that need the whole path choose now.

    Raises:
        NeedsWholePath: The policy needs the whole path, which is not given.
        ValueError: There are fewer candidates than views are asked for.
    """
    kind = POLICIES[selection.policy]
    policy = None if kind.create is None else kind.create(selection, options)
    if policy is not None:
        return policy
    if path is None or kind.choose is None:
        raise NeedsWholePath(f"need the whole path for the policy {selection.policy}")
    count = len(path) if selection.num_views is None else selection.num_views
    if count > len(path):
        raise ValueError(f"need at least {count} candidates for {count} views, got {len(path)}")
    choose = kind.choose
    if selection.policy == "uniform":
        choose = partial(choose_uniform, metres_per_rad=selection.uniform_metres_per_rad)
    rng = np.random.default_rng([selection.seed, count])
    return Chosen(dict.fromkeys(choose(path, count, rng), selection.policy))


def select_from(
    path: CandidatePath, selection: SelectionOptions, options: Options = DEFAULT
) -> list[int]:
    """Return the numbers of the views that a policy chooses from a path, in its order.

    Raises:
        ValueError: What the policy goes by is missing.
    """
    return walk(create_policy(selection, options, path=path), path.candidates)
