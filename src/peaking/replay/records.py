"""What a replay found out, frame by frame and in sum, and the two files that programs read."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from peaking.output import plain
from peaking.reports.csv_table import csv_text

CORRECTION_COLUMNS = (
    *("correction_m", "correction_rad", "correction_failure"),
    *("corrected_position_x_m", "corrected_position_y_m", "corrected_position_z_m"),
    *("corrected_forward_x", "corrected_forward_y", "corrected_forward_z"),
    *("corrected_up_x", "corrected_up_y", "corrected_up_z"),
)


@dataclass(frozen=True, kw_only=True)
class PoseCorrection:
    """Where a frame was compared from, beside where the recording has it.

    Attributes:
        moved_m: How far that is from the recorded pose; 0 where it could not be corrected.
        turned_rad: By how much it is turned.
        failure: Why it was not corrected; None where it was.
        position_m: Where the camera was, in the world.
        forward: Viewing direction in the world, of length 1.
        up: The direction in the world that is up in the picture, of length 1.
    """

    moved_m: float
    turned_rad: float
    failure: str | None
    position_m: Float[np.ndarray, "3"]
    forward: Float[np.ndarray, "3"]
    up: Float[np.ndarray, "3"]


SHARES = ("peaked_share", "wrong_share", "unseen_share", "unfixable_share")
"""Of a frame's pixels."""


@dataclass(frozen=True, kw_only=True)
class FrameRecord:
    """One frame of a recording, as it was seen on the walk.

    Before the first view is captured there is nothing to render, so frames have no shares, no
    error and no nearest view (None); frame 0 is such a frame, and is captured if it has depth. The
    shares of a captured frame are those *before* its capture: they are the reason for it.

    Attributes:
        index: Place of the frame in the recording, from 0.
        name: Name of the frame in the recording.
        timestamp_s: When it was taken, where the recording says so.
        position_m: Where the camera was, in the world.
        forward: Viewing direction in the world, of length 1.
        up: The direction in the world that is up in the picture, of length 1.
        nearest_distance_m: Distance to the nearest captured view.
        peaked_share: Pixels that a view from here mends, 0…1 of the picture.
        wrong_share: Pixels that are shown wrongly, 0…1 of the picture; they are red.
        unseen_share: Pixels of what no captured view has seen, 0…1 of the picture.
        unfixable_share: Pixels that are wrong and that no view will help, 0…1 of the picture.
        mean_error: Mean over the picture of the error, in the error's own unit.
        captured: Whether a view was made of this frame; in the end, whether it was kept.
        reason: Why the policy decided so.
        dropped_at: The frame at which this view was given up; None if it was kept, or never taken.
        correction: How the recorded pose was corrected before the comparison; None where that was
            not tried.
        stage_ms: Milliseconds that each stage took.
    """

    index: int
    name: str
    position_m: Float[np.ndarray, "3"]
    forward: Float[np.ndarray, "3"]
    up: Float[np.ndarray, "3"]
    captured: bool
    timestamp_s: float | None = None
    nearest_distance_m: float | None = None
    peaked_share: float | None = None
    wrong_share: float | None = None
    unseen_share: float | None = None
    unfixable_share: float | None = None
    mean_error: float | None = None
    reason: str = ""
    dropped_at: int | None = None
    correction: PoseCorrection | None = None
    stage_ms: Mapping[str, float] = field(default_factory=dict[str, float])

    def __post_init__(self) -> None:
        if self.index < 0:
            raise ValueError(f"need index >= 0, got {self.index}")
        for name in ("position_m", "forward", "up"):
            vector = getattr(self, name)
            if np.shape(vector) != (3,) or not np.isfinite(vector).all():
                raise ValueError(f"need 3 finite numbers as {name}, got {vector}")
        for name in SHARES:
            share = getattr(self, name)
            if share is not None and not 0.0 <= share <= 1.0:
                raise ValueError(f"need 0 <= {name} <= 1 or None, got {share}")
        for name in ("nearest_distance_m", "mean_error"):
            number = getattr(self, name)
            if number is not None and not (math.isfinite(number) and number >= 0):
                raise ValueError(f"need a finite {name} >= 0 or None, got {number}")


@dataclass(frozen=True, kw_only=True)
class ReplayHeader:
    """What was asked for; every result file begins with it.

    Attributes:
        version: Version of peaking.
        preset: Name of the preset.
        options: Every option with its value, the preset's and the user's; may be nested.
        scene: Name of the recording.
        size_px: Width and height of the pictures that were compared.
        fps: Frames per second of the overlay video.
        threshold_share: A frame with a greater peaked share is captured.
        policy: The policy that chose the frames.
        num_views: How many views it was asked for; None where it goes by something else.
        guide: The guide whose targets were captured instead: its kind, how many targets it has and
            how many were reached, and what they follow from. None without one.
    """

    version: str
    preset: str
    options: Mapping[str, object]
    scene: str
    size_px: tuple[int, int]
    fps: float
    threshold_share: float
    policy: str = "threshold"
    num_views: int | None = None
    guide: Mapping[str, object] | None = None


@dataclass(frozen=True, kw_only=True)
class ReplaySummary:
    """A replay in a few numbers.

    Attributes:
        settings: What was asked for.
        frames: Number of frames walked.
        captured_indices: Frames that were captured, in order.
        mean_shares: Of every share in `SHARES`, by name, the mean over the frames that have one;
            None when none has.
        poses: How many recorded poses were corrected and how many could not be, and medians of how
            far; None where that was not tried.
        stage_ms: Median milliseconds of each stage, over the frames that went through it.
    """

    settings: ReplayHeader
    frames: int
    captured_indices: tuple[int, ...]
    mean_shares: Mapping[str, float | None]
    stage_ms: Mapping[str, float]
    poses: Mapping[str, float | int | None] | None = None

    @property
    def captured(self) -> int:
        """Number of captured frames."""
        return len(self.captured_indices)

    @property
    def mean_peaked_share(self) -> float | None:
        """Mean of the peaked share over the frames that have one; None when none has."""
        return self.mean_shares["peaked_share"]


def with_dropped_at(record: FrameRecord, dropped_at: Mapping[int, int]) -> FrameRecord:
    """Return the record with the frame at which its view was dropped, if it was."""
    if record.index not in dropped_at:
        return record
    return replace(record, captured=False, dropped_at=dropped_at[record.index])


def summarize(settings: ReplayHeader, records: Sequence[FrameRecord]) -> ReplaySummary:
    """Put the frames together."""
    shares = {name: _mean([getattr(r, name) for r in records]) for name in SHARES}
    medians = {
        stage: statistics.median(r.stage_ms[stage] for r in records if stage in r.stage_ms)
        for stage in stage_names(records)
    }
    return ReplaySummary(
        settings=settings,
        frames=len(records),
        captured_indices=tuple(r.index for r in records if r.captured),
        mean_shares=shares,
        stage_ms=medians,
        poses=_poses([r.correction for r in records if r.correction is not None]),
    )


def _mean(shares: Sequence[float | None]) -> float | None:
    known = [share for share in shares if share is not None]
    return statistics.fmean(known) if known else None


def _poses(
    corrections: Sequence[PoseCorrection],
) -> Mapping[str, float | int | None] | None:
    if not corrections:
        return None
    done = [correction for correction in corrections if correction.failure is None]
    return {
        "corrected": len(done),
        "failed": len(corrections) - len(done),
        "median_moved_m": statistics.median(c.moved_m for c in done) if done else None,
        "median_turned_rad": statistics.median(c.turned_rad for c in done) if done else None,
    }


def stage_names(records: Iterable[FrameRecord]) -> list[str]:
    """Return the stages that occur, in the order in which they first do."""
    return list(dict.fromkeys(stage for record in records for stage in record.stage_ms))


def write_frames_csv(path: Path, records: Sequence[FrameRecord]) -> None:
    """Write one line per frame; what a frame does not have is empty.

    Where poses were corrected, there are columns for that as well.

    Raises:
        OSError: The file cannot be written.
    """
    stages = stage_names(records)
    corrected = any(record.correction is not None for record in records)
    heads = [
        *("index", "name", "timestamp_s", "captured", "dropped_at", "reason"),
        *(*SHARES, "mean_error", "nearest_distance_m"),
        *("position_x_m", "position_y_m", "position_z_m"),
        *("forward_x", "forward_y", "forward_z", "up_x", "up_y", "up_z"),
        *(CORRECTION_COLUMNS if corrected else ()),
        *(f"ms_{stage}" for stage in stages),
    ]
    rows = [
        [
            *(r.index, r.name, "" if r.timestamp_s is None else float(r.timestamp_s)),
            *("true" if r.captured else "false", "" if r.dropped_at is None else r.dropped_at),
            r.reason,
            *(_cell(getattr(r, share)) for share in SHARES),
            *(_cell(r.mean_error), _cell(r.nearest_distance_m)),
            *(_cell(float(x)) for x in (*r.position_m, *r.forward, *r.up)),
            *(_correction_cells(r.correction) if corrected else ()),
            *(_cell(r.stage_ms.get(stage), digits=3) for stage in stages),
        ]
        for r in records
    ]
    write_text(path, csv_text([heads, *rows]))


def _correction_cells(correction: PoseCorrection | None) -> list[str]:
    if correction is None:
        return [""] * len(CORRECTION_COLUMNS)
    vectors = (*correction.position_m, *correction.forward, *correction.up)
    return [
        *(_cell(correction.moved_m), _cell(correction.turned_rad), correction.failure or ""),
        *(_cell(float(x)) for x in vectors),
    ]


def _cell(number: float | None, *, digits: int = 6) -> str:
    return "" if number is None else f"{number:.{digits}f}"


def write_summary(path: Path, summary: ReplaySummary) -> None:
    """Write the summary as JSON, the version and the configuration first.

    Raises:
        OSError: The file cannot be written.
    """
    settings = summary.settings
    document = {
        "version": settings.version,
        "preset": settings.preset,
        "options": plain(settings.options),
        "scene": settings.scene,
        "size_px": list(settings.size_px),
        "fps": settings.fps,
        "threshold_share": settings.threshold_share,
        "policy": settings.policy,
        "num_views": settings.num_views,
        **({} if settings.guide is None else {"guide": plain(settings.guide)}),
        "frames": summary.frames,
        "captured": summary.captured,
        "captured_indices": list(summary.captured_indices),
        **{f"mean_{name}": share for name, share in summary.mean_shares.items()},
        **({} if summary.poses is None else {"poses": plain(summary.poses)}),
        "stage_ms": {stage: round(ms, 3) for stage, ms in summary.stage_ms.items()},
    }
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    write_text(path, text + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a file as UTF-8; a name from a file system that is not UTF-8 gets "?" in it.

    Raises:
        OSError: As the system has it: `complete_or_absent` around it knows what to say.
    """
    path.write_bytes(text.encode("utf-8", errors="replace"))
