"""What a camera does to a picture, which is no fault of the model: global, smooth, or known.

All of it happens in linear light, in the order of a camera: rows read one after the other, motion
blur, vignette, exposure and white balance, noise; then the curve of sRGB, 8 bits, JPEG.
"""

# Some functions of NumPy and OpenCV have types that pyright cannot resolve.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import cv2
import numpy as np
from jaxtyping import Float, Float32, Float64, UInt8

from peaking.geometry import Cam, Camera, Pinhole, Rigid

POSE_M, POSE_DEG = 0.01, 0.5
"""Most that a reported pose is off."""

SHUTTER_S, TURN_DEG_PER_S = 0.02, 30.0
"""Between the first and the last row, and how fast the camera turns meanwhile."""

BLUR_PX = 4
VIGNETTE = 0.45
"""Part of the light that the corners lose; it grows with the square of the distance."""

SHOT_NOISE, READ_NOISE = 4e-4, 2e-5
"""Variance of the noise in linear light: the first times the light, plus the second."""

JPEG_QUALITY = 60

STRIP_PX = 16
"""Rows that are rendered at one pose: 0.6° over 40 of these is 0.1 px each."""


@dataclass(frozen=True)
class Disturbance:
    """What happens to one picture; by default nothing.

    Attributes:
        gains: Of linear light, red, green, blue.
        vignette: Part of the light that the corners lose.
        blur_px: Length of the motion blur.
        noise: Whether the sensor has noise.
        jpeg: Whether the picture was compressed.
        moved: Whether the reported pose is off.
        rolling: Whether the rows were read one after the other while the camera turned.
    """

    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    vignette: float = 0.0
    blur_px: int = 0
    noise: bool = False
    jpeg: bool = False
    moved: bool = False
    rolling: bool = False


NONE = Disturbance()

DISTURBANCES: dict[str, Disturbance] = {
    "none": NONE,
    "exposure_up": Disturbance(gains=(2.0, 2.0, 2.0)),
    "exposure_down": Disturbance(gains=(0.5, 0.5, 0.5)),
    "white_warm": Disturbance(gains=(1.25, 1.0, 0.75)),
    "white_cold": Disturbance(gains=(0.8, 1.0, 1.3)),
    "vignette": Disturbance(vignette=VIGNETTE),
    "pose": Disturbance(moved=True),
    "shutter": Disturbance(rolling=True),
    "blur": Disturbance(blur_px=BLUR_PX),
    "noise": Disturbance(noise=True),
    "jpeg": Disturbance(jpeg=True),
}

TOGETHER = Disturbance(
    vignette=VIGNETTE, blur_px=BLUR_PX, noise=True, jpeg=True, moved=True, rolling=True
)
"""With gains drawn for each picture (`all_together`)."""

ALL = "all"


def disturbance(name: str, rng: np.random.Generator) -> Disturbance:
    """Return a disturbance by its name; "all" draws an exposure within ±1 EV and a white balance.

    Raises:
        KeyError: There is no such disturbance.
    """
    if name != ALL:
        return DISTURBANCES[name]
    exposure = 2.0 ** rng.uniform(-1.0, 1.0)
    warm = rng.uniform(-0.25, 0.25)
    return replace(TOGETHER, gains=(exposure * (1 + warm), exposure, exposure * (1 - warm)))


def photographed(
    rgb: UInt8[np.ndarray, "h w 3"], what: Disturbance, rng: np.random.Generator
) -> UInt8[np.ndarray, "h w 3"]:
    """Return a picture as a camera would have taken it; rows and poses are for `Turn` and `moved`.

    Args:
        rgb: The undisturbed picture.
        what: What happens to it.
        rng: Draws noise and the direction of blur.
    """
    light = linear(rgb.astype(np.float32) / np.float32(255))
    if what.blur_px > 1:
        light = cv2.filter2D(
            light, -1, _streak(what.blur_px, rng.uniform(0, np.pi)), borderType=cv2.BORDER_REPLICATE
        )
    if what.vignette > 0:
        light = light * (1 - np.float32(what.vignette) * _radius_squared(rgb))[..., None]
    light = light * np.asarray(what.gains, np.float32)
    if what.noise:
        deviation = np.sqrt(np.float32(SHOT_NOISE) * light + np.float32(READ_NOISE))
        light = light + deviation * rng.standard_normal(light.shape, dtype=np.float32)
    encoded_8bit = np.round(255 * encoded(np.clip(light, 0, 1))).astype(np.uint8)
    if replace(what, moved=False, rolling=False) == NONE:
        encoded_8bit = rgb
    return _as_jpeg(encoded_8bit) if what.jpeg else encoded_8bit


def moved(camera: Camera, rng: np.random.Generator) -> Camera:
    """Return where a device says that the camera is: off by half to all of the largest error."""
    amount = rng.uniform(0.5, 1.0)
    shift_m = amount * POSE_M * _direction(rng)
    turn = _rotation(amount * np.deg2rad(POSE_DEG) * _direction(rng))
    off: Rigid[Cam, Cam] = Rigid(turn, shift_m)
    return Camera(camera.pinhole, camera.world_from_cam @ off)


@dataclass(frozen=True)
class Turn:
    """How a camera turns while it reads its rows; the middle row is at the reported pose.

    Attributes:
        axis: In the camera, of length 1.
        angle_rad: From the first row to the last.
    """

    axis: Float64[np.ndarray, "3"]
    angle_rad: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Turn:
        """Return a turn to any side, about an axis in the picture's plane."""
        angle = rng.uniform(0, 2 * np.pi)
        axis = np.array([np.cos(angle), np.sin(angle), 0.0])
        return cls(axis, float(np.deg2rad(SHUTTER_S * TURN_DEG_PER_S)))

    def at(self, camera: Camera, part: float) -> Camera:
        """Return the camera when a part of the rows was read, 0…1."""
        turn = _rotation((part - 0.5) * self.angle_rad * self.axis)
        here: Rigid[Cam, Cam] = Rigid(turn, np.zeros(3))
        return Camera(camera.pinhole, camera.world_from_cam @ here)

    def strips(self, camera: Camera) -> list[Camera]:
        """Return the cameras that photograph a few rows each, from the top."""
        width, height = camera.pinhole.size_px
        strips: list[Camera] = []
        for top in range(0, height, STRIP_PX):
            rows = min(STRIP_PX, height - top)
            then = self.at(camera, (top + rows / 2) / height)
            pinhole = camera.pinhole.cropped(0, top, width, rows)
            strips.append(Camera(pinhole, then.world_from_cam))
        return strips

    def sources_px(self, pinhole: Pinhole) -> Float32[np.ndarray, "h w 2"]:
        """Return where each pixel was in a picture without the turn (as `cv2.remap` counts)."""
        rays = pinhole.rays()
        parts = (np.arange(pinhole.height_px) + 0.5) / pinhole.height_px
        # Small angles: the rotation is applied to first order, good to 14 µrad.
        turns = ((parts - 0.5) * self.angle_rad)[:, None, None] * self.axis
        there = rays + np.cross(np.broadcast_to(turns, rays.shape), rays)
        return (pinhole.project(there) - 0.5).astype(np.float32)


def rolled(
    picture: UInt8[np.ndarray, "h w *c"], sources_px: Float32[np.ndarray, "h w 2"], *, smooth: bool
) -> UInt8[np.ndarray, "h w *c"]:
    """Return a picture, or a mask (not smooth), as it is when its rows are read in turn."""
    how = cv2.INTER_LINEAR if smooth else cv2.INTER_NEAREST
    x, y = sources_px[..., 0], sources_px[..., 1]
    warped = cv2.remap(picture, x, y, how, borderMode=cv2.BORDER_REPLICATE)
    return cast("UInt8[np.ndarray, 'h w *c']", warped)


def linear(values: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return linear light of sRGB values in 0…1 (IEC 61966-2-1)."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def encoded(light: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return sRGB values of linear light in 0…1 (IEC 61966-2-1)."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def _streak(length_px: int, angle_rad: float) -> Float32[np.ndarray, "n n"]:
    """Return the kernel of a straight movement, of sum 1."""
    size = length_px + 3 - length_px % 2
    kernel = np.zeros((size, size), np.float64)
    for step in np.linspace(-0.5, 0.5, 8 * length_px + 1):
        x = size // 2 + step * (length_px - 1) * np.cos(angle_rad)
        y = size // 2 + step * (length_px - 1) * np.sin(angle_rad)
        left, top = int(np.floor(x)), int(np.floor(y))
        for row, column in ((top, left), (top, left + 1), (top + 1, left), (top + 1, left + 1)):
            kernel[row, column] += (1 - abs(x - column)) * (1 - abs(y - row))
    return (kernel / kernel.sum()).astype(np.float32)


def _radius_squared(rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w"]:
    """Return the squared distance from the middle, 1 in the corners."""
    height, width = rgb.shape[:2]
    y = (np.arange(height, dtype=np.float32) + 0.5 - height / 2)[:, None]
    x = (np.arange(width, dtype=np.float32) + 0.5 - width / 2)[None]
    return ((x**2 + y**2) / np.float32((height**2 + width**2) / 4)).astype(np.float32)


def _as_jpeg(rgb: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    parameters = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    _, written = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), parameters)
    read = cv2.imdecode(written, cv2.IMREAD_COLOR)
    return cv2.cvtColor(cast("UInt8[np.ndarray, 'h w 3']", read), cv2.COLOR_BGR2RGB)


def _direction(rng: np.random.Generator) -> Float64[np.ndarray, "3"]:
    v = rng.standard_normal(3)
    return v / np.linalg.norm(v)


def _rotation(turn_rad: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    """Return the rotation about a vector by its length (Rodrigues)."""
    return np.asarray(cv2.Rodrigues(turn_rad)[0], np.float64)
