"""`peaking splat`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from peaking.frame import Frame
    from peaking.splat.gaussians import Gaussians
    from peaking.splat.options import SplatOptions
    from peaking.splat.seeds import Points

FEWEST_PICTURES = 3
Backend = Literal["numba", "gsplat"]


@dataclass(frozen=True)
class Splat:
    """Train 3D Gaussians on a recording and write them as a .ply file.

    The file opens in SuperSplat and other viewers of 3D Gaussian splatting. Beside it,
    NAME_preview.jpg shows photographs and, to the right of each, the trained view from the same
    place and its depth. Where the recording has depth, training starts from it.

    Examples:
      peaking splat scenes/desk --out desk.ply
      peaking splat ~/captures/garden --out garden.ply --iterations 4000 --hold-out 8
      peaking splat ~/captures/garden --out garden.ply --cameras colmap
    """

    scene: Annotated[Path, tyro.conf.Positional]
    """A nerfstudio folder (a session of `peaking serve` is one), with or without depth."""
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
    """Pictures to show in NAME_preview.jpg; 0 writes none."""
    seed: int = 0
    """Of the random choices; with numba, the same seed gives the same file."""
    backend: Literal["auto", "numba", "gsplat"] = "auto"
    """Train on the CPU (numba) or on CUDA (gsplat, extra `splat`); auto: on CUDA if it is there."""
    cameras: Literal["recorded", "colmap"] = "recorded"
    """Where the pictures were taken: as recorded, or as COLMAP says (extra `colmap`)."""

    def run(self) -> None:
        """Train and write."""
        from tqdm import tqdm

        from peaking.output import write_atomically
        from peaking.splat.ply import encode_ply
        from peaking.splat.train import Step, train

        self._check()
        backend = self._backend()
        training, held_out, points = self._material()
        options = self._options()
        with tqdm(total=options.iterations, desc=f"training ({backend})", unit="step") as bar:

            def show(step: Step) -> None:
                bar.set_postfix(
                    gaussians=step.num_gaussians, loss=f"{step.loss:.3f}", refresh=False
                )
                bar.update()

            gaussians = train(training, options, points=points, backend=backend, progress=show)
        data = encode_ply(gaussians)
        write_atomically(self.out, data)
        print(f"{self.out}: {len(gaussians)} Gaussians, {len(data) / 1e6:.1f} MB")
        if self.previews:
            self._write_preview(gaussians, held_out or training)
        if held_out:
            print(f"PSNR of {len(held_out)} held-out pictures: {_psnr(gaussians, held_out):.2f} dB")

    def _check(self) -> None:
        from peaking.errors import OutputError

        if self.out.suffix.lower() != ".ply":
            raise ValueError(f"need the name of a .ply file, got --out {self.out}")
        if self.pixels < 256 or self.hold_out < 0 or self.hold_out == 1 or self.previews < 0:
            raise ValueError(
                "need --pixels of at least 256, --hold-out 0 or at least 2, --previews at least 0"
            )
        if self.views is not None and self.views < FEWEST_PICTURES:
            raise ValueError(f"need --views of at least {FEWEST_PICTURES}, got {self.views}")
        # What would only be found out when all is trained.
        if self.out.is_dir():
            raise OutputError(f"{self.out}: is a folder; give the name of a file")
        above = next(place for place in self.out.absolute().parents if place.exists())
        if not (above.is_dir() and os.access(above, os.W_OK)):
            raise OutputError(f"{self.out}: not writable; give a folder that you may write to")
        self._options()

    def _backend(self) -> Backend:
        if self.backend != "auto":
            return self.backend
        from peaking.errors import BackendUnavailable
        from peaking.splat._gsplat import check_available

        try:
            check_available()
        except BackendUnavailable:
            return "numba"
        return "gsplat"

    def _options(self) -> SplatOptions:
        from peaking.splat.options import SplatOptions

        return SplatOptions(iterations=self.iterations, seed=self.seed)

    def _material(self) -> tuple[list[Frame], list[Frame], Points]:
        """Return the frames to train on, those that are kept from it, and points to start from."""
        from peaking.errors import RecordingError
        from peaking.splat.seeds import FEWEST_POINTS, surface_points

        frames, points = self._frames()
        held_back = {
            place for place in range(len(frames)) if self.hold_out and place % self.hold_out == 0
        }
        small = [self._small(frame) for frame in frames]
        training = [frame for place, frame in enumerate(small) if place not in held_back]
        held_out = [small[place] for place in sorted(held_back)]
        if len(training) < FEWEST_PICTURES:
            raise RecordingError(
                self.scene,
                f"has {len(training)} pictures to train on",
                remedy=f"take at least {FEWEST_PICTURES}, or hold out fewer",
            )
        points = points or surface_points(training)
        if len(points) < FEWEST_POINTS:
            raise RecordingError(
                self.scene,
                "has no depth, and no surface is seen alike from two places",
                remedy="take pictures from side to side with plenty of overlap",
            )
        return training, held_out, points

    def _frames(self) -> tuple[list[Frame], Points | None]:
        """Return the chosen frames and, from COLMAP, points."""
        import numpy as np

        from peaking.datasets import open_recording

        recording = open_recording(self.scene)
        count = min(self.views or len(recording), len(recording))
        indices = np.linspace(0, len(recording) - 1, count).round().astype(int).tolist()
        if self.cameras == "recorded":
            return [self._small(recording.read(index)) for index in indices], None
        from peaking.splat.colmap import estimate_cameras, for_features

        frames = [for_features(recording.read(index)) for index in indices]
        print(f"COLMAP looks for the cameras of {len(frames)} pictures (minutes) ...")
        found = estimate_cameras(frames, seed=self.seed)
        placed = [
            replace(frame, camera=camera)
            for frame, camera in zip(frames, found.cameras, strict=True)
            if camera is not None
        ]
        print(
            f"COLMAP placed {len(placed)} pictures and {len(found.points)} points, the pictures "
            f"{found.residual_m * 100:.1f} cm from where they were recorded"
        )
        return placed, found.points

    def _small(self, frame: Frame) -> Frame:
        from peaking.frame import working_size_px

        return frame.resized(*working_size_px(*frame.camera.pinhole.size_px, pixels=self.pixels))

    def _write_preview(self, gaussians: Gaussians, frames: Sequence[Frame]) -> None:
        import numpy as np

        from peaking.output import encode_jpeg, write_atomically
        from peaking.splat.preview import preview

        chosen = np.linspace(0, len(frames) - 1, min(self.previews, len(frames))).round()
        shown = [frames[index] for index in chosen.astype(int).tolist()]
        path = self.out.with_name(f"{self.out.stem}_preview.jpg")
        write_atomically(path, encode_jpeg(preview(gaussians, shown)))
        print(f"{path}: photographs, trained views, and their depth")


def _psnr(gaussians: Gaussians, frames: Sequence[Frame]) -> float:
    import numpy as np

    from peaking.metrics.psnr_ssim import psnr
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
