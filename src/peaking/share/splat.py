"""3D Gaussians of a place: trained or read, in the place's world, pruned until they fit."""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from peaking.errors import OutputError, RecordingError
from peaking.export.splats import SplatFormat, format_of, read_splats, write_splats
from peaking.export.up import Axis, guess_up, turn
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.share.recorded_files import RecordedFiles
from peaking.share.sampling import evenly
from peaking.share.scores import MOST_PSNR_DB, psnr_db
from peaking.splat.columns import SH0, SH0_R
from peaking.splat.gaussians import Gaussians
from peaking.splat.initialisation import MIN_POINTS, surface_points
from peaking.splat.options import SplatOptions
from peaking.splat.rasterise import render
from peaking.splat.rendering import C0, CutOffs
from peaking.splat.tape import Tape
from peaking.splat.training import TrainingStep, train
from peaking.splat.turning import turned

PIXELS = 57280
"""Of the pictures that are trained on and compared with (179×320)."""
MIN_PICTURES = 3
MOST_SCORED = 40
"""Pictures on which the loss is measured."""
SURELY = 0.97
"""Of what would fit by proportion is tried next."""


@dataclass(frozen=True, eq=False)
class FittedSplat:
    """A file of Gaussians that fits.

    Attributes:
        ending: Of its name.
        data: Its bytes.
        gaussians: As they are read back from it.
    """

    ending: str
    data: bytes
    gaussians: Gaussians


def frames_of(files: RecordedFiles) -> list[Frame]:
    """Return all frames of a recording as they are trained on.

    Raises:
        RecordingError: A frame cannot be read.
    """
    return [files.small_frame(index, PIXELS) for index in range(len(files.recording))]


def trained(
    frames: Sequence[Frame],
    path: Path,
    options: SplatOptions,
    progress: Callable[[TrainingStep], None] = lambda _: None,
) -> Gaussians:
    """Return Gaussians trained on frames.

    Args:
        frames: In the place's world.
        path: Of the recording, for complaints.
        options: How to train.
        progress: Told of each step.

    Raises:
        RecordingError: There are too few pictures, or no surface is known.
    """
    if len(frames) < MIN_PICTURES:
        raise RecordingError(
            path,
            f"has {len(frames)} pictures to train on",
            remedy=f"take at least {MIN_PICTURES} pictures",
        )
    points = surface_points(frames)
    if len(points) < MIN_POINTS:
        raise RecordingError(
            path,
            "has no depth, and no surface could be matched between two pictures",
            remedy="take pictures while moving sideways, with plenty of overlap",
        )
    return train(frames, options, points=points, progress=progress)


def read_in_world(
    path: Path, frames: Sequence[Frame], origin_m: Float64[np.ndarray, "3"]
) -> Gaussians:
    """Read Gaussians of a recording, in the world of its place.

    Files may be turned upright, and need not say so: the frames tell which it is.

    Args:
        path: A file of Gaussians that were trained on the recording.
        frames: Of the recording, in the place's world.
        origin_m: Where the place's world is counted from.

    Raises:
        SplatFileError: It is no sound file of Gaussians.
        BackendUnavailable: gsply is missing.
    """
    gaussians, form = read_splats(path), format_of(path)
    candidates = [gaussians]
    up: Axis | None = guess_up([frame.camera for frame in frames])
    if up is not None:
        candidates.append(turned(gaussians, _upright_from_world(up, form).T))
    placed = [_counted_from(one, origin_m) for one in candidates]
    some = evenly(frames, 4)
    return max(placed, key=lambda one: mean_psnr_db(one, some))


def contributions(gaussians: Gaussians, cameras: Sequence[Camera]) -> Float64[np.ndarray, "n"]:
    """Return how much of the cameras' pictures each Gaussian makes up, in pixels.

    Hidden parts count nothing: it is the sum of its weights in all pixels.
    """
    parameters = gaussians.of_degree(0).parameters()
    parameters[:, SH0] = 0  # all of one grey: colours below black would have no gradient
    total, spare = np.zeros(len(gaussians)), np.zeros((2, len(gaussians)), np.float32)
    for camera in cameras:
        tape = Tape(parameters, camera.relative_to(gaussians.origin_m), CutOffs())
        by_red = np.zeros_like(tape.rgb)
        by_red[..., 0] = 1
        # A picture's red is linear in each Gaussian's: the gradient is the Gaussian's share.
        total += tape.gradients(by_red, spare[0], spare[1])[:, SH0_R] / C0
    return total


def sizes(gaussians: Gaussians) -> Float64[np.ndarray, "n"]:
    """Return opacity times area of each Gaussian: what it may show, where no camera is known."""
    largest = np.sort(gaussians.log_scales.astype(np.float64), axis=1)[:, 1:].sum(axis=1)
    return gaussians.opacities * np.exp(largest)


def fitted(
    gaussians: Gaussians, worth: Float64[np.ndarray, "n"], room_bytes: int | None
) -> FittedSplat:
    """Return the Gaussians that are worth most as a file that fits.

    It is an .spz file where the extra `formats` is installed, else a .ply.

    Args:
        gaussians: In the place's world.
        worth: Of each.
        room_bytes: For the file; None: any.

    Raises:
        OutputError: Not even one fits.
    """
    order: Int64[np.ndarray, "n"] = np.argsort(-worth, kind="stable")
    count = int((worth > 0).sum()) or len(order)
    while count >= 1:
        made = _file_of(_selected(gaussians, np.sort(order[:count])))
        if room_bytes is None or len(made.data) <= room_bytes:
            return made
        count = min(count - 1, int(SURELY * count * room_bytes / len(made.data)))
    raise OutputError(
        f"no Gaussian fits into {(room_bytes or 0) / 1e6:.1f} MB; allow more by --max-mb"
    )


def loss_db(whole: Gaussians, shared: Gaussians, frames: Sequence[Frame]) -> float:
    """Return what pictures lose in PSNR where they are rendered from what is shared."""
    some = evenly(frames, MOST_SCORED)
    return mean_psnr_db(whole, some) - mean_psnr_db(shared, some)


def mean_psnr_db(gaussians: Gaussians, frames: Sequence[Frame]) -> float:
    """Return the PSNR of renderings, averaged over the frames; degrees above 1 are not drawn."""
    drawn = gaussians.of_degree(min(gaussians.degree, 1))
    scores_db = [psnr_db(render(drawn, frame.camera).rgb, frame) for frame in frames]
    known_db = [score_db for score_db in scores_db if score_db is not None]
    return float(np.mean(known_db)) if known_db else MOST_PSNR_DB


def _file_of(gaussians: Gaussians) -> FittedSplat:
    ending = ".spz" if importlib.util.find_spec("gsply") is not None else ".ply"
    with tempfile.TemporaryDirectory(prefix="peaking-") as folder:
        path = Path(folder) / f"splat{ending}"
        write_splats(path, gaussians)
        return FittedSplat(ending, path.read_bytes(), read_splats(path))


def _selected(gaussians: Gaussians, kept: Int64[np.ndarray, "m"]) -> Gaussians:
    names = ("means_m", "log_scales", "quaternions", "opacity_logits", "sh")
    return replace(gaussians, **{name: getattr(gaussians, name)[kept] for name in names})


def _upright_from_world(up: Axis, form: SplatFormat) -> Float64[np.ndarray, "3 3"]:
    return turn(up, form.up, half_turn=form.half_turn)


def _counted_from(gaussians: Gaussians, origin_m: Float64[np.ndarray, "3"]) -> Gaussians:
    """Return Gaussians of a world in the place's, counted from its origin.

    A file that does not say where it is counted from was counted from there already.
    """
    away_m = gaussians.origin_m - origin_m if gaussians.origin_m.any() else np.zeros(3)
    means_m = (gaussians.means_m.astype(np.float64) + away_m).astype(np.float32)
    return replace(gaussians, means_m=means_m, origin_m=np.zeros(3))
