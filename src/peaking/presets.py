"""Every choice of the method as one named option, and the two presets.

`paper` is Yasunaga, Saito & Mori (ICIP 2025) to the letter, with the generator as an option of its
own (theirs needs weights). `default` is our best. Each difference between the two can be switched
alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from peaking.align import Method
from peaking.depth.estimator import DepthRuntime
from peaking.frame import PAPER_PIXELS
from peaking.generate.by_name import Device, GeneratorName, Learned, Precision
from peaking.render.blend import Opacity

PresetName = Literal["default", "paper"]


@dataclass(frozen=True)
class Options:
    """The choices of the method."""

    pixels: int
    """Pixels of an MPI plane and of the view; the picture's aspect is kept."""
    generator: GeneratorName
    """Who makes the MPI."""
    num_planes: int
    """Planes of an MPI, D."""
    align: Method | Literal["off"]
    """How the planes are scaled to metric depth: mean or median of log disparities, or not."""
    neighbours: int
    """Views that are blended, K."""
    weights: Literal["paper", "overlap"]
    """How they are chosen and weighed: by distance alone, or with overlap and without jumps."""
    opacity: Opacity
    """How opaque a pixel is that only some views saw: weighted sum, or the largest."""
    error_threshold: float
    """L1 over RGB (0…3) above which a pixel is peaked, t."""
    shift_px: int
    """Misalignment in pixels that does not count as an error."""
    compensate_exposure: bool
    """Compare after equalising the exposure of the live picture and the view."""
    depth_model: str | None = None
    """Estimates the depth of frames without it: a folder, or a name of the Hugging Face hub."""
    depth_runtime: DepthRuntime = "pytorch"
    """What runs the depth model; OpenVINO is for processors."""
    checkpoint: Path | None = None
    """The generator's weights; None looks in the folder of checkpoints."""
    device: Device = "auto"
    """Where networks run."""
    precision: Precision = "float32"
    """Of the generator's convolutions."""

    def __post_init__(self) -> None:
        if self.pixels < 256:
            raise ValueError(f"need pixels >= 256, got {self.pixels}")
        if self.num_planes < 2:
            raise ValueError(f"need num_planes >= 2, got {self.num_planes}")
        if self.neighbours < 1:
            raise ValueError(f"need neighbours >= 1, got {self.neighbours}")
        if not 0 < self.error_threshold < 3:
            raise ValueError(f"need 0 < error_threshold < 3, got {self.error_threshold}")

    def as_dict(self) -> dict[str, object]:
        """Return the options as they are written into reports."""
        written = asdict(self)
        written["checkpoint"] = None if self.checkpoint is None else str(self.checkpoint)
        return written

    @property
    def learned(self) -> Learned:
        """What learned generators need."""
        return Learned(self.checkpoint, self.device, self.precision)


PAPER = Options(
    pixels=PAPER_PIXELS,
    generator="layered",
    num_planes=32,
    align="paper",
    neighbours=3,
    weights="paper",
    opacity="paper",
    error_threshold=0.4,
    shift_px=0,
    compensate_exposure=False,
)

DEFAULT = Options(
    pixels=PAPER_PIXELS,
    generator="layered",
    num_planes=32,
    align="robust",
    neighbours=4,
    weights="overlap",
    opacity="seen",
    error_threshold=0.4,
    shift_px=1,
    compensate_exposure=True,
)

PRESETS: Mapping[PresetName, Options] = {"default": DEFAULT, "paper": PAPER}
