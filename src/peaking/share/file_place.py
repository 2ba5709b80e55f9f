"""The place of a single file: a multi-plane image, or 3D Gaussians."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from peaking.export.splats import ending_of, format_of
from peaking.export.up import vector_of
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World, near_origin_m
from peaking.mpi import Mpi
from peaking.mpi_file import encode, read_mpi
from peaking.options import DEFAULT
from peaking.rendering import render
from peaking.share import pictures
from peaking.share.place import Place, PlaceView, SharedPlace, up_of
from peaking.share.recorded_place import client_options
from peaking.share.splat import fitted, sizes
from peaking.splat.gaussians import Gaussians

LOOKING = Pinhole(960, 640, 800.0, 800.0, 480.0, 320.0)
"""Of a place that nobody photographed."""
MOST_OF = 75
"""Per cent of the Gaussians are in the picture at first."""
AWAY = 2.2
"""Times as far from the middle as those are."""


def place_of_mpi(path: Path) -> SharedPlace:
    """Return the place of a multi-plane image.

    Raises:
        MpiFileError: It is no sound `.mpi` file.
    """
    mpi = read_mpi(path)
    origin_m = near_origin_m([mpi.camera])
    camera = mpi.camera.relative_to(origin_m)
    data = path.read_bytes() if not origin_m.any() else encode(replace(mpi, camera=camera))
    picture = _picture(mpi)
    view = PlaceView(path.stem, camera, thumbnail="thumbnails/view.jpg", mpi="mpis/view.mpi")
    place = Place(
        title=path.stem,
        shown="light-field",
        views=[view],
        up=up_of([camera]),
        options=client_options(DEFAULT),
        poster="poster.jpg",
    )
    files = {
        "mpis/view.mpi": lambda: data,
        "thumbnails/view.jpg": lambda: pictures.encoded(picture, pictures.THUMBNAIL_PX),
        "poster.jpg": lambda: pictures.encoded(picture),
    }
    return SharedPlace(place, files)


def place_of_splats(
    path: Path, gaussians: Gaussians, room_bytes: int | None = None
) -> tuple[SharedPlace, int]:
    """Return the place of a file of Gaussians, and how many are in it.

    A .ply is shown as it is where it fits; other formats are written anew.

    Args:
        path: The file.
        gaussians: What was read from it.
        room_bytes: For the Gaussians that are shown; None: any.

    Raises:
        OutputError: No Gaussian fits.
    """
    size = path.stat().st_size
    if ending_of(path) == ".ply" and (room_bytes is None or size <= room_bytes):
        name, make, kept = "splat.ply", path.read_bytes, len(gaussians)
    else:
        made = fitted(gaussians, sizes(gaussians), room_bytes)
        name, make, kept = f"splat{made.ending}", lambda: made.data, len(made.gaussians)
    place = Place(
        title=path.name.split(".")[0],
        shown="splat",
        views=[PlaceView("start", _camera_before(gaussians, path))],
        up=vector_of(format_of(path).up),
        metric=False,
        splat=name,
    )
    return SharedPlace(place, {name: make}), kept


def _picture(mpi: Mpi) -> np.ndarray:
    rgba = render(mpi, mpi.camera).rgba
    return np.clip(rgba[..., :3] * 255 + 0.5, 0, 255).astype(np.uint8)


def _camera_before(gaussians: Gaussians, path: Path) -> Camera:
    """Return a camera that looks at most of the Gaussians from the front."""
    means_m = gaussians.means_m.astype(np.float64)
    middle_m = np.median(means_m, axis=0)
    radius_m = float(np.percentile(np.linalg.norm(means_m - middle_m, axis=1), MOST_OF))
    # As viewers hold such files: what has -y up is looked at along +z, what has +y up along -z.
    upright = -1.0 if format_of(path).up == "-y" else 1.0
    rotation = np.diag([1.0, -upright, -upright])
    position_m = middle_m - AWAY * max(radius_m, 0.01) * rotation[:, 2]
    return Camera(LOOKING, Rigid[World, Cam](rotation, position_m))
