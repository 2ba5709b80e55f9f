"""The place of a recording: its views with photographs, multi-plane images, points, Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import msgspec

from peaking.datasets.foreign_files import read_bytes
from peaking.errors import RecordingError
from peaking.options import Options
from peaking.server.wire import options_for_clients
from peaking.share.place import Place, PlaceView, SharedPlace, start_of, up_of
from peaking.share.recorded_files import RecordedFiles
from peaking.share.sampling import evenly
from peaking.share.session_folder import title_of, trained_in

MOST_VIEWS = 120
"""Of a recording that is looked at as it is."""
WITHOUT_SCALE = frozenset({"video", "photos"})
"""Formats of which poses and depth are found from pictures alone."""
POINTS_FILE = "points.bin"

Maker = Callable[[], bytes]


@dataclass(frozen=True, eq=False)
class Contents:
    """What of a recording is in its place.

    Attributes:
        indices: The frames that are views.
        mpis: Makes their multi-plane images, by frame; none for those without.
        splat: Name and maker of the file of Gaussians.
        loss_db: What was lost against the whole, of what is shown first.
        splat_loss_db: What the Gaussians lost.
        with_photos: Whether views have their photographs.
    """

    indices: Sequence[int]
    mpis: Mapping[int, Maker] = field(default_factory=dict[int, Maker])
    splat: tuple[str, Maker] | None = None
    loss_db: float | None = None
    splat_loss_db: float | None = None
    with_photos: bool = True


def whole_contents(files: RecordedFiles) -> Contents:
    """Return all that a recording can show, made when it is asked for: of 120 frames at most.

    That includes the Gaussians that the server has trained on a session.
    """
    indices = evenly(files.usable or range(len(files.recording)), MOST_VIEWS)
    usable = set(files.usable)
    mpis = {i: partial(files.mpi, i) for i in indices if i in usable}
    return Contents(indices, mpis, splat=_of_session(files))


def _of_session(files: RecordedFiles) -> tuple[str, Maker] | None:
    """Return the Gaussians that were trained on a session; their file has its world."""
    path = trained_in(files.recording)
    if path is None or files.origin_m.any():
        return None
    try:
        data = read_bytes(path, within=path.parent.parent)
    except (RecordingError, OSError):
        return None
    return f"splat{path.suffix}", lambda: data


def place_of_recording(files: RecordedFiles, contents: Contents) -> SharedPlace:
    """Return the place of a recording."""
    made: dict[str, Maker] = {}

    def named(name: str, make: Maker) -> str:
        made[name] = make
        return name

    views = [
        PlaceView(
            name=files.recording.names[i],
            camera=files.camera(i),
            photo=named(f"photos/{i:05d}.jpg", partial(files.photo, i))
            if contents.with_photos
            else None,
            thumbnail=named(f"thumbnails/{i:05d}.jpg", partial(files.thumbnail, i)),
            mpi=named(f"mpis/{i:05d}.mpi", contents.mpis[i]) if i in contents.mpis else None,
        )
        for i in contents.indices
    ]
    cameras = [view.camera for view in views]
    start = start_of(cameras)
    poster = named("poster.jpg", partial(files.photo, contents.indices[start]))
    points = None
    if files.has_points:
        points = named(POINTS_FILE, partial(files.points, contents.indices))
    place = Place(
        title=title_of(files.recording),
        shown="light-field" if contents.mpis else "splat" if contents.splat else "place",
        views=views,
        up=up_of(cameras),
        metric=any(files.recording.has_depth) and files.recording.format not in WITHOUT_SCALE,
        points=points,
        splat=None if contents.splat is None else named(*contents.splat),
        options=client_options(files.options) if contents.mpis else None,
        start=start,
        loss_db=contents.loss_db,
        splat_loss_db=contents.splat_loss_db,
        poster=poster,
    )
    return SharedPlace(place, made)


def client_options(options: Options) -> dict[str, object]:
    """Return the options as clients are told of them."""
    return msgspec.to_builtins(options_for_clients(options))
