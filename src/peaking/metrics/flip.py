"""FLIP: how different two pictures look to someone who flips between them.

LDR-FLIP of Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, "FLIP: A Difference
Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020. Two paths
meet: one of colour (what the eye resolves, then a distance in a perceptually even space; section
4.1) and one of features (edges and points, which the eye compares first; section 4.2).
"""

# Some functions of NumPy and OpenCV have types that pyright cannot resolve.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float32, Float64

PIXELS_PER_DEGREE = 67.0
"""The paper's default: 0.7 m from a 0.7 m wide monitor of 3840 pixels."""

_XYZ_FROM_LINEAR_RGB = np.array(
    [
        [0.4123908, 0.35758434, 0.18048079],
        [0.21263901, 0.71516868, 0.07219232],
        [0.01933082, 0.11919478, 0.95053215],
    ]
)
XYZ_FROM_LINEAR_RGB = _XYZ_FROM_LINEAR_RGB / _XYZ_FROM_LINEAR_RGB.sum(axis=1, keepdims=True)
"""ITU-R BT.709 primaries and white D65, those of sRGB; XYZ in units of the white point's."""

_OPPONENT_FROM_XYZ = np.array([[0.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])
OPPONENT_FROM_LINEAR_RGB = _OPPONENT_FROM_XYZ @ XYZ_FROM_LINEAR_RGB
LINEAR_RGB_FROM_OPPONENT = np.linalg.inv(OPPONENT_FROM_LINEAR_RGB)
"""Y, X - Y and Y - Z: YCxCz of the paper without offset and factors, which no filter notices."""

LAB_FROM_CURVE = np.array([[0.0, 116, 0, -16], [500, -500, 0, 0], [0, 200, -200, 0]])
"""CIE L*a*b* from f(X), f(Y), f(Z) and 1."""

CONTRAST_SENSITIVITY = (
    ((1.0, 0.0047),),
    ((1.0, 0.0053),),
    ((34.1, 0.04), (13.5, 0.025)),
)
"""Gaussians (a, b) of the eye's filter of each opponent plane: a √(π/b) exp(-π² r²/b), r in degrees
(table 1 of the paper)."""

COLOUR_EXPONENT = 0.7
COLOUR_KNEE = 0.4
COLOUR_KNEE_VALUE = 0.95
"""q_c, p_c and p_t of section 4.1.3: differences above 0.4 of the largest share the last 5 %."""

FEATURE_WIDTH_DEG = 0.082
FEATURE_EXPONENT = 0.5
"""w and q_f of section 4.2."""

TINY = np.float32(1e-30)
"""Stands for zero where a logarithm is taken."""


@dataclass(frozen=True)
class _Filter:
    """A separable filter, of one of the planes y, x - y and y - z."""

    plane: int
    along_x: Float32[np.ndarray, "n"]
    along_y: Float32[np.ndarray, "m"]


def flip_mean(
    image: Float32[np.ndarray, "h w 3"],
    reference: Float32[np.ndarray, "h w 3"],
    *,
    pixels_per_degree: float = PIXELS_PER_DEGREE,
) -> float:
    """Return the mean of the FLIP map: 0 for equal pictures, at most 1; less is better.

    Raises:
        ValueError: The sizes differ, or `pixels_per_degree` is not positive.
    """
    shown = flip_map(image, reference, pixels_per_degree=pixels_per_degree)
    return float(shown.mean(dtype=np.float64))


def flip_map(
    image: Float32[np.ndarray, "h w 3"],
    reference: Float32[np.ndarray, "h w 3"],
    *,
    pixels_per_degree: float = PIXELS_PER_DEGREE,
) -> Float32[np.ndarray, "h w"]:
    """Return how different each pixel looks: 0 for equal pictures, at most 1.

    Colours are encoded (sRGB) values in 0…1; what lies outside is clipped. Outside the picture
    its rim is continued. Symmetric in the two pictures.

    Raises:
        ValueError: The sizes differ, or `pixels_per_degree` is not positive.
    """
    if image.shape != reference.shape or image.size == 0:
        raise ValueError(
            f"need two pictures of one shape (h, w, 3), got {image.shape} and {reference.shape}"
        )
    if not 0 < pixels_per_degree < float("inf"):
        raise ValueError(f"need pixels_per_degree > 0, got {pixels_per_degree}")
    filters = _filters(pixels_per_degree)
    (lab, edges, points), (lab_of_reference, edges_of_reference, points_of_reference) = (
        _seen(picture, filters) for picture in (image, reference)
    )
    feature = np.maximum(np.abs(edges - edges_of_reference), np.abs(points - points_of_reference))
    feature = cv2.pow(feature / np.float32(np.sqrt(2)), FEATURE_EXPONENT)
    colour = _colour_difference(lab, lab_of_reference)
    # colour^(1 - feature), and 0 where the colours are equal, whatever the features.
    flip = cv2.exp(cv2.log(np.maximum(colour, TINY)) * (1 - feature))
    return (flip * (colour > 0)).astype(np.float32, copy=False)


def _seen(
    picture: Float32[np.ndarray, "h w 3"], filters: tuple[_Filter, ...]
) -> tuple[Float32[np.ndarray, "3 h w"], Float32[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
    """Return what the eye makes of a picture: L*a*b* after Hunt, strengths of edges and points."""
    opponents = cv2.split(cv2.transform(_linear(np.clip(picture, 0, 1)), OPPONENT_FROM_LINEAR_RGB))
    y, x_y, y_z, y_z_narrow, edge_x, edge_y, point_x, point_y = (
        cv2.sepFilter2D(
            opponents[f.plane], cv2.CV_32F, f.along_x, f.along_y, borderType=cv2.BORDER_REPLICATE
        )
        for f in filters
    )
    linear = cv2.transform(cv2.merge([y, x_y, y_z + y_z_narrow]), LINEAR_RGB_FROM_OPPONENT)
    lab = _hunt_lab(np.clip(linear, 0, 1, out=linear))
    return lab, cv2.magnitude(edge_x, edge_y), cv2.magnitude(point_x, point_y)


def _linear(encoded: Float32[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w 3"]:
    """Return linear light of sRGB values in 0…1 (IEC 61966-2-1)."""
    curve = cv2.pow((encoded + np.float32(0.055)) / np.float32(1.055), 2.4)
    np.multiply(encoded, np.float32(1 / 12.92), out=curve, where=encoded <= 0.04045)
    return curve


def _hunt_lab(linear: Float32[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "3 h w"]:
    """Return CIE L*a*b* of linear RGB as planes, with a* and b* times L*/100 (Hunt effect)."""
    t = cv2.transform(linear, XYZ_FROM_LINEAR_RGB)
    curve = cv2.pow(t, 1 / 3)
    line = t * np.float32(841 / 108) + np.float32(4 / 29)
    np.copyto(curve, line, where=t <= np.float32(216 / 24389))
    lightness, red_green, yellow_blue = cv2.split(cv2.transform(curve, LAB_FROM_CURVE))
    hunt = lightness * np.float32(0.01)
    return np.stack([lightness, red_green * hunt, yellow_blue * hunt])


def _colour_difference(
    a: Float32[np.ndarray, "3 h w"], b: Float32[np.ndarray, "3 h w"]
) -> Float32[np.ndarray, "h w"]:
    """Return the HyAB distance, raised to a power and mapped to 0…1 (section 4.1.3)."""
    lightness, red_green, yellow_blue = a - b
    hyab = np.abs(lightness) + cv2.magnitude(red_green, yellow_blue)
    powered = cv2.pow(hyab, COLOUR_EXPONENT)
    knee = COLOUR_KNEE * _largest_difference()
    below = powered * (COLOUR_KNEE_VALUE / knee)
    slope = (1 - COLOUR_KNEE_VALUE) / (_largest_difference() - knee)
    # A concave curve of two lines is the lower of them.
    return np.minimum(below, COLOUR_KNEE_VALUE + (powered - knee) * slope)


@lru_cache(maxsize=1)
def _largest_difference() -> float:
    """Return the difference of green and blue, to the power: no colours of sRGB differ more."""
    green_and_blue = _hunt_lab(np.eye(3, dtype=np.float32)[None, 1:])
    lightness, red_green, yellow_blue = (green_and_blue[:, 0, 0] - green_and_blue[:, 0, 1]).tolist()
    return float((abs(lightness) + np.hypot(red_green, yellow_blue)) ** COLOUR_EXPONENT)


@lru_cache(maxsize=8)
def _filters(pixels_per_degree: float) -> tuple[_Filter, ...]:
    """Return the eight filters in the order that the kernel reads them."""
    widest = max(b for gaussians in CONTRAST_SENSITIVITY for _, b in gaussians)
    radius = int(np.ceil(3 * np.sqrt(widest / (2 * np.pi**2)) * pixels_per_degree))
    filters: list[_Filter] = []
    for plane, gaussians in enumerate(CONTRAST_SENSITIVITY):
        taps_of = [
            _gaussian(np.sqrt(b / 2) / np.pi * pixels_per_degree, radius) for _, b in gaussians
        ]
        masses = [
            a * np.sqrt(np.pi / b) * taps.sum() ** 2
            for (a, b), taps in zip(gaussians, taps_of, strict=True)
        ]
        for taps, mass in zip(taps_of, masses, strict=True):
            even = taps / taps.sum()
            filters.append(_filter(plane, even * mass / sum(masses), even))

    sigma_px = 0.5 * FEATURE_WIDTH_DEG * pixels_per_degree
    radius = int(np.ceil(3 * sigma_px))
    x = np.arange(-radius, radius + 1)
    smooth = _gaussian(sigma_px, radius)
    edge = _balanced(-x * smooth)
    point = _balanced((x**2 / sigma_px**2 - 1) * smooth)
    smooth /= smooth.sum()
    for along in (edge, point):
        filters += [_filter(0, along, smooth), _filter(0, smooth, along)]
    return tuple(filters)


def _gaussian(sigma_px: float, radius: int) -> Float64[np.ndarray, "n"]:
    return np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma_px) ** 2)


def _balanced(taps: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    """Return the taps, scaled so that the positive ones sum to 1 and the negative ones to -1."""
    return np.where(taps > 0, taps / taps[taps > 0].sum(), taps / -taps[taps < 0].sum())


def _filter(
    plane: int, along_x: Float64[np.ndarray, "n"], along_y: Float64[np.ndarray, "m"]
) -> _Filter:
    return _Filter(plane, along_x.astype(np.float32), along_y.astype(np.float32))
