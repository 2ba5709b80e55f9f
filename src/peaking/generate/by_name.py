"""Generators by the names that options and reports give them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from peaking.checkpoints import adampi_file
from peaking.errors import BackendUnavailable
from peaking.generate import Generator
from peaking.generate.layered import Layered

GeneratorName = Literal["layered", "adampi"]
Device = Literal["auto", "cpu", "cuda"]
Precision = Literal["float32", "bfloat16", "float16"]


@dataclass(frozen=True)
class Learned:
    """What learned generators and depth estimators need besides the picture.

    Attributes:
        checkpoint: File with the generator's weights; None looks in the folder of checkpoints.
        device: Where they run; `auto` is CUDA where there is one.
        precision: Of the generator's convolutions; other than float32 on CUDA only.
    """

    checkpoint: Path | None = None
    device: Device = "auto"
    precision: Precision = "float32"


def generator_named(
    name: GeneratorName, *, num_planes: int, learned: Learned | None = None
) -> Generator:
    """Return a generator, ready for use.

    Raises:
        BackendUnavailable: It needs PyTorch, or CUDA, which is not there.
        CheckpointError: Its weights are missing or cannot be used.
    """
    if name == "layered":
        return Layered(num_planes=num_planes)
    how = learned or Learned()
    try:
        from peaking.generate.adampi.generator import AdaMpi
    except ImportError as error:
        raise BackendUnavailable(
            f"the generator `{name}` needs PyTorch ({error}); pip install 'peaking[torch]'"
        ) from error
    return AdaMpi.load(
        how.checkpoint or adampi_file(num_planes),
        num_planes=num_planes,
        device=how.device,
        precision=how.precision,
    )
