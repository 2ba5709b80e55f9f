"""Writes what was chosen: a data set, selection.csv and report.html beside it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from peaking.best_frames import BestFrames
from peaking.best_frames.choosing import FrameChoice
from peaking.best_frames.report import best_frames_page
from peaking.datasets import Recording
from peaking.output import write_atomically
from peaking.reports.csv_table import csv_text

COLUMNS = ("index", "name", "kept", "reason", "sharpness", "worth_db")


def write_best_frames(
    recording: Recording,
    best: BestFrames,
    out: Path,
    *,
    follow_links: bool = False,
    keep_exif: bool = False,
) -> None:
    """Write the data set of the frames kept, and what tells why.

    Args:
        recording: Which was chosen from.
        best: What was chosen.
        out: The folder, new or empty.
        follow_links: Copy also what links lead to from outside the recording.
        keep_exif: Keep metadata of the pictures.

    Raises:
        RecordingError: A file of the recording cannot be read or copied.
        OutputError: `out` is taken, full or not writable.
    """
    recording.write_subset(best.kept, out, follow_links=follow_links, keep_exif=keep_exif)
    write_atomically(out / "selection.csv", selection_csv(best.frames).encode())
    write_atomically(out / "report.html", best_frames_page(recording, best).encode())


def selection_csv(frames: Iterable[FrameChoice]) -> str:
    """Return what became of each frame, as selection.csv has it."""
    rows = [
        (
            frame.number,
            frame.name,
            int(frame.kept),
            frame.reason,
            None if frame.sharpness is None else round(frame.sharpness, 3),
            None if frame.worth_db is None else round(frame.worth_db, 4),
        )
        for frame in frames
    ]
    return csv_text([COLUMNS, *rows])
