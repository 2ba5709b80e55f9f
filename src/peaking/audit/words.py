"""The facts of a recording in words, and its path drawn with dots, for a terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from peaking.audit.facts import DepthFacts, Facts, Looks, PathFacts
from peaking.best_frames.choosing import BLURRED, UNEVEN
from peaking.datasets import Recording
from peaking.geometry import Pinhole
from peaking.replay.path_map_svg import map_view
from peaking.replay.records import FrameRecord

AGREES = 1.25
"""Depth over what pictures say, or its inverse, up to which both are called in agreement."""
MOST_NAMES = 6
MAP_COLUMNS, MAP_ROWS = 60, 16
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of a braille character, by row and column of its dots."""
_BRAILLE = 0x2800


def lines_of(recording: Recording, facts: Facts) -> list[str]:
    """Return what a recording holds, a line for each thing."""
    time = "" if facts.seconds is None else f", {facts.seconds:.1f} s"
    lines = [
        f"{recording.name}: {recording.format}, {len(recording)} frames{time}",
        *(f"  note       {note}" for note in recording.notes),
        f"  pictures   {_cameras(facts.cameras)}",
        *_path(recording, facts.path, metric=facts.depth is not None),
    ]
    lines += ["  depth      none"] if facts.depth is None else _depth(recording, facts.depth)
    if facts.with_points:
        lines.append("  points     frames bring the tracked points that they see")
    if facts.masks:
        lines.append(f"  masks      {facts.masks} of {len(recording)} frames have one")
    if facts.looks is not None:
        lines += _looks(recording, facts.looks)
    return lines


def _cameras(cameras: Sequence[Pinhole]) -> str:
    first = cameras[0]
    angle = 2 * math.degrees(math.atan(first.width_px / 2 / first.fx_px))
    more = "" if len(cameras) == 1 else f"; {len(cameras)} different cameras"
    return (
        f"{first.width_px}x{first.height_px}, focal length {first.fx_px:.0f} px "
        f"({angle:.0f}° across){more}"
    )


def _path(recording: Recording, path: PathFacts, *, metric: bool) -> list[str]:
    sides = " x ".join(f"{side:.3g}" for side in path.extent_m)
    lines = [
        f"  path       {path.length_m:.3g} m long within {sides} m; "
        f"steps {path.step_m:.3g} m and {path.turn_deg:.1f}° (median)"
    ]
    if path.distance_m is not None:
        lines.append(
            f"  distance   matched points are {path.distance_m:.3g} m away (median), by pictures "
            "and poses"
        )
    if not metric:
        lines.append("  scale      not known: no depth; m are units of the poses")
    if path.up is None:
        lines.append("  up         not known: the camera was turned about in every direction")
    else:
        lines.append(f"  up         {path.up}, by how the camera was held")
    names: list[str] = [recording.names[i] for i in path.jumps]
    said = f"{len(names)}, before {_listed(names)}" if names else "none"
    lines.append(f"  jumps      {said}")
    return lines


def _depth(recording: Recording, depth: DepthFacts) -> list[str]:
    width, height = depth.size_px
    lines = [
        f"  depth      {depth.frames} of {len(recording)} frames, {width}x{height}, "
        f"{depth.known_share:.0%} known, {depth.near_m:.2f} … {depth.far_m:.2f} m "
        f"(5 to 95 %), median {depth.median_m:.2f} m"
    ]
    ratio = depth.over_pictures
    if ratio is None:
        lines.append("  unit       taken as stated: too little of it is seen from two places")
    elif 1 / AGREES < ratio < AGREES:
        lines.append(f"  unit       right: depth is {ratio:.2f} times what pictures and poses say")
    else:
        lines.append(
            f"  unit       WRONG: depth is {ratio:.2f} times what pictures and poses say; either "
            "the unit of depth or the scale of the poses is another"
        )
    return lines


def _looks(recording: Recording, looks: Looks) -> list[str]:
    blurred: list[str] = [
        recording.names[int(i)] for i in np.flatnonzero(looks.sharpness < BLURRED)
    ]
    other = (looks.brightness > UNEVEN) | (looks.brightness < 1 / UNEVEN)
    uneven: list[str] = [recording.names[int(i)] for i in np.flatnonzero(other)]
    return [
        f"  sharpness  {_named(blurred, 'blurred beside pictures from nearby')}",
        f"  exposure   {_named(uneven, 'otherwise exposed than pictures from nearby')}",
    ]


def _named(names: Sequence[str], what: str) -> str:
    return f"{len(names)} {what}: {_listed(names)}" if names else f"none {what}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST_NAMES]) + (", …" if len(names) > MOST_NAMES else "")


def path_lines(recording: Recording) -> list[str]:
    """Return the path of the camera, drawn with dots, and how one looks at it."""
    records = [
        FrameRecord(
            index=i,
            name=recording.names[i],
            position_m=camera.position_m,
            forward=camera.forward,
            up=-camera.world_from_cam.rotation[:, 1],
            captured=False,
            reason="",
        )
        for i, camera in enumerate(recording.cameras)
    ]
    view = map_view(records)
    points_m = view.point_m(np.array([camera.position_m for camera in recording.cameras]))
    across, along = np.ptp(points_m, axis=0)
    drawn = [f"  {line}" for line in dotted_map(points_m)]
    return [*drawn, f"  the path {view.words}: {across:.3g} m by {along:.3g} m"]


def dotted_map(
    points_m: Float64[np.ndarray, "n 2"], *, columns: int = MAP_COLUMNS, rows: int = MAP_ROWS
) -> list[str]:
    """Return a path as lines of braille dots, both axes to the same scale.

    Args:
        points_m: Of the path, in order; x to the right, y up.
        columns: Characters of a line, at most.
        rows: Lines, at most.
    """
    low, high = points_m.min(axis=0), points_m.max(axis=0)
    per_m = float(np.min((2 * columns - 1, 4 * rows - 1) / np.maximum(high - low, 1e-9)))
    dots = (points_m - low) * per_m
    count = np.ceil(np.abs(np.diff(dots, axis=0)).max(axis=1, initial=0.0)).astype(int) + 1
    drawn = [dots[:1]] + [
        start + (end - start) * np.linspace(0, 1, steps + 1)[1:, None]
        for start, end, steps in zip(dots[:-1], dots[1:], count, strict=True)
    ]
    cells = np.rint(np.concatenate(drawn)).astype(int)
    width, height = cells.max(axis=0) // (2, 4) + 1
    codes = np.full((height, width), _BRAILLE)
    for x, y in cells:
        down = 4 * height - 1 - y
        codes[down // 4, x // 2] |= _DOTS[down % 4][x % 2]
    return ["".join(map(chr, row)) for row in codes]
