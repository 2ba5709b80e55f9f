"""The automatic shutter: takes a frame where a view is worth it, and lets go of most in the end.

What the capture page does by itself. Every frame that is wrong or new by a quarter of the paper's
threshold is taken; of those, `BackwardElimination` holds the ones that are missed most. So it sees
fewer frames than backward elimination over all of them, and needs less of a phone: a picture is
kept only where something is gained.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from peaking.options import PAPER_PEAKED_SHARE, Options
from peaking.selection.backward_elimination import HELD_PER_VIEW, BackwardElimination
from peaking.selection.policy import Candidate, Decision, Worth

WORTH_SHARE = PAPER_PEAKED_SHARE / HELD_PER_VIEW
"""A frame is taken where more than this of it is red: the paper's mean gives about as many views as
are wanted, and so many times more are held (`WORTH_SHARE` in web/src/capture/auto_shutter.ts)."""


class AutoShutter:
    """Takes what is worth it, and in the end holds those wanted."""

    def __init__(
        self, num_views: int | None, options: Options, *, worth_share: float = WORTH_SHARE
    ) -> None:
        """Begin without a view.

        Args:
            num_views: How many are wanted in the end; None: as many as the curve says are enough.
            options: How views are built and blended.
            worth_share: A frame is taken where more than this of it is red, 0…1.

        Raises:
            ValueError: `num_views` < 1.
        """
        self._held = BackwardElimination(num_views, options)
        self._worth_share = worth_share

    @property
    def views(self) -> Sequence[int]:
        """Numbers of the views that are held now."""
        return self._held.views

    @property
    def worth(self) -> Mapping[int, Worth]:
        """What each view held is worth, judged by the frames taken."""
        return self._held.worth

    def observe(self, candidate: Candidate) -> Decision:
        """Take the frame if a view from there is worth it; drop one view too many."""
        views = self._held.views
        if views:
            share = candidate.peaked_share(views)
            if share <= self._worth_share:
                return Decision(False, f"{share:.2%} red: nothing new")
        return self._held.observe(candidate)

    def finish(self) -> Decision:
        """Drop the least missed until as many are held as are wanted."""
        return self._held.finish()
