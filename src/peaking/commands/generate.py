"""`peaking generate`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.commands.options import MethodOptions
from peaking.commands.scenes import SceneOptions
from peaking.terminal import say


@dataclass(frozen=True)
class Generate:
    """Generate the MPI of one frame and write it as an .mpi file.

    Examples:
      peaking generate scenes/desk --out view.mpi
      peaking generate scenes/desk --frame 40 --out view.mpi --codec lossless
      peaking generate scenes/desk --out view.mpi --generator adampi --checkpoint adampi_32p.pth
    """

    scene: Annotated[Path, tyro.conf.Positional]
    """A recording of any format (docs/formats.md), or a zip of one."""
    out: Path
    """The .mpi file to write; an old one is replaced."""
    frame: int = 0
    """Number of the frame, from 0."""
    codec: Literal["jpeg", "lossless"] = "jpeg"
    """How the tiles are stored."""
    quality: int = 90
    """With --codec jpeg: JPEG quality, 1…100."""
    reading: SceneOptions = field(default_factory=SceneOptions)
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Generate and write."""
        from peaking.mpi_file import write_mpi
        from peaking.view_builder import ViewBuilder

        if not 1 <= self.quality <= 100:
            raise ArgumentError(f"need --quality of 1..100, got {self.quality}")
        with checked_arguments():
            builder = ViewBuilder(self.method.options())
        recording = self.reading.open(self.scene)
        if not 0 <= self.frame < len(recording):
            raise ArgumentError(f"need --frame of 0..{len(recording) - 1}, got {self.frame}")
        made = builder.build(recording.read(self.frame))
        mpi = made.mpi
        write_mpi(self.out, mpi, codec=self.codec, quality=self.quality)
        width, height = mpi.camera.pinhole.size_px
        kilobytes = self.out.stat().st_size / 1e3
        say(
            f"{self.out}: {width}x{height}x{mpi.num_planes}, {len(mpi.texels)} tiles, "
            f"{kilobytes:.0f} kB{'' if made.metric else '; its scale is a guess'}"
        )
