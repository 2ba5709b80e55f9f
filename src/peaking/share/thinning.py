"""Which views of a light field are shared, and what is lost by leaving out the others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from peaking.best_frames import BestFrames, choose_best
from peaking.errors import OutputError
from peaking.light_field import LightField
from peaking.mpi import Mpi
from peaking.mpi_file import decode
from peaking.selection.recorded_frames import RecordedFrames
from peaking.share.compact_mpi import BETWEEN, COMPACT, WHOLE, Coding
from peaking.share.recorded_files import RecordedFiles
from peaking.share.sampling import evenly
from peaking.share.scores import psnr_db

Progress = Callable[[Sequence[int], str], Iterable[int]]
"""Wraps the numbers of frames; the text says what is done with them."""

SAMPLED = 5
"""So many multi-plane images tell how large they are."""
MOST_SCORED = 40
"""Frames on which the loss is measured."""
SURELY = 0.95
"""Of the room: what must seem to fit into it, from a few views, fits."""
AT_FIRST = 1.07
"""Times the views that seem to fit are chosen; those that are worth least go until they fit."""


@dataclass(frozen=True, eq=False)
class Thinned:
    """The views that are kept of a light field.

    Attributes:
        mpis: By the number of the frame, in the order of the recording: the bytes of each.
        loss_db: What held-out pictures lost in PSNR against the light field of all frames; None
            where nothing was left out, or where that is not known because depth was estimated.
    """

    mpis: Mapping[int, bytes]
    loss_db: float | None


def thin(
    files: RecordedFiles,
    room_bytes: int,
    num_views: int | None = None,
    *,
    other_bytes: Callable[[int], int] = lambda _: 0,
    progress: Progress = lambda numbers, _: numbers,
) -> Thinned:
    """Choose the views that show most and fit into a room.

    Where all fit as they are, they are kept so. Else their images become more compact, and where
    that is not enough, the views are chosen by what the rendering would get wrong without them
    (`peaking.best_frames`).

    Args:
        files: Of a recording, some frames of which can become views.
        room_bytes: For all views together.
        num_views: How many at most; None: as many as fit.
        other_bytes: What the view of a frame takes beside its image.
        progress: Wraps what takes long.

    Raises:
        OutputError: Not even one view fits.
        RecordingError: A frame cannot be read.
    """
    usable = files.usable
    wanted = min(num_views or len(usable), len(usable))
    coding, fitting = _coding(files, wanted, room_bytes, other_bytes)
    kept = _chosen(files, fitting, progress)
    mpis: dict[int, bytes] = {}
    sizes: dict[int, int] = {}
    for i in progress(sorted(kept), "generating"):
        mpis[i] = files.mpi(i, coding)
        sizes[i] = len(mpis[i]) + other_bytes(i)
    size = sum(sizes.values())
    if size > room_bytes and fitting == len(usable) > 1:  # nothing was chosen yet
        fitting = min(fitting - 1, max(1, int(AT_FIRST * fitting * room_bytes / size)))
        kept = _chosen(files, fitting, progress)
    while sum(sizes[i] for i in kept) > room_bytes:
        if len(kept) == 1:
            raise _too_large(files, float(sizes[kept[0]]), room_bytes)
        kept.pop()
    mpis = {i: mpis[i] for i in sorted(kept)}
    whole = len(mpis) == len(usable) and coding == WHOLE
    return Thinned(mpis, None if whole else loss_db(files, mpis, progress))


def loss_db(
    files: RecordedFiles, mpis: Mapping[int, bytes], progress: Progress = lambda numbers, _: numbers
) -> float | None:
    """Return what pictures lose in PSNR where they are shown by some views instead of all.

    Each picture is rendered from all other frames, as `.mpi` files hold them, and from the views
    that are kept; both are compared with the photograph. These are pictures that were not kept;
    where all were, each is rendered without its own view both times.

    Args:
        files: Of the recording.
        mpis: Of the views that are kept, as they are shared, by the number of their frame.
        progress: Wraps what takes long.

    Returns:
        dB; None where frames have no depth, so that the others cannot be shown.

    Raises:
        RecordingError: A frame cannot be read.
    """
    frames = _StoredFrames(files.recording, files.options)
    everything = list(frames.with_depth)
    if len(everything) < 2 or not set(mpis) <= set(everything):
        return None
    left_out = [i for i in everything if i not in mpis]
    held_out = evenly(left_out or everything, MOST_SCORED)
    kept = {i: decode(data) for i, data in mpis.items()}
    losses_db: list[float] = []
    for i in progress(held_out, "measuring what is lost"):
        frame = frames.frame(i)
        of_all = frames.render([j for j in everything if j != i], frame.camera).rgba
        views = [mpi for j, mpi in kept.items() if j != i]
        if not views:
            continue
        near = frame.camera.relative_to(files.origin_m)
        of_kept = LightField(views, files.options).render(near).rgba
        before_db, after_db = (psnr_db(rgba[..., :3], frame) for rgba in (of_all, of_kept))
        if before_db is not None and after_db is not None:
            losses_db.append(before_db - after_db)
    return float(np.mean(losses_db)) if losses_db else None


class _StoredFrames(RecordedFrames):
    """Frames whose images went through a file, as all that clients are shown do."""

    def _made(self, index: int) -> Mpi:
        return decode(WHOLE.encode(super()._made(index)))


def _coding(
    files: RecordedFiles, wanted: int, room_bytes: int, other_bytes: Callable[[int], int]
) -> tuple[Coding, int]:
    """Return how images are coded, and how many views are tried.

    It is the largest coding in which all that are wanted fit, or else the smallest.
    """
    for coding in (WHOLE, *BETWEEN):
        if _guessed_bytes(files, coding, other_bytes) * wanted <= SURELY * room_bytes:
            return coding, wanted
    each_bytes = _guessed_bytes(files, COMPACT, other_bytes)
    if each_bytes > room_bytes:
        raise _too_large(files, each_bytes, room_bytes)
    return COMPACT, min(wanted, int(AT_FIRST * room_bytes / each_bytes))


def _too_large(files: RecordedFiles, each_bytes: float, room_bytes: int) -> OutputError:
    return OutputError(
        f"{files.recording.path}: a view takes {each_bytes / 1e6:.1f} MB, and "
        f"{max(room_bytes, 0) / 1e6:.1f} MB are left for them; allow more by --max-mb"
    )


def _guessed_bytes(
    files: RecordedFiles, coding: Coding, other_bytes: Callable[[int], int]
) -> float:
    """Return how large a frame's view is in the mean, from a few."""
    sampled = evenly(files.usable, SAMPLED)
    return float(np.mean([len(files.mpi(i, coding)) + other_bytes(i) for i in sampled]))


def _chosen(files: RecordedFiles, count: int, progress: Progress) -> list[int]:
    """Return numbers of frames, the one that is worth least last."""
    if count == len(files.usable):
        return list(files.usable)
    best = choose_best(
        files.recording,
        count,
        options=files.options,
        progress=lambda numbers: progress(numbers, "choosing views"),
    )
    return sorted(best.kept, key=lambda number: -_worth_db(best, number))


def _worth_db(best: BestFrames, number: int) -> float:
    worth_db = best.frames[number].worth_db
    return 0.0 if worth_db is None else worth_db
