"""Every choice of the method as one named option, and the two presets.

This is the only definition: the command line's flags (`commands/options.py`), what servers tell
their clients (`server/wire.py`) and what reports print follow from `Options`.

`paper` is Yasunaga, Saito & Mori (ICIP 2025) to the letter, with the generator as an option of its
own (theirs needs a checkpoint). `default` is our best. Each difference between the two can be
switched alone.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Literal, get_args

PresetName = Literal["default", "paper"]
GeneratorName = Literal["layered", "adampi"]
Align = Literal["paper", "robust", "off"]
ScaleMethod = Literal["paper", "robust"]
BlendWeights = Literal["paper", "overlap"]
Opacity = Literal["paper", "seen"]
Marks = Literal["paper", "apart"]
Device = Literal["auto", "cpu", "cuda"]
Precision = Literal["float32", "bfloat16", "float16"]
PolicyName = Literal[
    "peaking",
    "auto-shutter",
    "threshold",
    "uniform",
    "every-nth",
    "sharpest",
    "farthest",
    "coverage",
    "plenoptic",
    "random",
    "all",
]
"""Of view selection; `selection/registry.py` says what they are."""
POLICY_NAMES: tuple[PolicyName, ...] = get_args(PolicyName)
DepthRuntime = Literal["pytorch", "openvino", "openvino-bf16"]

PAPER_PIXELS = 294 * 639
"""Pixels of the paper's MPI; pictures of other aspects are resized to this many."""

PAPER_PEAKED_SHARE = 0.0428
"""Mean peaked share over all viewpoints and participants of the paper's study (section 4.2)."""

MIN_PIXELS = 256


@dataclass(frozen=True)
class Options:
    """The choices of the method."""

    pixels: int
    """Pixels of an MPI plane and of a rendering; the picture's aspect is kept."""
    generator: GeneratorName
    """Generator of the MPIs: `layered`, or the paper's `adampi`, which needs a checkpoint."""
    num_planes: int
    """Planes of an MPI, D."""
    align: Align
    """How planes are scaled to metric depth: mean or median of log disparities, or not."""
    neighbours: int
    """Views that are blended, K."""
    blend_weights: BlendWeights
    """How views are chosen and weighted: by distance alone, or by distance over overlap."""
    opacity: Opacity
    """Opacity of a pixel that only some views saw: the weighted sum, or the largest."""
    filling_views: int
    """Further views that fill what the blended ones leave empty, at most."""
    error_threshold: float
    """L1 over RGB, 0…3, above which a pixel is red, t."""
    shift_px: float
    """Misalignment in pixels that does not count as an error, 0…1; asked both ways."""
    compensate_exposure: bool
    """Equalise exposure, white balance and vignette before the pictures are compared."""
    marks: Marks
    """What is marked: all that differs in colour, or what is wrong and what was never seen."""
    align_poses: bool = False
    """Correct the pose of a live picture by what the rendering shows, before they are compared."""
    depth_model: str | None = None
    """Estimates the depth of frames without it: a folder, or a name of the Hugging Face hub."""
    depth_runtime: DepthRuntime = "pytorch"
    """What runs the depth model; `openvino` is faster on CPUs (an extra)."""
    checkpoint: Path | None = None
    """The generator's checkpoint; without one, the folder that `peaking checkpoints` names."""
    device: Device = "auto"
    """Where networks run; `auto` is CUDA where there is one."""
    precision: Precision = "float32"
    """Of the generator's convolutions; other than float32 on CUDA only."""

    def __post_init__(self) -> None:
        if self.pixels < MIN_PIXELS:
            raise ValueError(f"need pixels >= {MIN_PIXELS}, got {self.pixels}")
        if self.num_planes < 2:
            raise ValueError(f"need num_planes >= 2, got {self.num_planes}")
        if self.neighbours < 1:
            raise ValueError(f"need neighbours >= 1, got {self.neighbours}")
        if self.filling_views < 0:
            raise ValueError(f"need filling_views >= 0, got {self.filling_views}")
        if not 0 < self.error_threshold < 3:
            raise ValueError(f"need 0 < error_threshold < 3, got {self.error_threshold}")
        if not 0 <= self.shift_px <= 1:
            raise ValueError(f"need 0 <= shift_px <= 1, got {self.shift_px}")

    def as_dict(self) -> dict[str, object]:
        """Return the options as they are written into reports."""
        written = asdict(self)
        written["checkpoint"] = None if self.checkpoint is None else str(self.checkpoint)
        return written


MACHINE_OPTIONS = frozenset({"depth_runtime", "checkpoint", "device", "precision"})
"""Options that say how this machine computes, and are no business of a client."""

PAPER = Options(
    pixels=PAPER_PIXELS,
    generator="layered",
    num_planes=32,
    align="paper",
    neighbours=3,
    blend_weights="paper",
    opacity="paper",
    filling_views=0,
    error_threshold=0.4,
    shift_px=0.0,
    compensate_exposure=False,
    marks="paper",
)

DEFAULT = Options(
    pixels=PAPER_PIXELS,
    generator="layered",
    num_planes=32,
    align="robust",
    neighbours=4,
    blend_weights="overlap",
    opacity="seen",
    filling_views=3,
    error_threshold=0.3,
    shift_px=0.5,
    compensate_exposure=True,
    marks="apart",
    align_poses=True,
)

PRESETS: Mapping[PresetName, Options] = {"default": DEFAULT, "paper": PAPER}


@cache
def descriptions() -> Mapping[str, str]:
    """Return what every option means: the text below its line in `Options`."""
    (definition,) = ast.parse(inspect.getsource(Options)).body
    assert isinstance(definition, ast.ClassDef)
    found: dict[str, str] = {}
    name: str | None = None
    for line in definition.body:
        if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name):
            name = line.target.id
        elif (
            name is not None and isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant)
        ):
            found[name] = " ".join(str(line.value.value).split())
            name = None
    return {field.name: found[field.name] for field in fields(Options)}
