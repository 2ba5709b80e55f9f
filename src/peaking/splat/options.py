"""How to train: every choice of the method as one field."""

from __future__ import annotations

from dataclasses import dataclass, field

from peaking.splat.view import CutOffs


@dataclass(frozen=True)
class SplatOptions:
    """How to train; rates are Adam's, per step.

    The rates are about ten times those of Kerbl et al., who take 30 000 steps instead of 2000.
    """

    iterations: int = 2000
    """Pictures looked at."""
    seed: int = 0
    """Of the order of pictures and of where Gaussians split."""
    seed_count: int = 12000
    """Points to start from, at most."""
    max_count: int = 60000
    """Gaussians at most; bounds time and memory."""
    sh_degree: int = 1
    """0: the same colour from everywhere; 1: brighter from one side."""
    first_opacity: float = 0.4
    first_size: float = 0.6
    """In distances to the nearest points."""
    coarse_share: float = 0.4
    """Share of the steps at half the size."""
    position_rate: float = 2e-3
    """In extents of the cameras; falls exponentially to a hundredth."""
    scale_rate: float = 3e-2
    rotation_rate: float = 1e-2
    opacity_rate: float = 5e-2
    colour_rate: float = 1.5e-2
    direction_rate: float = 3e-3
    settle_from: float = 0.5
    """Share of the steps after which all other rates fall exponentially too."""
    settle_to: float = 0.2
    """What is left of them at the end."""
    densify_every: int = 100
    densify_from: float = 0.1
    densify_until: float = 0.8
    """Shares of the steps."""
    densify_gradient: float = 4e-4
    """Mean gradient by the position (in half pictures) above which one becomes two."""
    split_size: float = 0.01
    """In extents of the cameras: larger ones are split, smaller ones are doubled."""
    prune_opacity: float = 0.005
    cut_offs: CutOffs = field(default_factory=CutOffs)

    def __post_init__(self) -> None:
        if self.iterations < 1 or self.seed_count < 1 or self.max_count < 1:
            raise ValueError("need iterations, seed_count and max_count of at least 1")
        if self.sh_degree not in (0, 1):
            raise ValueError(f"need an sh_degree of 0 or 1, got {self.sh_degree}")
        if not (0 <= self.coarse_share <= 1 and 0 <= self.settle_from < 1):
            raise ValueError("need 0 <= coarse_share <= 1 and 0 <= settle_from < 1")
        if not (0 < self.first_opacity < 1 and self.first_size > 0 and self.densify_every > 0):
            raise ValueError("need 0 < first_opacity < 1, first_size > 0 and densify_every > 0")
