"""`peaking render`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import tyro

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.commands.options import MethodOptions
from peaking.commands.scenes import SceneOptions
from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.geometry import Camera
    from peaking.light_field import LightField


@dataclass(frozen=True)
class Render:
    """Render an .mpi file, or the views of a recording, from a pose, and write a PNG.

    The pose is that of the .mpi file or, for a recording, of its frame `--frame`, moved by
    `--move-m` and turned by `--turn-deg`.

    Examples:
      peaking render view.mpi --move-m 0.1 0 0 --out right.png
      peaking render out/desk/captured --frame 3 --move-m 0 -0.05 0.1 --out between.png
      peaking render view.mpi --turn-deg 5 0 --show depth --out depth.png
    """

    source: Annotated[Path, tyro.conf.Positional]
    """An .mpi file, or a recording of any format (docs/formats.md); all its frames are used as
    captured views."""
    out: Path
    """The PNG file to write; an old one is replaced."""
    frame: int = 0
    """For a folder: number of the frame whose camera the pose starts from."""
    move_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Movement to the right, down and forward (metres)."""
    turn_deg: tuple[float, float] = (0.0, 0.0)
    """Rotation to the right and down (degrees)."""
    show: Literal["colour", "alpha", "depth"] = "colour"
    """Colour with alpha, alpha as grey, or depth as 16-bit millimetres."""
    reading: SceneOptions = field(default_factory=SceneOptions)
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Render and write."""
        from peaking.output import depth_mm, encode_png, write_atomically

        light_field, camera = self._light_field_and_camera()
        camera = self._moved(camera)
        rendering = light_field.render(camera)
        if self.show == "depth":
            picture = depth_mm(rendering.depth_m)
        elif self.show == "alpha":
            picture = (rendering.alpha * 255.0 + 0.5).astype(np.uint8)
        else:
            straight = np.dstack([rendering.rgb(), rendering.alpha])
            picture = np.clip(straight * 255.0 + 0.5, 0, 255).astype(np.uint8)
        write_atomically(self.out, encode_png(picture))
        say(f"{self.out}: {np.mean(rendering.alpha > 0.5):.1%} of the picture is covered by a view")

    def _light_field_and_camera(self) -> tuple[LightField, Camera]:
        from peaking.light_field import LightField
        from peaking.mpi_file import read_mpi
        from peaking.pipeline import Reconstruction
        from peaking.view_weights import nearest_by_distance

        with checked_arguments():
            options = self.method.options()
        if self.source.suffix.lower() == ".mpi" or not self.source.exists():
            mpi = read_mpi(self.source)
            return LightField([mpi], options), mpi.camera
        recording = self.reading.open(self.source)
        if not 0 <= self.frame < len(recording):
            raise ArgumentError(f"need --frame of 0..{len(recording) - 1}, got {self.frame}")
        scene = Reconstruction(options)
        start = scene.prepare(recording.read(self.frame)).camera
        # Views far away would not be used: only the nearest few are generated.
        target = self._moved(start)
        near = nearest_by_distance(recording.cameras, target, count=4 * options.neighbours)
        for neighbour in near:
            scene.add_view(recording.read(neighbour.index))
        return scene.light_field, start

    def _moved(self, camera: Camera) -> Camera:
        from peaking.geometry import Cam, Rigid

        if not np.isfinite([*self.move_m, *self.turn_deg]).all():
            raise ArgumentError(f"need finite numbers, got {self.move_m} and {self.turn_deg}")
        right, down = np.deg2rad(self.turn_deg)
        about_y = np.array(
            [[np.cos(right), 0, np.sin(right)], [0, 1, 0], [-np.sin(right), 0, np.cos(right)]]
        )
        about_x = np.array(
            [[1, 0, 0], [0, np.cos(down), np.sin(down)], [0, -np.sin(down), np.cos(down)]]
        )
        cam_from_moved: Rigid[Cam, Cam] = Rigid(about_y @ about_x, np.array(self.move_m))
        return replace(camera, world_from_cam=camera.world_from_cam @ cam_from_moved)
