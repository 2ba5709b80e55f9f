"""Frames of the sample scene as a phone would send them, small."""

from __future__ import annotations

from pathlib import Path

from capture_uploads import body_of, header
from peaking.datasets import open_recording
from peaking.output import depth_mm, encode_jpeg

DESK = Path(__file__).parents[1] / "scenes" / "desk"
WIDTH_PX, HEIGHT_PX = 88, 192


def upload_of_desk(index: int, size_px: tuple[int, int] = (WIDTH_PX, HEIGHT_PX)) -> bytes:
    """Return an upload of a frame of the desk, with its depth and its pose."""
    frame = open_recording(DESK).read(index).resized(*size_px)
    assert frame.depth_m is not None
    photo, depth = encode_jpeg(frame.rgb), depth_mm(frame.depth_m)
    k, rows = frame.camera.pinhole, frame.camera.world_from_cam.matrix()[:3]
    pinhole = {
        name: getattr(k, name)
        for name in ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px")
    }
    fields = header(
        photo_bytes=len(photo),
        camera={"pinhole": pinhole, "world_from_cam": rows.reshape(-1).tolist()},
        depth={"width_px": depth.shape[1], "height_px": depth.shape[0]},
    )
    return body_of(fields, photo + depth.astype("<u2").tobytes())
