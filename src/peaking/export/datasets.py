"""Writes data sets: which formats there are, and the check that all go through."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from peaking.export.checking import BINARY, TEXT, check
from peaking.export.colmap import write_colmap, write_colmap_text
from peaking.export.llff import write_llff
from peaking.export.material import Material
from peaking.export.names import DatasetFormat
from peaking.export.nerfstudio import write_instant_ngp, write_nerfstudio
from peaking.export.tum import write_tum
from peaking.export.writing import Written
from peaking.output import complete_or_absent

TURNED: tuple[DatasetFormat, ...] = ("nerfstudio", "instant-ngp")
"""These have an up: +z."""

_WRITERS: Mapping[DatasetFormat, tuple[Callable[[Material, Path], Written], float]] = {
    "nerfstudio": (write_nerfstudio, BINARY),
    "colmap": (write_colmap, BINARY),
    "colmap-text": (write_colmap_text, TEXT),
    "instant-ngp": (write_instant_ngp, BINARY),
    "llff": (write_llff, BINARY),
    "tum": (write_tum, TEXT),
}


@dataclass(frozen=True)
class Exported:
    """What became of an export.

    Attributes:
        frames: So many were written.
        checked_points: So many points were projected through what was read back.
        notes: Sentences about what the format has no room for.
    """

    frames: int
    checked_points: int
    notes: tuple[str, ...]


def write_dataset(material: Material, out: Path, to: DatasetFormat) -> Exported:
    """Write frames in a format, read them back and compare; `out` appears only if all is right.

    Args:
        material: The frames.
        out: The folder, new or empty.
        to: The format.

    Raises:
        RecordingError: A frame cannot be read, or lacks what the format needs.
        OutputError: `out` is taken, full or not writable, or says something else than was meant.
    """
    writer, most_off = _WRITERS[to]
    with complete_or_absent(out) as folder:
        written = writer(material, folder)
        checked = check(folder, out, written.meant, written.read, most_off)
    lost = sum(one.num_lost for one in written.meant)
    far_m = 65535 * max(one.depth_unit_m for one in written.meant)
    notes = written.notes
    if lost:
        notes += (f"{lost} values of depth are beyond {far_m:.1f} m: unknown, for want of room",)
    return Exported(len(written.meant), checked, notes)
