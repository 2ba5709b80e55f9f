"""`peaking convert`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from peaking.commands.arguments import ArgumentError
from peaking.commands.scenes import SceneOptions
from peaking.export.names import DATASET_FORMATS, DatasetFormat
from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.datasets import Recording
    from peaking.export.up import Axis
    from peaking.geometry import Rigid, World

LEAST_PIXELS = 256


@dataclass(frozen=True)
class Convert:
    """Write a recording, or 3D Gaussians, in another format.

    Pictures are undistorted; those that need no change are copied byte for byte. Depth, masks and
    points go along where the format has room for them (docs/formats.md); what it has none for is
    said. Whatever was written is read back and compared, and not kept if it says something else.

    Examples:
      peaking convert scenes/desk out/colmap --to colmap
      peaking convert ~/captures/garden out/garden --to nerfstudio --frames 0:200:4 --pixels 500000
      peaking convert scan.r3d out/scan --to tum --frames out/best/selection.csv
      peaking convert desk.ply desk.spz
    """

    source: Annotated[Path, tyro.conf.Positional]
    """A recording of any format (docs/formats.md), or Gaussians: .ply, .spz, .glb, .gltf."""
    out: Annotated[Path, tyro.conf.Positional]
    """Folder to write, empty or not there yet; of Gaussians a file: .ply, .compressed.ply, .spz,
    .glb, .gltf."""
    to: DatasetFormat | None = None
    """The format of the data set; that of Gaussians is the ending of their file."""
    frames: str | None = None
    """Frames to write: 0,5,9, START:STOP:STEP, or a selection.csv of peaking select; default: all.
    """
    pixels: int | None = None
    """Shrink larger pictures to about so many pixels, with intrinsics and depth."""
    up: Literal["auto", "+x", "-x", "+y", "-y", "+z", "-z"] | None = None
    """Axis of the source that points up; auto: as most pictures say. nerfstudio's and instant-ngp's
    data sets are turned to +z, Gaussians as viewers want them. Default: data sets stay as they are,
    and Gaussians have the up of their file's format."""
    spz_version: Literal[3, 4] = 3
    """Of .spz files: SuperSplat reads both, Spark 3, PlayCanvas's engine 4."""
    follow_links: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Copy also files that links lead to from outside the recording."""
    keep_exif: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Keep the metadata of the pictures: EXIF with GPS, XMP, comments."""
    reading: SceneOptions = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Convert, check, and print what was lost."""
        from peaking.commands.serving import keep_private
        from peaking.export.splats import is_splat_file

        keep_private()
        if is_splat_file(self.source):
            self._convert_gaussians()
        else:
            self._convert_recording()

    def _convert_gaussians(self) -> None:
        from peaking.export.splats import convert_splats

        if self.to is not None or self.frames is not None or self.pixels is not None:
            raise ArgumentError("3D Gaussians take no --to, --frames or --pixels")
        if self.up == "auto":
            raise ArgumentError(
                "need --up as an axis (-y, say): a file of Gaussians has no cameras"
            )
        for note in convert_splats(self.source, self.out, self.up, spz_version=self.spz_version):
            say(note)

    def _convert_recording(self) -> None:
        from tqdm import tqdm

        from peaking.export.chosen_frames import frames_of_text
        from peaking.export.datasets import TURNED, write_dataset
        from peaking.export.material import Material
        from peaking.output import check_new

        if self.to is None:
            raise ArgumentError(f"need --to, one of {', '.join(DATASET_FORMATS)}")
        if self.pixels is not None and self.pixels < LEAST_PIXELS:
            raise ArgumentError(f"need --pixels of at least {LEAST_PIXELS}, got {self.pixels}")
        if self.up is not None and self.to not in TURNED:
            raise ArgumentError(f"--up is for {' and '.join(TURNED)}: {self.to} has no up")
        check_new(self.out)
        recording = self.reading.open(self.source, confined=not self.follow_links)
        indices: Sequence[int] = range(len(recording))
        if self.frames is not None:
            indices = frames_of_text(self.frames, recording)

        def shown(places: Sequence[int]) -> Iterable[int]:
            return tqdm(places, desc=f"to {self.to}", unit="frame")

        placing = self._placing(recording, indices)
        material = Material(recording, indices, self.pixels, placing, self.keep_exif, shown)
        exported = write_dataset(material, self.out, self.to)
        say(*exported.notes)
        say(
            f"{self.out}: {exported.frames} of {len(recording)} frames; pictures, poses, "
            f"intrinsics and {exported.checked_points:,} points were read back as they should be"
        )

    def _placing(self, recording: Recording, indices: Sequence[int]) -> Rigid[World, World]:
        """Return how the world is turned and moved, and say so."""
        import numpy as np

        from peaking.export.up import guess_up, turn
        from peaking.geometry import Rigid, World, near_origin_m

        cameras = [recording.cameras[index] for index in indices]
        up: Axis | None = guess_up(cameras) if self.up == "auto" else self.up
        if self.up == "auto":
            say(f"up is {up}" if up else "up is not known: the cameras were held in many ways")
        rotation = np.eye(3) if up is None else turn(up, "+z")
        origin_m = near_origin_m(cameras)
        if origin_m.any():
            x, y, z = origin_m
            say(
                f"positions are counted from ({x:.0f}, {y:.0f}, {z:.0f}) of the recording, because "
                "trainers compute with 32 bits"
            )
        return Rigid[World, World](rotation, -rotation @ origin_m)
