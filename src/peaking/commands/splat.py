"""`peaking splat`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.commands.scenes import SceneOptions
from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.frame import Frame
    from peaking.point_cloud import PointCloud
    from peaking.splat.gaussians import Gaussians
    from peaking.splat.options import SplatOptions

MIN_PICTURES = 3
Backend = Literal["numba", "gsplat"]


@dataclass(frozen=True)
class Splat:
    """Train 3D Gaussians on a recording and write them as a .ply, .spz or glTF file.

    The file opens, the right way up, in SuperSplat and other viewers of 3D Gaussian splatting
    (docs/formats.md). NAME_preview.jpg, in
    the same folder, shows photographs and, to the right of each, the rendering from the same camera
    and its depth. If the recording has depth, training starts from it.

    Examples:
      peaking splat scenes/desk --out desk.ply
      peaking splat ~/captures/garden --out garden.ply --iterations 4000 --hold-out 8
      peaking splat ~/captures/garden --out garden.ply --cameras colmap
    """

    scene: Annotated[Path, tyro.conf.Positional]
    """A recording of any format (docs/formats.md; a session of `peaking serve` is one), with or
    without depth."""
    out: Path
    """The file to write: .ply, .compressed.ply, .spz (both: extra `formats`), .glb, .gltf; an old
    one is replaced."""
    iterations: int = 2000
    """Training steps; each uses one picture."""
    pixels: int = 57280
    """Size in pixels to which pictures are shrunk for training (179×320 = 57280)."""
    views: int | None = None
    """Number of pictures to use, evenly spaced; default: all."""
    hold_out: int = 0
    """Hold out every n-th picture from training and report the PSNR on them; 0: none."""
    previews: int = 3
    """Pictures to show in NAME_preview.jpg; 0: do not write it."""
    seed: int = 0
    """Seed of the random choices; with numba, the same seed gives the same file."""
    backend: Literal["auto", "numba", "gsplat"] = "auto"
    """Train on the CPU (numba) or on CUDA (gsplat, extra `splat`); auto: on CUDA if available."""
    cameras: Literal["recorded", "colmap"] = "recorded"
    """Camera poses to train on: the recorded ones or COLMAP's (extra `colmap`)."""
    up: Literal["auto", "none", "+x", "-x", "+y", "-y", "+z", "-z"] = "auto"
    """Axis of the recording that points up; the scene is turned so that viewers of the file's
    format show it upright. auto: as most pictures say; none: keep the recording's axes."""
    json: Path | None = None
    """Also write the number of Gaussians and the PSNR to this file, as JSON."""
    reading: SceneOptions = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Train and write."""
        from tqdm import tqdm

        from peaking.commands.results import write_results
        from peaking.export.splats import said_of, write_splats
        from peaking.splat.training import TrainingStep, train

        self._check()
        backend = self._backend()
        training, held_out, points = self._material()
        options = self._options()
        with tqdm(total=options.iterations, desc=f"training ({backend})", unit="step") as bar:

            def show(step: TrainingStep) -> None:
                bar.set_postfix_str(
                    f"gaussians={step.num_gaussians}, loss={step.loss:.3f}", refresh=False
                )
                bar.update()

            gaussians = train(training, options, points=points, backend=backend, progress=show)
        shown = self._upright(gaussians, training)
        write_splats(self.out, shown)
        say(*said_of(self.out, shown))
        if self.previews:
            self._write_preview(gaussians, held_out or training)
        psnr_db = _mean_psnr_db(gaussians, held_out) if held_out else None
        if psnr_db is not None:
            say(f"PSNR of {len(held_out)} held-out pictures: {psnr_db:.2f} dB")
        write_results(
            self,
            {
                "trained_with": backend,
                "training_pictures": len(training),
                "held_out_pictures": len(held_out),
                "gaussians": len(gaussians),
                "psnr_db": psnr_db,
            },
        )

    def _upright(self, gaussians: Gaussians, frames: Sequence[Frame]) -> Gaussians:
        """Return the Gaussians in the axes that viewers of the file expect."""
        from peaking.export.splats import upright
        from peaking.export.up import guess_up

        if self.up == "none":
            return gaussians
        up = guess_up([frame.camera for frame in frames]) if self.up == "auto" else self.up
        if up is None:
            say("which way is up is not known (cameras were held in many ways): --up tells")
            return gaussians
        return upright(gaussians, up, self.out)

    def _check(self) -> None:
        from peaking.errors import OutputError
        from peaking.export.splats import ENDINGS, check_writable, ending_of
        from peaking.output import check_folder

        if ending_of(self.out) is None:
            endings = ", ".join(ENDINGS)
            raise ArgumentError(f"need a file name ending in {endings} for --out, got {self.out}")
        if self.pixels < 256 or self.hold_out < 0 or self.hold_out == 1 or self.previews < 0:
            raise ArgumentError(
                "need --pixels of at least 256, --hold-out 0 or at least 2, --previews at least 0"
            )
        if self.views is not None and self.views < MIN_PICTURES:
            raise ArgumentError(f"need --views of at least {MIN_PICTURES}, got {self.views}")
        # Find out now what would otherwise fail after the training.
        if self.out.is_dir():
            raise OutputError(f"{self.out}: is a folder; give a file name")
        check_folder(self.out.parent)
        above = next(folder for folder in self.out.absolute().parents if folder.exists())
        if not os.access(above, os.W_OK):
            raise OutputError(f"{self.out}: not writable; choose a folder that you may write to")
        check_writable(self.out)
        with checked_arguments():
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

    def _material(self) -> tuple[list[Frame], list[Frame], PointCloud]:
        """Return the frames to train on, those held out, and the points to start from."""
        from peaking.errors import RecordingError
        from peaking.splat.initialisation import MIN_POINTS, surface_points

        frames, points = self._frames()
        held_back = {
            index for index in range(len(frames)) if self.hold_out and index % self.hold_out == 0
        }
        small = [self._small(frame) for frame in frames]
        training = [frame for index, frame in enumerate(small) if index not in held_back]
        held_out = [small[index] for index in sorted(held_back)]
        if len(training) < MIN_PICTURES:
            raise RecordingError(
                self.scene,
                f"has {len(training)} pictures to train on",
                remedy=f"take at least {MIN_PICTURES} pictures, or hold out fewer",
            )
        points = points or surface_points(training)
        if len(points) < MIN_POINTS:
            raise RecordingError(
                self.scene,
                "has no depth, and no surface could be matched between two pictures",
                remedy="take pictures while moving sideways, with plenty of overlap",
            )
        return training, held_out, points

    def _frames(self) -> tuple[list[Frame], PointCloud | None]:
        """Return the chosen frames and, from COLMAP, points."""
        import numpy as np

        recording = self.reading.open(self.scene)
        count = min(self.views or len(recording), len(recording))
        indices = np.linspace(0, len(recording) - 1, count).round().astype(int).tolist()
        if self.cameras == "recorded":
            return [self._small(recording.read(index)) for index in indices], None
        from peaking.poses.colmap import estimate_cameras, shrunk_for_features

        frames = [shrunk_for_features(recording.read(index)) for index in indices]
        say(f"COLMAP estimates the cameras of {len(frames)} pictures (takes minutes) ...")
        found = estimate_cameras(frames, seed=self.seed)
        placed = [
            replace(frame, camera=camera)
            for frame, camera in zip(frames, found.cameras, strict=True)
            if camera is not None
        ]
        say(
            f"COLMAP placed {len(placed)} of {len(frames)} pictures, {len(found.points)} points; "
            f"the pictures are {100 * found.residual_m:.1f} cm (RMS) from the recorded positions"
        )
        return placed, found.points

    def _small(self, frame: Frame) -> Frame:
        from peaking.frame import working_size_px

        return frame.resized(*working_size_px(*frame.camera.pinhole.size_px, pixels=self.pixels))

    def _write_preview(self, gaussians: Gaussians, frames: Sequence[Frame]) -> None:
        import numpy as np

        from peaking.output import encode_jpeg, write_atomically
        from peaking.splat.preview_picture import preview

        chosen = np.linspace(0, len(frames) - 1, min(self.previews, len(frames))).round()
        shown = [frames[int(index)] for index in chosen]
        path = self.out.with_name(f"{self.out.stem}_preview.jpg")
        write_atomically(path, encode_jpeg(preview(gaussians, shown)))
        say(f"{path}: photographs, renderings and their depth")


def _mean_psnr_db(gaussians: Gaussians, frames: Sequence[Frame]) -> float:
    import numpy as np

    from peaking.metrics.psnr_ssim import psnr
    from peaking.splat.rasterise import render

    return float(
        np.mean(
            [
                psnr(
                    np.clip(render(gaussians, frame.camera).rgb, 0, 1).astype(np.float64),
                    frame.rgb / 255.0,
                    frame.mask,
                )
                for frame in frames
                if frame.mask is None or frame.mask.any()
            ]
        )
    )
