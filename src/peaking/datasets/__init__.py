"""Readers and writers of recordings on disk: nerfstudio folders, instant-ngp's flavour of them."""

from peaking.datasets.nerfstudio import Recording, open_recording, write_recording_subset

__all__ = ["Recording", "open_recording", "write_recording_subset"]
