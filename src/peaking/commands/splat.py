"""`peaking splat`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from peaking.frame import Frame
    from peaking.splat.gaussians import Gaussians
    from peaking.splat.train import SplatOptions


@dataclass(frozen=True)
class Splat:
    """Train 3D Gaussians on a recording, on the CPU, and write them as a .ply file.

    The file opens in SuperSplat and other viewers of 3D Gaussian splatting. Beside it,
    NAME_preview_0.jpg and so on show photographs and, to the right of each, the trained view from
    the same place. Depth is used to start from where the recording has it.

    Examples:
      peaking splat scenes/desk --out desk.ply
      peaking splat ~/captures/garden --out garden.ply --iterations 4000 --hold-out 8
    """

    scene: Annotated[Path, tyro.conf.Positional]
    """A nerfstudio folder, with or without depth."""
    out: Path
    """The .ply file to write; an old one is replaced."""
    iterations: int = 2000
    """Steps of training; each looks at one picture."""
    pixels: int = 57280
    """Pixels of the pictures trained on; their aspect is kept (179×320 = 57280)."""
    views: int | None = None
    """Use this many pictures, evenly spaced; all when not given."""
    hold_out: int = 0
    """Keep every n-th picture from training and report the PSNR on these; 0 keeps none."""
    previews: int = 3
    """Pairs of photograph and trained view to write."""
    seed: int = 0
    """Of the random choices; the same seed gives the same file."""

    def run(self) -> None:
        """Train and write."""
        from tqdm import tqdm

        from peaking.output import write_atomically
        from peaking.splat.ply import encode_ply
        from peaking.splat.train import Step, train

        if self.out.suffix.lower() != ".ply":
            raise ValueError(f"need the name of a .ply file, got --out {self.out}")
        options = self._options()
        training, held_out = self._frames()
        with tqdm(total=options.iterations, desc="training", unit="step") as bar:

            def show(step: Step) -> None:
                bar.set_postfix(
                    gaussians=step.num_gaussians, loss=f"{step.loss:.3f}", refresh=False
                )
                bar.update()

            gaussians = train(training, options, progress=show)
        data = encode_ply(gaussians)
        write_atomically(self.out, data)
        print(f"{self.out}: {len(gaussians)} Gaussians, {len(data) / 1e6:.1f} MB")
        self._write_previews(gaussians, held_out or training)
        if held_out:
            print(f"PSNR of {len(held_out)} held-out pictures: {_psnr(gaussians, held_out):.2f} dB")

    def _options(self) -> SplatOptions:
        from peaking.splat.train import SplatOptions

        if self.pixels < 256 or self.hold_out < 0 or self.hold_out == 1 or self.previews < 0:
            raise ValueError(
                "need --pixels of at least 256, --hold-out 0 or at least 2, --previews at least 0"
            )
        if self.views is not None and self.views < 1:
            raise ValueError(f"need --views of at least 1, got {self.views}")
        return SplatOptions(iterations=self.iterations, seed=self.seed)

    def _frames(self) -> tuple[list[Frame], list[Frame]]:
        """Return the frames to train on and those that are kept from training, made small."""
        import numpy as np

        from peaking.datasets.nerfstudio import open_recording
        from peaking.frame import working_size_px

        recording = open_recording(self.scene)
        count = min(self.views or len(recording), len(recording))
        indices = np.linspace(0, len(recording) - 1, count).round().astype(int).tolist()
        training: list[Frame] = []
        held_out: list[Frame] = []
        for place, index in enumerate(indices):
            frame = recording.read(index)
            size = working_size_px(*frame.camera.pinhole.size_px, pixels=self.pixels)
            kept_back = self.hold_out > 0 and place % self.hold_out == 0
            (held_out if kept_back else training).append(frame.resized(*size))
        return training, held_out

    def _write_previews(self, gaussians: Gaussians, frames: Sequence[Frame]) -> None:
        import numpy as np

        from peaking.output import encode_jpeg, write_atomically
        from peaking.splat.rasterise import render

        chosen = np.linspace(0, len(frames) - 1, min(self.previews, len(frames))).round()
        for place, index in enumerate(chosen.astype(int).tolist()):
            rgb = np.clip(render(gaussians, frames[index].camera).rgb, 0, 1)
            seen = (rgb * 255 + 0.5).astype(np.uint8)
            path = self.out.with_name(f"{self.out.stem}_preview_{place}.jpg")
            write_atomically(path, encode_jpeg(np.hstack([frames[index].rgb, seen])))
            print(f"{path}: {frames[index].name}, photograph and trained view")


def _psnr(gaussians: Gaussians, frames: Sequence[Frame]) -> float:
    import numpy as np

    from peaking.evaluate.metrics import psnr
    from peaking.splat.rasterise import render

    return float(
        np.mean(
            [
                psnr(
                    np.clip(render(gaussians, frame.camera).rgb, 0, 1).astype(np.float64),
                    frame.rgb / 255.0,
                )
                for frame in frames
            ]
        )
    )
