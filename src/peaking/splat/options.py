"""How to train, as one field per choice, named as in gsplat where gsplat has the same choice."""

from __future__ import annotations

from dataclasses import dataclass, field

from peaking.splat.rendering import CutOffs


@dataclass(frozen=True)
class SplatOptions:
    """How to train; learning rates are Adam's, per step.

    The learning rates are about ten times those of Kerbl et al., who take 30,000 steps instead of
    2000.
    """

    iterations: int = 2000
    """Training steps; each uses one picture."""
    seed: int = 0
    """Seed of the order of pictures and of the centres of split Gaussians."""
    max_init_points: int = 12000
    """Points to start from, at most."""
    max_gaussians: int = 60000
    """Gaussians at most; bounds time and memory."""
    sh_degree: int = 1
    """Degree of the spherical harmonics: 0 (no view dependence) or 1."""
    init_opacity: float = 0.4
    init_scale: float = 0.6
    """Times the distance to the nearest points."""
    half_size_share: float = 0.4
    """Share of the steps, from the start, that use pictures of half the width and height."""
    means_lr: float = 2e-3
    """Times the scene scale; falls exponentially to a hundredth."""
    scales_lr: float = 3e-2
    quats_lr: float = 1e-2
    opacities_lr: float = 5e-2
    sh0_lr: float = 1.5e-2
    shn_lr: float = 3e-3
    """Of the coefficients of degree 1."""
    lr_decay_start_share: float = 0.5
    """Share of the steps after which the other learning rates fall exponentially too."""
    lr_decay_to: float = 0.2
    """What is left of them at the end."""
    refine_every: int = 100
    """Steps between two refinements (duplicate, split, prune)."""
    refine_start_share: float = 0.1
    refine_stop_share: float = 0.8
    """Shares of the steps between which Gaussians are refined."""
    grow_grad2d: float = 4e-4
    """Mean gradient by the projected centre, in half pictures, above which a Gaussian grows."""
    grow_scale3d: float = 0.01
    """Times the scene scale: larger Gaussians are split, smaller ones duplicated."""
    prune_opacity: float = 0.005
    """Gaussians below this opacity are removed."""
    cut_offs: CutOffs = field(default_factory=CutOffs)

    def __post_init__(self) -> None:
        for name in ("iterations", "max_init_points", "max_gaussians"):
            if getattr(self, name) < 1:
                raise ValueError(f"need {name} >= 1, got {getattr(self, name)}")
        if self.sh_degree not in (0, 1):
            raise ValueError(f"need an sh_degree of 0 or 1, got {self.sh_degree}")
        if not (0 <= self.half_size_share <= 1 and 0 <= self.lr_decay_start_share < 1):
            raise ValueError("need 0 <= half_size_share <= 1 and 0 <= lr_decay_start_share < 1")
        if not (0 < self.init_opacity < 1 and self.init_scale > 0 and self.refine_every > 0):
            raise ValueError("need 0 < init_opacity < 1, init_scale > 0 and refine_every > 0")
