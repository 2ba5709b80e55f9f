"""What can go wrong in the world outside, as one small tree.

PeakingError
│   (both of these are a FileError: file, field, problem, remedy)
├── RecordingError      a recording (folder) or one of its files cannot be used
├── StudyError          a study's protocol, questionnaire or log cannot be used
├── MpiFileError        bytes that are not a sound .mpi file
├── SplatFileError      bytes that are not a sound .ply file of Gaussians
├── NothingToAlign      no pixel has both a metric depth and a rendered disparity
├── CamerasNotFound     COLMAP could not estimate where the pictures were taken
├── CheckpointError     a checkpoint is missing, damaged or of another network
├── OutputError         the place to write to is taken, full or not writable
├── ToolMissing         a program or extra that was asked for is not installed
├── BackendUnavailable  a compute backend that was asked for is not installed
│   (of the server, each defined beside the code that raises it, in `server`)
├── DiskFull            there is no room on the server's disk
├── UnknownSession      there is no session of this id
├── UnknownCapture      there is no capture of this id in the session
├── NotAdmitted         a paired device may not do this
├── SessionGone         the session was deleted or erased
├── NotRestorable       the files of a capture are deleted
├── UnknownParticipant  the study has no participant of this pseudonym
├── NotNow              a request does not fit the participant's step
├── Incomplete          a form of the study is not complete
│   (of the command line, in `commands/arguments.py`)
└── ArgumentError       an argument is wrong

Wrong arguments are `ValueError` and `TypeError`, as everywhere in Python. The command line turns a
`PeakingError` into one line and exit code 2.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path


class PeakingError(Exception):
    """Something outside the program is not as it has to be; the message says what to do."""


class FileError(PeakingError):
    """A file is not as it has to be: names the file, the field in it, and the remedy."""

    def __init__(self, path: Path, problem: str, *, field: str | None = None, remedy: str) -> None:
        """Make the message `path: field: problem; remedy`."""
        self.path = path
        self.field = field
        self.problem = problem
        self.remedy = remedy
        where = f"{path}: {field}" if field else f"{path}"
        super().__init__(f"{where}: {problem}; {remedy}")

    def __reduce__(self) -> tuple[Callable[..., FileError], tuple[object, ...]]:
        """Let a worker process hand it over: exceptions are made again from what they say."""
        made_again = functools.partial(type(self), field=self.field, remedy=self.remedy)
        return made_again, (self.path, self.problem)


class RecordingError(FileError):
    """A recording cannot be used."""


class StudyError(FileError):
    """A study's protocol, questionnaire or log cannot be used."""


class MpiFileError(PeakingError):
    """Bytes that are not a sound `.mpi` file."""


class SplatFileError(PeakingError):
    """Bytes that are not a sound .ply file of Gaussians."""


class NothingToAlign(PeakingError):
    """No pixel has both a metric depth and a rendered disparity."""


class CamerasNotFound(PeakingError):
    """COLMAP could not estimate where the pictures were taken."""


class CheckpointError(PeakingError):
    """A checkpoint (learned weights of a network) is missing, damaged, or of another network."""


class OutputError(PeakingError):
    """The place to write to is taken, full or not writable."""


class ToolMissing(PeakingError):
    """A program or an extra that was asked for is not installed."""


class BackendUnavailable(PeakingError):
    """A compute backend that was asked for is not installed."""
