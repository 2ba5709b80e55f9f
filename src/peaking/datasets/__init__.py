"""Recordings on disk: what one is (`recording.py`), and one file per format (`registry.py`)."""

from peaking.datasets.recording import Recording
from peaking.datasets.registry import Reading, open_recording

__all__ = ["Reading", "Recording", "open_recording"]
