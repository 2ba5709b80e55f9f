"""Small pictures of captures, kept under their checksum: a damaged one is made again."""

from __future__ import annotations

import cv2

from peaking.datasets.stored_images import read_picture
from peaking.output import encode_jpeg
from peaking.server.open_session import OpenSession

THUMBNAIL_PX = 240


def thumbnail(session: OpenSession, capture_id: str) -> bytes:
    """Return a JPEG of a capture, at most `THUMBNAIL_PX` wide and high; for a thread.

    Raises:
        UnknownCapture: The capture is not here, or was undone.
        RecordingError: Its photo cannot be read.
    """
    capture = session.shown_capture(capture_id)
    kept = session.kept_thumbnail(capture_id)
    if kept is not None:
        return kept
    rgb = read_picture(session.photo_path(capture), within=session.folder)
    height, width = rgb.shape[:2]
    scale = min(THUMBNAIL_PX / max(height, width), 1.0)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    data = encode_jpeg(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), quality=85)
    session.keep_thumbnail(capture_id, data)
    return data
