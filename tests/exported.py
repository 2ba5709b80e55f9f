"""Recordings for the tests of exports: a drawn room, with what each test wants of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from peaking.datasets import Recording, open_recording
from peaking.export.datasets import Exported, write_dataset
from peaking.export.material import Material
from peaking.export.names import DatasetFormat
from peaking.output import encode_jpeg, encode_png
from recordings import Room, lateral_cameras, write_recording

SIZE_PX = (64, 48)


def room(
    folder: Path, *, change: Callable[[dict[str, Any]], None] | None = None, with_depth: bool = True
) -> Path:
    """Write a room of six frames, and change its transforms.json."""
    write_recording(
        folder, num_frames=6, width_px=SIZE_PX[0], height_px=SIZE_PX[1], with_depth=with_depth
    )
    if change is not None:
        path = folder / "transforms.json"
        content = json.loads(path.read_text())
        change(content)
        path.write_text(json.dumps(content))
    return folder


def masked_room(folder: Path, *, frames: tuple[int, ...] = (1, 3)) -> Path:
    """Write a room in which the left half of some frames does not count."""

    def with_masks(content: dict[str, Any]) -> None:
        for number in frames:
            content["frames"][number]["mask_path"] = f"masks/{number}.png"

    room(folder, change=with_masks)
    (folder / "masks").mkdir()
    mask = np.zeros(SIZE_PX[::-1], np.uint8)
    mask[:, SIZE_PX[0] // 2 :] = 255
    for number in frames:
        (folder / f"masks/{number}.png").write_bytes(encode_png(mask))
    return folder


def jpeg_room(folder: Path) -> Path:
    """Write a room whose pictures are JPEG files."""

    def to_jpeg(content: dict[str, Any]) -> None:
        for frame, camera in zip(content["frames"], lateral_cameras(6, *SIZE_PX), strict=True):
            rgb, _ = Room().photographed(camera)
            frame["file_path"] = frame["file_path"].replace(".png", ".jpg")
            (folder / frame["file_path"]).write_bytes(encode_jpeg(rgb, quality=80))

    return room(folder, change=to_jpeg)


def export(source: Path | Recording, out: Path, to: DatasetFormat, **options: Any) -> Exported:
    """Write all frames of a recording."""
    recording = open_recording(source) if isinstance(source, Path) else source
    options.setdefault("indices", range(len(recording)))
    return write_dataset(Material(recording, **options), out, to)
