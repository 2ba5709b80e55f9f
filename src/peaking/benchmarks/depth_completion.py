"""How good is completed depth, against plain upsampling of the same sensor depth?

A recording with depth at the size of its pictures is the truth where it is known. From it, the
depth of a phone is simulated: 160 samples on the longer side, edges mixed, noise that
grows with the square of the distance, holes. Recordings that bring phone-like and exact depth
(`exact_depth_file_path`, as the sample scene does) are taken as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.datasets import Recording, open_recording
from peaking.depth import complete
from peaking.errors import RecordingError
from peaking.frame import Frame, working_size_px

Completion = Callable[
    [Float32[np.ndarray, "dh dw"], UInt8[np.ndarray, "h w 3"]], Float32[np.ndarray, "h w"]
]
"""Makes depth at the picture's size from sensor depth with holes."""

SENSOR_LONG_SIDE = 160
SENSOR_BLUR_SAMPLES = 0.6
"""Standard deviation of the mixing at edges, in samples of the sensor."""

SENSOR_NOISE_PER_M = 0.005
"""Standard deviation of the noise at 1 m, in metres; it grows with the square of the distance."""

SENSOR_HOLES = 0.10
"""Part of the samples that are missing in blobs, besides those the recording lacks."""

EDGE_PX = 4
EDGE_RANGE = 0.15
"""A pixel is near an edge if disparities within ± `EDGE_PX` differ by more than this part."""


@dataclass(frozen=True)
class Row:
    """One method on one recording: means over frames. Errors are relative in disparity.

    Attributes:
        method: Name in the registry.
        mean_error: Mean of |Δ disparity| / disparity.
        rms_error: Root of the mean square of the same.
        mean_error_mm: Mean of |Δ depth|, in millimetres.
        within_2: Share of pixels whose error is below 2 %.
        within_5: Share of pixels whose error is below 5 %.
        edge_mean_error: Mean error of the pixels near depth edges.
        edge_within_5: Share of those within 5 %.
        frames: How many frames.
    """

    method: str
    mean_error: float
    rms_error: float
    mean_error_mm: float
    within_2: float
    within_5: float
    edge_mean_error: float
    edge_within_5: float
    frames: int


def nearest(
    sensor_m: Float32[np.ndarray, "dh dw"], rgb: UInt8[np.ndarray, "h w 3"]
) -> Float32[np.ndarray, "h w"]:
    """Enlarge by repeating samples; holes take the nearest known sample."""
    size_px = rgb.shape[1], rgb.shape[0]
    filled = _nearest_known(sensor_m)
    return cv2.resize(filled, size_px, interpolation=cv2.INTER_NEAREST).astype(np.float32)


def bilinear(
    sensor_m: Float32[np.ndarray, "dh dw"], rgb: UInt8[np.ndarray, "h w 3"]
) -> Float32[np.ndarray, "h w"]:
    """Interpolate disparities; holes take the nearest known sample."""
    size_px = rgb.shape[1], rgb.shape[0]
    disparity = 1.0 / _nearest_known(sensor_m)
    return 1.0 / cv2.resize(disparity, size_px, interpolation=cv2.INTER_LINEAR).astype(np.float32)


def _nearest_known(sensor_m: Float32[np.ndarray, "dh dw"]) -> Float32[np.ndarray, "dh dw"]:
    unknown = (sensor_m <= 0).astype(np.uint8)
    _, labels = cv2.distanceTransformWithLabels(
        unknown, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    values = np.zeros(labels.max() + 1, np.float32)
    values[np.asarray(labels[unknown == 0], np.intp)] = sensor_m[unknown == 0]
    return values[np.asarray(labels, np.intp)]


METHODS: Mapping[str, Completion] = {"nearest": nearest, "bilinear": bilinear, "complete": complete}
"""What `depth_quality` compares; give it more to compare more."""


def depth_quality(
    recording_root: Path,
    *,
    frames: int = 12,
    seed: int = 0,
    methods: Mapping[str, Completion] = METHODS,
) -> list[Row]:
    """Score every method on the same frames.

    Args:
        recording_root: A nerfstudio folder with depth.
        frames: At most so many frames, spread evenly.
        seed: Of the simulated sensor's noise and holes.
        methods: Name and function of everything to compare.

    Raises:
        RecordingError: The recording cannot be read, or has no depth.
        ValueError: `frames` < 1.
    """
    if frames < 1:
        raise ValueError(f"need frames >= 1, got {frames}")
    recording = open_recording(recording_root)
    rng = np.random.default_rng(seed)
    found: dict[str, list[list[float]]] = {name: [] for name in methods}
    step = max(1, len(recording) // frames)
    for index in list(range(0, len(recording), step))[:frames]:
        frame = recording.read(index)
        if frame.depth_m is None:
            continue
        small = frame.resized(*working_size_px(*frame.camera.pinhole.size_px))
        truth_m, sensor_m = _truth_and_sensor(recording, index, small, rng)
        edges = _near_edges(truth_m)
        for name, method in methods.items():
            found[name].append(_errors(method(sensor_m, small.rgb), truth_m, edges))
    if not any(found.values()):
        raise RecordingError(
            recording_root / "transforms.json",
            "no frame has depth",
            remedy="measure on a recording with depth",
        )
    return [
        Row(name, *np.nanmean(np.array(rows), axis=0).tolist(), frames=len(rows))
        for name, rows in found.items()
    ]


def _truth_and_sensor(
    recording: Recording, index: int, frame: Frame, rng: np.random.Generator
) -> tuple[Float32[np.ndarray, "h w"], Float32[np.ndarray, "dh dw"]]:
    assert frame.depth_m is not None  # asked before
    width, height = frame.camera.pinhole.size_px
    exact_m = recording.true_depth_m(index)
    if exact_m is None:
        truth_m = cv2.resize(frame.depth_m, (width, height), interpolation=cv2.INTER_NEAREST)
        return truth_m.astype(np.float32), phone_depth_m(truth_m.astype(np.float32), rng)
    at_picture = cv2.resize(exact_m, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
    return at_picture.astype(np.float32), frame.depth_m


def phone_depth_m(
    truth_m: Float32[np.ndarray, "h w"], rng: np.random.Generator
) -> Float32[np.ndarray, "dh dw"]:
    """Make of dense depth (0 = unknown) what a phone's depth sensor would give of it."""
    height, width = truth_m.shape
    scale = SENSOR_LONG_SIDE / max(height, width)
    size = round(width * scale), round(height * scale)
    known = (truth_m > 0).astype(np.float32)
    sigma = SENSOR_BLUR_SAMPLES / scale
    mixed = cv2.GaussianBlur(truth_m * known, (0, 0), sigma)
    mixed /= np.maximum(cv2.GaussianBlur(known, (0, 0), sigma), 1e-6)
    depth_m: np.ndarray = cv2.resize(mixed, size, interpolation=cv2.INTER_AREA)
    noise = cv2.GaussianBlur(rng.normal(size=depth_m.shape).astype(np.float32), (0, 0), 1.0)
    depth_m = depth_m + noise / noise.std() * SENSOR_NOISE_PER_M * depth_m**2
    blobs = cv2.GaussianBlur(rng.normal(size=depth_m.shape).astype(np.float32), (0, 0), 2.5)
    seen = cv2.resize(known, size, interpolation=cv2.INTER_AREA) > 0.5
    seen &= blobs < np.quantile(blobs, 1.0 - SENSOR_HOLES)
    return np.where(seen, depth_m, 0.0).astype(np.float32)


def _near_edges(truth_m: Float32[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    around = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), np.uint8)
    known = truth_m > 0
    farthest_m = cv2.dilate(truth_m, around)
    nearest_m = cv2.erode(np.where(known, truth_m, np.float32(1e6)), around)
    return known & (nearest_m < (1.0 - EDGE_RANGE) * farthest_m)


def _errors(
    depth_m: Float32[np.ndarray, "h w"],
    truth_m: Float32[np.ndarray, "h w"],
    edges: Bool[np.ndarray, "h w"],
) -> list[float]:
    """Return the figures of a `Row`, in its order."""
    known = truth_m > 0
    relative = np.abs(truth_m[known] / depth_m[known] - 1.0)
    at_edges = np.abs(truth_m[edges] / depth_m[edges] - 1.0)
    has_edges = len(at_edges) > 0
    return [
        float(relative.mean()),
        float(np.sqrt((relative**2).mean())),
        float(np.abs(depth_m[known] - truth_m[known]).mean() * 1e3),
        float((relative < 0.02).mean()),
        float((relative < 0.05).mean()),
        float(at_edges.mean()) if has_edges else float("nan"),
        float((at_edges < 0.05).mean()) if has_edges else float("nan"),
    ]


def as_markdown(rows: Sequence[Row]) -> str:
    """Return the rows as a table."""
    lines = [
        "| method | mean error | RMS error | mean mm | within 2 % | within 5 % "
        "| edges: mean error | edges: within 5 % |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    lines += [
        f"| {row.method} | {row.mean_error:.2%} | {row.rms_error:.2%} | {row.mean_error_mm:.1f} "
        f"| {row.within_2:.1%} | {row.within_5:.1%} "
        f"| {row.edge_mean_error:.1%} | {row.edge_within_5:.1%} |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"


def as_dict(rows: Sequence[Row]) -> list[dict[str, object]]:
    """Return the rows as plain values for a JSON file."""
    return [asdict(row) for row in rows]
