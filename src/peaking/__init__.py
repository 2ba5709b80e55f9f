"""See in red, while you photograph, which pixels view synthesis still gets wrong.

    >>> import peaking
    >>> recording = peaking.open_recording("scenes/desk")
    >>> scene = peaking.Reconstruction()
    >>> mpi = scene.add_view(recording.read(0))            # the shutter
    >>> live = scene.prepare(recording.read(12))
    >>> seen = scene.compare(live.rgb, live.camera)        # every frame of the video
    >>> f"{seen.errors.peaked_share:.1%} of the pixels are wrong"

These names are the library: recordings in, views chosen, light fields rendered and compared, MPIs
and 3D Gaussians in and out. The modules below them hold the rest. Axes, pixels, units and colours:
CONVENTIONS.md. The whole method on one screen: `peaking.pipeline`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from peaking.datasets import Recording, open_recording
    from peaking.error_map import ErrorMap, compare
    from peaking.errors import PeakingError
    from peaking.frame import Frame
    from peaking.geometry import Camera, Pinhole, Rigid
    from peaking.light_field import Comparison, LightField
    from peaking.mpi import Mpi
    from peaking.mpi_file import read_mpi, write_mpi
    from peaking.options import PRESETS, Options
    from peaking.pipeline import Reconstruction
    from peaking.rendering import Rendering, render
    from peaking.selection.recorded_frames import select
    from peaking.selection.registry import SelectionOptions
    from peaking.splat.gaussians import Gaussians
    from peaking.splat.options import SplatOptions
    from peaking.splat.ply import read_ply, write_ply
    from peaking.splat.training import train
    from peaking.view_builder import generate

__version__ = "0.2.0.dev0"

__all__ = [
    "PRESETS",
    "Camera",
    "Comparison",
    "ErrorMap",
    "Frame",
    "Gaussians",
    "LightField",
    "Mpi",
    "Options",
    "PeakingError",
    "Pinhole",
    "Reconstruction",
    "Recording",
    "Rendering",
    "Rigid",
    "SelectionOptions",
    "SplatOptions",
    "compare",
    "generate",
    "open_recording",
    "read_mpi",
    "read_ply",
    "render",
    "select",
    "train",
    "write_mpi",
    "write_ply",
]

_HOMES = {
    "PRESETS": "options",
    "Camera": "geometry",
    "Comparison": "light_field",
    "ErrorMap": "error_map",
    "Frame": "frame",
    "Gaussians": "splat.gaussians",
    "LightField": "light_field",
    "Mpi": "mpi",
    "Options": "options",
    "PeakingError": "errors",
    "Pinhole": "geometry",
    "Reconstruction": "pipeline",
    "Recording": "datasets",
    "Rendering": "rendering",
    "Rigid": "geometry",
    "SelectionOptions": "selection.registry",
    "SplatOptions": "splat.options",
    "compare": "error_map",
    "generate": "view_builder",
    "open_recording": "datasets",
    "read_mpi": "mpi_file",
    "read_ply": "splat.ply",
    "render": "rendering",
    "select": "selection.recorded_frames",
    "train": "splat.training",
    "write_mpi": "mpi_file",
    "write_ply": "splat.ply",
}
"""Where a name is defined: it is imported when it is first asked for, so that `import peaking`, and
with it the command line's --help, needs neither NumPy nor the compiler."""


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'peaking' has no attribute {name!r}")
    found: object = getattr(importlib.import_module(f"peaking.{_HOMES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
