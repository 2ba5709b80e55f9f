"""The options of the method as flags: a preset, and what is to differ from it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from peaking.presets import Options


@dataclass(frozen=True)
class MethodFlags:
    """A preset and what differs from it."""

    preset: Literal["default", "paper"] = "default"
    """`paper` is the published method to the letter; `default` is our best."""
    pixels: int | None = None
    """Pixels of an MPI plane and of the view; the picture's aspect is kept (294×639 = 187866)."""
    num_planes: int | None = None
    """Planes of an MPI, D (32)."""
    align: Literal["paper", "robust", "off"] | None = None
    """How planes are scaled to the metric depth: mean or median of log disparities, or not."""
    neighbours: int | None = None
    """Views that are blended, K (paper 3, default 4)."""
    weights: Literal["paper", "overlap"] | None = None
    """How views are chosen and weighed: by distance alone, or with overlap and without jumps."""
    opacity: Literal["paper", "seen"] | None = None
    """How opaque a pixel is that only some views saw: weighted sum, or the largest."""
    error_threshold: float | None = None
    """L1 over RGB, 0…3, above which a pixel is red, t (0.4)."""
    shift_px: int | None = None
    """Misalignment in pixels that does not count as an error (paper 0, default 1)."""
    compensate_exposure: bool | None = None
    """Compare after equalising the exposure of the live picture and the view."""
    generator: Literal["layered", "adampi"] | None = None
    """Who makes the MPIs: `layered`, or the paper's `adampi`, which needs weights."""
    checkpoint: Path | None = None
    """File with the generator's weights; without, the folder that `peaking checkpoints` names."""
    depth_model: str | None = None
    """Estimates depth where a frame has none: a folder, or a name of the Hugging Face hub."""
    depth_runtime: Literal["pytorch", "openvino", "openvino-bf16"] | None = None
    """What runs the depth model: `openvino` is faster on processors, and an extra."""
    device: Literal["auto", "cpu", "cuda"] | None = None
    """Where networks run (auto: CUDA where there is one)."""
    precision: Literal["float32", "bfloat16", "float16"] | None = None
    """Of the generator's convolutions; other than float32 on CUDA only."""

    def options(self) -> Options:
        """Return the preset with the flags that were given."""
        from peaking.presets import PRESETS

        given = {
            field.name: getattr(self, field.name)
            for field in fields(MethodFlags)
            if field.name != "preset" and getattr(self, field.name) is not None
        }
        return replace(PRESETS[self.preset], **given)
