"""Three ways to photograph.

How they behave was written down and committed before guides were first compared, and is not tuned.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

TemperamentName = Literal["calm", "hasty", "dreamy"]


@dataclass(frozen=True)
class Temperament:
    """How somebody walks, holds the phone and heeds the screen."""

    speed_m_per_s: float
    """While walking."""
    tremor_m: float
    """Deviation of the hand's place."""
    tremor_rad: float
    """Deviation of its direction."""
    reaction_s: float
    """What is seen on the screen moves them so much later."""
    follows: float
    """How much of the way they turn towards red, and how much they slow down for it, 0…1."""
    misses: float
    """How often what they should have seen is not seen for a while, 0…1."""
    slips_per_s: float
    """How often they press for no reason."""
    pause_s: float
    """Between two photos, at least."""
    sloppiness: float
    """How far from a target they press: deviation, in parts of what is near enough."""


TEMPERAMENTS: Mapping[TemperamentName, Temperament] = {
    "calm": Temperament(
        speed_m_per_s=0.22,
        tremor_m=0.0012,
        tremor_rad=0.004,
        reaction_s=0.4,
        follows=0.9,
        misses=0.08,
        slips_per_s=0.005,
        pause_s=1.2,
        sloppiness=0.4,
    ),
    "hasty": Temperament(
        speed_m_per_s=0.5,
        tremor_m=0.003,
        tremor_rad=0.009,
        reaction_s=0.3,
        follows=0.5,
        misses=0.2,
        slips_per_s=0.02,
        pause_s=0.7,
        sloppiness=0.8,
    ),
    "dreamy": Temperament(
        speed_m_per_s=0.32,
        tremor_m=0.002,
        tremor_rad=0.006,
        reaction_s=0.8,
        follows=0.7,
        misses=0.35,
        slips_per_s=0.01,
        pause_s=1.0,
        sloppiness=0.6,
    ),
}
