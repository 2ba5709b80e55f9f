"""Faults of a known place: put into a true rendering, or into the picture it is compared with.

Where a model is wrong cannot be told from pictures alone. So the live picture is the model's own
rendering, in which nothing is wrong, until something is put in.
"""

# Some functions of NumPy and OpenCV have types that pyright cannot resolve.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from peaking.benchmarks.trust.judge import Change
from peaking.benchmarks.trust.stage import COVERED, as_picture, grown, shrunk
from peaking.frame import as_float
from peaking.rendering import Rendering

VISIBLE = 0.2
"""L1 over RGB, 0…3, by which a pixel must have changed to count as wrong; below it counts as
neither wrong nor right."""

BAND_PX = 2
"""Around what is wrong, pixels count as neither wrong nor right."""

OBJECT_SHARES = 0.004, 0.12
"""Least and greatest share of the picture of an object that is recoloured."""

EDGES = 0.12, 0.2, 0.07
"""Change of colour per pixel, L1 over RGB, that bounds an object; the first that yields one."""

GHOST_PX = 7
"""How far a ghost stands beside what it is a copy of."""

TINTS = np.array(
    [[c in one for c in "rgb"] for one in ("r", "g", "b", "rg", "gb", "rb")], np.float32
)
"""Of recoloured objects: red, green, blue, yellow, cyan, magenta."""


@dataclass(frozen=True)
class Fault:
    """A live picture and a rendering that differ in a known place.

    Attributes:
        live: The picture.
        change: What is done to the rendering; None if nothing.
        wrong: What is wrong.
        right: What is not; pixels may be neither.
    """

    live: UInt8[np.ndarray, "h w 3"]
    change: Change | None
    wrong: Bool[np.ndarray, "h w"]
    right: Bool[np.ndarray, "h w"]


Maker = Callable[[Rendering, np.random.Generator], Fault | None]


def thin(rendering: Rendering, rng: np.random.Generator) -> Fault:
    """Lines of 1 to 3 px and small blobs that the model lacks."""
    live = as_picture(rendering)
    mask = np.zeros(live.shape[:2], np.uint8)
    for k in range(6):
        cv2.polylines(mask, [_wire(mask, rng)], False, 1, 1 + k % 3)
    for _ in range(8):
        at = _anywhere(mask, rng)
        cv2.circle(mask, at, int(rng.integers(2, 6)), 1, -1)
    return _in_live(rendering, _contrasting(live, rng), mask > 0)


def recoloured(rendering: Rendering, rng: np.random.Generator) -> Fault | None:
    """An object that has another colour, all over."""
    thing = an_object(rendering, rng)
    if thing is None:
        return None
    live = as_float(as_picture(rendering))
    average = live[thing].mean(axis=0)
    tint = TINTS[int(np.argmax(np.abs(TINTS - average).sum(axis=1)))]
    return _in_live(rendering, _as_bytes(0.5 * live + 0.5 * tint), thing)


def dimmed(rendering: Rendering, rng: np.random.Generator) -> Fault | None:
    """A gain of 0.55 that ends at an object's edge."""
    return _with_gain(rendering, an_object(rendering, rng), 0.55)


def lightened(rendering: Rendering, rng: np.random.Generator) -> Fault | None:
    """A gain of 1.6 that ends at an object's edge."""
    return _with_gain(rendering, an_object(rendering, rng), 1.6)


def most_dimmed(rendering: Rendering, rng: np.random.Generator) -> Fault | None:
    """A gain of 0.55 on 55 % of the width: the unchanged rest is not what is wrong."""
    height, width = rendering.depth_m.shape
    side = np.zeros((height, width), bool)
    side[:, : round(0.55 * width)] = True
    return _with_gain(rendering, side if rng.random() < 0.5 else side[:, ::-1], 0.55)


def half(rendering: Rendering, rng: np.random.Generator) -> Fault:
    """Half of the picture shows something else: the same scene, mirrored."""
    live = as_picture(rendering)
    height, width = rendering.depth_m.shape
    side = np.zeros((height, width), bool)
    side[:, : width // 2] = True
    if rng.random() < 0.5:
        side = side[:, ::-1]
    return _in_live(rendering, np.ascontiguousarray(live[::-1, ::-1]), side)


def ghosts(rendering: Rendering, rng: np.random.Generator) -> Fault:
    """A half-transparent copy beside what it is a copy of, in a part of the rendering."""
    height, width = rendering.depth_m.shape
    place = np.zeros((height, width), np.uint8)
    axes = width // 3, height // 4
    cv2.ellipse(place, _anywhere(place, rng), axes, 0, 0, 360, 1, -1)
    angle = rng.uniform(0, 2 * np.pi)
    dx, dy = (round(GHOST_PX * f(angle)) for f in (np.cos, np.sin))

    def double(shown: Rendering) -> Rendering:
        copy = np.roll(shown.rgba, (dy, dx), axis=(0, 1))
        both = np.where(place[..., None] > 0, (shown.rgba + copy) / 2, shown.rgba)
        return replace(shown, rgba=both)

    return _in_rendering(rendering, double)


def ghost_lines(rendering: Rendering, rng: np.random.Generator) -> Fault:
    """Lines of 1 to 2 px that only the rendering has."""
    mask = np.zeros(rendering.depth_m.shape, np.uint8)
    for k in range(8):
        cv2.polylines(mask, [_wire(mask, rng)], False, 1, 1 + k % 2)
    colours = as_float(_contrasting(as_picture(rendering), rng))
    return _in_rendering(rendering, _painted(mask > 0, colours))


def cracks(rendering: Rendering, rng: np.random.Generator) -> Fault:
    """Cracks of 1 to 2 px through which other parts of the scene are seen."""
    mask = np.zeros(rendering.depth_m.shape, np.uint8)
    for k in range(10):
        cv2.polylines(mask, [_wire(mask, rng)], False, 1, 1 + k % 2)
    through = np.roll(as_float(as_picture(rendering)), (37, -29), axis=(0, 1))
    return _in_rendering(rendering, _painted(mask > 0, through))


MAKERS: dict[str, Maker] = {
    "thin": thin,
    "recoloured": recoloured,
    "dimmed": dimmed,
    "lightened": lightened,
    "most_dimmed": most_dimmed,
    "half": half,
    "ghosts": ghosts,
    "ghost_lines": ghost_lines,
    "cracks": cracks,
}
"""By name, every way to make a fault; it may find no place for it."""


def an_object(rendering: Rendering, rng: np.random.Generator) -> Bool[np.ndarray, "h w"] | None:
    """Return something bounded by edges of depth or of colour; None where nothing has a fit size.

    Of the parts that are bounded by edges, one is drawn whose share of the picture is within
    `OBJECT_SHARES`.
    """
    for edge in EDGES:
        things = _things(rendering, edge)
        if things:
            return things[int(rng.integers(len(things)))]
    return None


def _things(rendering: Rendering, edge: float) -> list[Bool[np.ndarray, "h w"]]:
    height, width = rendering.depth_m.shape
    picture = cv2.GaussianBlur(as_picture(rendering), (0, 0), 1.2).astype(np.float32) / 255
    depth_m = np.where(rendering.depth_m > 0, rendering.depth_m, 100.0)
    log_depth = cv2.GaussianBlur(np.log(depth_m).astype(np.float32), (0, 0), 1.0)
    steps = [_steepness(picture[..., c]) for c in range(3)]
    edges = (np.sum(steps, axis=0) > edge) | (_steepness(log_depth) > 0.03)
    inside = ~edges & shrunk(rendering.alpha >= COVERED, 3)
    count, labels, facts, _ = cv2.connectedComponentsWithStats(
        inside.astype(np.uint8), connectivity=4
    )
    least, most = (share * height * width for share in OBJECT_SHARES)
    fit = [k for k in range(1, count) if least <= facts[k, cv2.CC_STAT_AREA] <= most]
    return [grown(labels == k, 2) for k in fit]


def _steepness(plane: Float32[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
    """Return by how much values change per pixel."""
    dy, dx = np.gradient(plane)
    return np.hypot(dx, dy)


def _wire(mask: UInt8[np.ndarray, "h w"], rng: np.random.Generator) -> np.ndarray:
    """Return the points of a line that winds a little, a third of the picture long."""
    length = max(mask.shape) / 3
    at = np.array(_anywhere(mask, rng), np.float64)
    angle = rng.uniform(0, 2 * np.pi)
    points = [at]
    for _ in range(6):
        angle += rng.normal(0, 0.25)
        at = at + length / 6 * np.array([np.cos(angle), np.sin(angle)])
        points.append(at)
    return np.round(points).astype(np.int32)


def _anywhere(mask: UInt8[np.ndarray, "h w"], rng: np.random.Generator) -> tuple[int, int]:
    height, width = mask.shape
    x = rng.uniform(0.15, 0.85) * width
    y = rng.uniform(0.15, 0.85) * height
    return int(x), int(y)


def _contrasting(
    live: UInt8[np.ndarray, "h w 3"], rng: np.random.Generator
) -> UInt8[np.ndarray, "h w 3"]:
    """Return a picture that is light where this one is dark, by what is around, and tinted."""
    around = as_float(cv2.GaussianBlur(live, (0, 0), 4.0))
    light = around.mean(axis=-1, keepdims=True) < 0.5
    tint = rng.uniform(-0.1, 0.1, 3)
    return _as_bytes(around + np.where(light, 0.4, -0.4) + tint)


def _painted(where: Bool[np.ndarray, "h w"], colours: Float32[np.ndarray, "h w 3"]) -> Change:
    opaque = np.dstack([colours, np.ones_like(colours[..., 0])])
    return lambda shown: replace(shown, rgba=np.where(where[..., None], opaque, shown.rgba))


def _with_gain(
    rendering: Rendering, where: Bool[np.ndarray, "h w"] | None, gain: float
) -> Fault | None:
    """Multiply encoded colours, as a lamp that lights this alone would about do."""
    if where is None:
        return None
    live = as_float(as_picture(rendering))
    return _in_live(rendering, _as_bytes(np.clip(gain * live, 0, 1)), where)


def _in_live(
    rendering: Rendering, other: UInt8[np.ndarray, "h w 3"], where: Bool[np.ndarray, "h w"]
) -> Fault:
    """Show something else in a part of the live picture."""
    live = as_picture(rendering)
    altered = np.where(where[..., None], other, live)
    wrong, right = _truth(as_float(altered), as_float(live), rendering)
    return Fault(altered, None, wrong, right & ~where)


def _in_rendering(rendering: Rendering, change: Change) -> Fault:
    live = as_picture(rendering)
    altered = change(rendering).rgba[..., :3]
    wrong, right = _truth(altered, rendering.rgba[..., :3], rendering)
    return Fault(live, change, wrong, right)


def _truth(
    altered: Float32[np.ndarray, "h w 3"],
    before: Float32[np.ndarray, "h w 3"],
    rendering: Rendering,
) -> tuple[Bool[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Return what is wrong, and what is certainly right, of what is covered."""
    covered = shrunk(rendering.alpha >= COVERED, BAND_PX)
    changed = np.abs(altered - before).sum(axis=-1)
    wrong = changed >= VISIBLE
    return wrong & covered, ~grown(changed > 0.01, BAND_PX) & covered


def _as_bytes(rgb: Float[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    return np.round(255 * np.clip(rgb, 0, 1)).astype(np.uint8)
