"""Whether pictures are sharp, well exposed, and not taken twice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from peaking.audit.facts import shrunk
from peaking.audit.matches import Tracks
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.selection.blur import sharpness

THUMBNAIL_PX = (48, 36)
DARK, DARK_BRIGHTEST = 24.0, 90.0
"""Median brightness, and its 98th percentile, of 255, below which a picture is called too dark."""
CLIPPED = 250
"""In all channels, of 255: nothing is seen there."""
SAME_PLACE = 0.1
"""Of the usual distance between neighbours: nearer than that is the same place."""
SAME_PICTURE = 3.0
"""Mean difference of small pictures of the same place, of 255."""
LEAST_SHARED = 10
"""Points that two pictures share, before their brightness is compared."""


@dataclass(frozen=True)
class Look:
    """What is seen of a picture at a glance.

    Attributes:
        sharpness: `selection.blur.sharpness`.
        median: Of its brightness, 0…255.
        brightest: 98th percentile of its brightness.
        clipped_share: Of pixels that are white.
        small: The picture at 48 by 36.
    """

    sharpness: float
    median: float
    brightest: float
    clipped_share: float
    small: UInt8[np.ndarray, "36 48 3"]


def look_at(frame: Frame) -> Look:
    """Look at a picture."""
    small = shrunk(frame)
    gray = cv2.cvtColor(small.rgb, cv2.COLOR_RGB2GRAY)
    tiny = cv2.resize(small.rgb, THUMBNAIL_PX, interpolation=cv2.INTER_AREA)
    return Look(
        sharpness(small.rgb),
        float(np.median(gray)),
        float(np.percentile(gray, 98)),
        float((small.rgb.min(axis=2) >= CLIPPED).mean()),
        np.asarray(tiny, dtype=np.uint8),
    )


def gains(tracks: Tracks, count: int) -> Float64[np.ndarray, "frames"]:
    """Return how bright each picture is beside the others that see the same points; NaN: unknown.

    1 is as bright; the median over its points of its brightness over the median of all pictures'.
    """
    order = np.argsort(tracks.track, kind="stable")
    track, luma = tracks.track[order], np.log(np.maximum(tracks.luma[order], 4.0))
    starts = np.flatnonzero(np.diff(track, prepend=-1))
    middle = np.array([np.median(part) for part in np.split(luma, starts[1:])])
    off = np.full(len(luma), 0.0)
    off[order] = luma - middle[track]
    found = np.full(count, np.nan)
    for frame in range(count):
        own = off[tracks.frame == frame]
        if len(own) >= LEAST_SHARED:
            found[frame] = float(np.exp(np.median(own)))
    return found


def twins(cameras: Sequence[Camera], looks: Sequence[Look]) -> dict[int, int]:
    """Return the pictures that show what an earlier one shows from the same place, and which."""
    places = np.array([c.position_m for c in cameras])
    forwards = np.array([c.forward for c in cameras])
    ups = np.array([c.world_from_cam.rotation[:, 1] for c in cameras])
    nearest_m, nearest_rad = np.zeros(len(cameras)), np.zeros(len(cameras))
    for i in range(len(cameras)):
        away_m = np.linalg.norm(places - places[i], axis=1)
        turned = np.hypot(
            np.linalg.norm(forwards - forwards[i], axis=1), np.linalg.norm(ups - ups[i], axis=1)
        )
        away_m[i] = turned[i] = np.inf
        nearest_m[i], nearest_rad[i] = away_m.min(), turned.min()
    usual_m, usual_rad = float(np.median(nearest_m)), float(np.median(nearest_rad))
    found: dict[int, int] = {}
    for i in range(1, len(cameras)):
        away_m = np.linalg.norm(places[:i] - places[i], axis=1)
        turned = np.hypot(
            np.linalg.norm(forwards[:i] - forwards[i], axis=1),
            np.linalg.norm(ups[:i] - ups[i], axis=1),
        )
        near = np.flatnonzero(
            (away_m <= SAME_PLACE * usual_m) & (turned <= max(SAME_PLACE, 0.5) * usual_rad)
        )
        for j in (int(k) for k in near):
            apart = np.abs(looks[i].small.astype(np.float64) - looks[j].small).mean()
            if apart < SAME_PICTURE and j not in found:
                found[i] = j
                break
    return found
