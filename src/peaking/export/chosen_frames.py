"""Which frames are meant: numbers, a slice, or what `peaking select` kept."""

from __future__ import annotations

import csv
from pathlib import Path

from peaking.datasets import Recording
from peaking.datasets.foreign_files import read_bytes
from peaking.errors import RecordingError

MAX_SELECTION_BYTES = 2**26
_WAYS = "give numbers (0,5,9), START:STOP:STEP, or a selection.csv of peaking select"


def frames_of_text(text: str, recording: Recording) -> list[int]:
    """Return the frames that a text means: `0,5,9`, `START:STOP:STEP` as in Python, or a .csv file.

    Raises:
        RecordingError: It means none, or some that are not there.
    """
    if text.lower().endswith(".csv"):
        return _kept(Path(text), recording)
    everything = range(len(recording))
    try:
        if ":" in text:
            parts = [int(part) if part.strip() else None for part in text.split(":")]
            chosen = list(everything[slice(*parts)])
        else:
            chosen = [everything[int(number)] for number in text.split(",")]
    except (ValueError, TypeError, IndexError):
        chosen = []
    if not chosen:
        problem = f"has no frames {text!r} among its {len(recording)}"
        raise RecordingError(recording.path, problem, remedy=_WAYS)
    return list(dict.fromkeys(chosen))


def _kept(path: Path, recording: Recording) -> list[int]:
    """Return the frames that a selection.csv keeps; names have to be those of the recording."""
    data = read_bytes(path, at_most=MAX_SELECTION_BYTES)
    chosen: list[int] = []
    try:
        for row in csv.DictReader(data.decode("utf-8").splitlines(), strict=True):
            index = int(row["index"])
            if row["kept"] == "1":
                chosen.append(index)
                if not 0 <= index < len(recording) or recording.names[index] != row["name"]:
                    problem = (
                        f"keeps frame {index}, {row['name']!r}, which {recording.name} has not"
                    )
                    raise RecordingError(path, problem, remedy="select from this recording again")
    except (ValueError, KeyError, TypeError, csv.Error) as error:
        raise RecordingError(path, "is no selection.csv", field=str(error), remedy=_WAYS) from error
    if not chosen:
        raise RecordingError(path, "keeps no frame", remedy=_WAYS)
    return list(dict.fromkeys(chosen))
