"""The place that the viewer shows: `place.json`, and the files that it names.

Each file is made when it is asked for: `peaking share` writes all of them, `peaking view` makes
those that a browser fetches. Places have a world of their own: the recording's, counted from a
point near the cameras, so that 32 bits are enough.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

import peaking
from peaking.export.up import guess_up, vector_of
from peaking.geometry import Camera
from peaking.share.qr import qr_svg

FORMAT, VERSION = "peaking place", 1

QR_FILE = "qr.svg"

Shown = Literal["light-field", "splat", "place"]


@dataclass(frozen=True, eq=False)
class PlaceView:
    """One captured view.

    Attributes:
        name: What people call it.
        camera: Where it was taken, in the place's world.
        photo: Name of its photograph, None without.
        thumbnail: Name of a small one.
        mpi: Name of its multi-plane image.
    """

    name: str
    camera: Camera
    photo: str | None = None
    thumbnail: str | None = None
    mpi: str | None = None


@dataclass(frozen=True, eq=False)
class Place:
    """What `place.json` says.

    Attributes:
        title: Of the page.
        shown: What the page opens with.
        views: At least one.
        up: Unit vector of the world that points up; None: not known.
        metric: Whether lengths are metres.
        licence: A line under the picture, "" for none.
        points: Name of the points' file (`points`), None without.
        splat: Name of the file of Gaussians, in the axes of this world.
        options: How multi-plane images are blended, as clients are told; None without any.
        start: Number of the view from which one looks first.
        loss_db: What was lost against the whole, of what is shown first; None: nothing was left
            out, or it is not known.
        splat_loss_db: What the Gaussians lost; None: nothing, or it is not known.
        poster: Name of a picture that is shown until the first one is there.
        address: Where the place will be found, None where that is not known.
        qr: Name of a QR code of the address.
    """

    title: str
    shown: Shown
    views: Sequence[PlaceView]
    up: Float64[np.ndarray, "3"] | None = None
    metric: bool = True
    licence: str = ""
    points: str | None = None
    splat: str | None = None
    options: Mapping[str, object] | None = None
    start: int = 0
    loss_db: float | None = None
    splat_loss_db: float | None = None
    poster: str | None = None
    address: str | None = None
    qr: str | None = None

    def to_json(self) -> bytes:
        """Return the place as UTF-8."""
        document = {
            "format": FORMAT,
            "version": VERSION,
            "title": self.title,
            "licence": self.licence,
            "made_by": f"peaking {peaking.__version__}",
            "up": None if self.up is None else self.up.tolist(),
            "metric": self.metric,
            "shown": self.shown,
            "views": [_view(view) for view in self.views],
            "points": self.points,
            "splat": self.splat,
            "options": self.options,
            "start": self.start,
            "loss_db": _lost_db(self.loss_db),
            "splat_loss_db": _lost_db(self.splat_loss_db),
            "poster": self.poster,
            "address": self.address,
            "qr": self.qr,
        }
        text = json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        return text.encode()


@dataclass(frozen=True, eq=False)
class SharedPlace:
    """A place with its files.

    Attributes:
        place: What `place.json` says.
        files: By the name that the place gives them: what returns the bytes of each.
    """

    place: Place
    files: Mapping[str, Callable[[], bytes]] = field(default_factory=dict[str, Callable[[], bytes]])

    def named(self, title: str, licence: str = "", address: str | None = None) -> SharedPlace:
        """Return the place with what people are told of it, and a QR code of its address."""
        place = replace(self.place, title=title, licence=licence, address=address)
        if address is None:
            return replace(self, place=place)
        files = {**self.files, QR_FILE: lambda: qr_svg(address)}
        return SharedPlace(replace(place, qr=QR_FILE), files)


def up_of(cameras: Sequence[Camera]) -> Float64[np.ndarray, "3"] | None:
    """Return the world's up, as most pictures say; None where they do not agree."""
    up = guess_up(cameras)
    return None if up is None else vector_of(up)


def start_of(cameras: Sequence[Camera]) -> int:
    """Return the number of the camera from which one looks first: the one amidst the others.

    It stands near the middle of them and looks where most look.
    """
    positions_m = np.stack([camera.position_m for camera in cameras])
    forward = np.stack([camera.forward for camera in cameras])
    away_m = np.linalg.norm(positions_m - positions_m.mean(axis=0), axis=1)
    aside = 1 - forward @ forward.mean(axis=0)
    return int(np.argmin(away_m / max(float(away_m.max()), 1e-9) + aside))


def _lost_db(loss_db: float | None) -> float | None:
    """Return a loss as it is told: what gained by chance lost nothing."""
    return None if loss_db is None else round(max(loss_db, 0.0), 3)


def _view(view: PlaceView) -> dict[str, Any]:
    return {
        "name": view.name,
        "camera": {
            "pinhole": asdict(view.camera.pinhole),
            "world_from_cam": view.camera.world_from_cam.matrix()[:3].ravel().tolist(),
        },
        "photo": view.photo,
        "thumbnail": view.thumbnail,
        "mpi": view.mpi,
    }
