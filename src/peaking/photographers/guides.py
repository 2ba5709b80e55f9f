"""What the screen tells a photographer, and who presses the shutter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, get_args

from peaking.options import DEFAULT, PAPER, Options
from peaking.photographers.tasks import HEIGHT_PX, WIDTH_PX

GuideName = Literal["interval", "llff", "threshold", "red", "auto", "next"]
GUIDE_NAMES: tuple[GuideName, ...] = get_args(GuideName)

REFERENCE: GuideName = "auto"
"""The guide that the others are compared with."""


@dataclass(frozen=True)
class GuideKind:
    """How a guide works.

    Attributes:
        description: In a few words.
        screen: What red is computed by; None: the screen shows none.
        per_budget: A photographer who knows another limit of photos behaves otherwise; else fewer
            photos are the first of more, or chosen among all.
    """

    description: str
    screen: Options | None = None
    per_budget: bool = False


def _sized(options: Options) -> Options:
    return replace(options, pixels=WIDTH_PX * HEIGHT_PX)


AUTOMATIC: frozenset[GuideName] = frozenset({"auto", "next"})
"""Those whose shutter is automatic."""

VIEWS = _sized(DEFAULT)
"""How the photos of every guide are made into MPIs that are scored."""

GUIDES: Mapping[GuideName, GuideKind] = {
    "interval": GuideKind("no guide, an interval shutter", per_budget=True),
    "llff": GuideKind("LLFF's grids, with an arrow to the next target", per_budget=True),
    "threshold": GuideKind("the paper's red; a press at each 4.28 %", _sized(PAPER)),
    "red": GuideKind("our red, by hand", _sized(DEFAULT), per_budget=True),
    "auto": GuideKind("our red, automatic shutter, the best are kept", _sized(DEFAULT)),
    "next": GuideKind("the same, with a frame to step into next", _sized(DEFAULT)),
}
