"""A place from the sample scene, as the viewer reads it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np

from live_server import CLIENT
from peaking.datasets import open_recording
from peaking.light_field import LightField
from peaking.mpi_file import encode
from peaking.options import DEFAULT, Options
from peaking.output import encode_jpeg
from peaking.pipeline import Reconstruction
from peaking.server import wire
from peaking.server.recordings import wire_of_camera

DESK = Path(__file__).parents[1] / "scenes" / "desk"


def write_place(
    folder: Path, indices: tuple[int, ...], options: Options = DEFAULT, **changes: Any
) -> LightField:
    """Write a place of these frames of the desk; MPIs are stored without loss.

    Returns:
        What its light field is.
    """
    recording = open_recording(DESK)
    field = Reconstruction(options)
    views: list[dict[str, Any]] = []
    points: list[np.ndarray] = []
    colours: list[np.ndarray] = []
    folder.mkdir(parents=True, exist_ok=True)
    for number, index in enumerate(indices):
        frame = recording.read(index)
        field.add_view(frame)
        mpi = field.light_field.mpis[-1]
        (folder / f"{number}.mpi").write_bytes(encode(mpi, codec="lossless"))
        (folder / f"{number}.jpg").write_bytes(encode_jpeg(frame.rgb))
        height, width = frame.rgb.shape[:2]
        small = cv2.resize(frame.rgb, (90, 90 * height // width), interpolation=cv2.INTER_AREA)
        (folder / f"{number}_small.jpg").write_bytes(encode_jpeg(np.asarray(small, np.uint8)))
        views.append(
            {
                "name": f"frame {index}",
                "camera": msgspec.to_builtins(wire_of_camera(frame.camera)),
                "photo": f"{number}.jpg",
                "thumbnail": f"{number}_small.jpg",
                "mpi": f"{number}.mpi",
            }
        )
        depth_m = frame.depth_m
        assert depth_m is not None
        camera = frame.camera.resized(depth_m.shape[1], depth_m.shape[0])
        there = depth_m > 0
        in_cam_m = camera.pinhole.rays()[there] * depth_m[there][:, None]
        points.append(camera.world_from_cam.apply(in_cam_m)[::7])
        rgb = cv2.resize(frame.rgb, depth_m.shape[::-1], interpolation=cv2.INTER_AREA)
        colours.append(rgb[there][::7])
    xyz = np.concatenate(points).astype("<f4").tobytes()
    (folder / "points.bin").write_bytes(xyz + np.concatenate(colours).astype(np.uint8).tobytes())
    place = {
        "format": "peaking place",
        "version": 1,
        "title": "desk",
        "licence": "MIT",
        "up": None,
        "metric": True,
        "shown": "light-field",
        "views": views,
        "points": "points.bin",
        "splat": None,
        "options": msgspec.to_builtins(wire.options_for_clients(options)),
        "start": 0,
        "loss_db": None,
        "poster": None,
        **changes,
    }
    (folder / "place.json").write_text(json.dumps(place))
    return field.light_field


def add_viewer(folder: Path) -> None:
    """Put the built viewer beside a place, as index.html."""
    shutil.copytree(CLIENT.parent / "assets", folder / "assets", dirs_exist_ok=True)
    shutil.copyfile(CLIENT.parent / "view.html", folder / "index.html")
