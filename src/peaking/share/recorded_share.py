"""What is shared of a recording: a light field that is thinned, 3D Gaussians that are pruned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

from peaking.share import splat as splats
from peaking.share.place import SharedPlace
from peaking.share.points import NUM_POINTS, POINT_BYTES
from peaking.share.recorded_files import RecordedFiles
from peaking.share.recorded_place import Contents, place_of_recording
from peaking.share.sampling import evenly
from peaking.share.thinning import SAMPLED, Progress, thin
from peaking.share.writing import room_for
from peaking.splat.options import SplatOptions
from peaking.splat.training import TrainingStep

Kind = Literal["light-field", "splat", "both"]

SPLAT_VIEWS = 24
"""Photographs that stand beside Gaussians."""
VIEW_BYTES = 700
"""Of a view in `place.json`, at most."""
RESERVE_BYTES = 60_000
"""For the title, the licence, the QR code, and a poster that is larger than the first."""
GAUSSIANS_SHARE = 0.5
"""Of the room, where Gaussians and a light field are shared."""


@dataclass(frozen=True)
class Wanted:
    """How a recording is shared.

    Attributes:
        kind: What is shown of it.
        out: The folder or the file.
        max_bytes: Of all together, at most.
        client_dir: The built web client.
        num_views: Views of the light field, at most; None: as many as fit.
        splat: A file of Gaussians to take instead of training.
        training: How to train, without one.
    """

    kind: Kind
    out: Path
    max_bytes: int
    client_dir: Path
    num_views: int | None = None
    splat: Path | None = None
    training: SplatOptions = field(default_factory=SplatOptions)


@dataclass(frozen=True)
class Figures:
    """What was kept, and what that cost.

    Attributes:
        views: Of the light field; None where there is none.
        of_views: That could have been kept.
        light_field_loss_db: Of held-out pictures; None where nothing was left out.
        gaussians: That are kept; None where there are none.
        of_gaussians: That were trained or read.
        splat_loss_db: Of the recording's pictures.
    """

    views: int | None = None
    of_views: int | None = None
    light_field_loss_db: float | None = None
    gaussians: int | None = None
    of_gaussians: int | None = None
    splat_loss_db: float | None = None


def share_recording(
    files: RecordedFiles,
    wanted: Wanted,
    *,
    progress: Progress = lambda numbers, _: numbers,
    trained: Callable[[TrainingStep], None] = lambda _: None,
) -> tuple[SharedPlace, Figures]:
    """Return the place of a recording so that it fits, and what was left out.

    Args:
        files: Of the recording; for a light field, some of its frames have depth.
        wanted: What, where and how large.
        progress: Wraps what takes long.
        trained: Told of each step of a training.

    Raises:
        OutputError: Nothing fits.
        PeakingError: A frame or the file of Gaussians cannot be read, or the client is not built.
    """
    contents, figures = _bare(files, wanted.kind), Figures()
    bare = place_of_recording(files, contents)
    room = room_for(bare, wanted.out, wanted.max_bytes, wanted.client_dir) - RESERVE_BYTES
    if wanted.kind != "light-field":
        of_room = 1.0 if wanted.kind == "splat" else GAUSSIANS_SHARE
        fitted, figures = _gaussians(files, wanted, int(of_room * room), trained)
        room -= len(fitted.data)
        splat = (f"splat{fitted.ending}", lambda: fitted.data)
        lost_db = figures.splat_loss_db
        contents = replace(contents, splat=splat, loss_db=lost_db, splat_loss_db=lost_db)
    if wanted.kind != "splat":
        contents, figures = _light_field(files, wanted, room, (contents, figures), progress)
    return place_of_recording(files, contents), figures


def _bare(files: RecordedFiles, kind: Kind) -> Contents:
    """Return what takes room whatever is kept."""
    if kind == "light-field":
        return Contents([0], with_photos=False)
    frames = range(len(files.recording)) if kind == "splat" else [0]
    return Contents(
        evenly(frames, SPLAT_VIEWS), splat=("splat.spz", lambda: b""), with_photos=kind == "splat"
    )


def _gaussians(
    files: RecordedFiles,
    wanted: Wanted,
    room_bytes: int,
    trained: Callable[[TrainingStep], None],
) -> tuple[splats.FittedSplat, Figures]:
    frames = splats.frames_of(files)
    if wanted.splat is None:
        whole = splats.trained(frames, files.recording.path, wanted.training, trained)
    else:
        whole = splats.read_in_world(wanted.splat, frames, files.origin_m)
    worth = splats.contributions(whole, [frame.camera for frame in frames])
    fitted = splats.fitted(whole, worth, room_bytes)
    lost_db = splats.loss_db(whole, fitted.gaussians, frames)
    figures = Figures(
        gaussians=len(fitted.gaussians), of_gaussians=len(whole), splat_loss_db=lost_db
    )
    return fitted, figures


def _light_field(
    files: RecordedFiles,
    wanted: Wanted,
    room_bytes: int,
    before: tuple[Contents, Figures],
    progress: Progress,
) -> tuple[Contents, Figures]:
    contents, figures = before
    room_bytes -= _growth_bytes(files)

    def beside(index: int) -> int:
        return len(files.thumbnail(index)) + VIEW_BYTES

    thinned = thin(files, room_bytes, wanted.num_views, other_bytes=beside, progress=progress)
    mpis = {i: partial(_same, data) for i, data in thinned.mpis.items()}
    contents = replace(contents, indices=sorted(mpis), mpis=mpis, loss_db=thinned.loss_db)
    figures = replace(
        figures,
        views=len(mpis),
        of_views=len(files.usable),
        light_field_loss_db=thinned.loss_db,
    )
    return contents, figures


def _growth_bytes(files: RecordedFiles) -> int:
    """Return how much larger the poster and the points may be than those of the first frame."""
    posters = [len(files.photo(i)) for i in evenly(files.usable, SAMPLED)]
    growth_bytes = max(0, max(posters) - len(files.photo(0)))
    if files.has_points:
        growth_bytes += NUM_POINTS * POINT_BYTES - len(files.points([0]))
    return growth_bytes


def _same(data: bytes) -> bytes:
    return data
