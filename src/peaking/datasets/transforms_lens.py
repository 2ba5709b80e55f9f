"""The lens of a frame of transforms.json: pinholes, OpenCV's two models, and a fisheye."""

from __future__ import annotations

import math

from peaking.datasets.lens import Lens, same_aspect
from peaking.datasets.transforms_json import Fields, shown
from peaking.errors import RecordingError
from peaking.geometry import Pinhole

_SIMPLE = ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")
_FULL, _FISHEYE = "FULL_OPENCV", "OPENCV_FISHEYE"
_READ = (*_SIMPLE, _FULL, _FISHEYE)
_BENDS = ("k1", "k2", "p1", "p2", "k3")
_DIVIDED = ("k4", "k5", "k6")
_FISHEYE_BENDS = ("k1", "k2", "k3", "k4")
_ROUND_ABOUT = ("EQUIRECTANGULAR", "OMNIDIRECTIONALSTEREO_L", "OMNIDIRECTIONALSTEREO_R")
_HALF_ROUND = ("VR180_L", "VR180_R")
_FLAT = ("ORTHO", "ORTHOPHOTO", "ORTHOGRAPHIC")
_NGP_ROUND_ABOUT = ("latlong", "equirectangular")
_NGP_FTHETA = "ftheta_p0"

_UNDISTORT = "undistort the pictures first (colmap image_undistorter, or nerfstudio's own tools)"
_CUT = (
    "cut them into perspective pictures and find their poses again (ns-process-data images "
    "--camera-type equirectangular, say)"
)
_FROM_PERSPECTIVE = "render or take perspective pictures of the scene"


def lens_of(fields: Fields, stored_px: tuple[int, int]) -> Lens:
    """Return the lens of a frame for its stored picture, whose size may be a multiple of w, h.

    Raises:
        RecordingError: A field is missing or wrong, the lens is of another kind or folds the
            picture, or the picture has another aspect.
    """
    model = _model_of(fields)
    pinhole = _pinhole(fields, stored_px)
    if not same_aspect(stored_px, pinhole.size_px):
        width_px, height_px = pinhole.size_px
        raise fields.wrong(
            "w",
            f"w, h are {width_px}x{height_px}, but the picture is {stored_px[0]}x{stored_px[1]}",
            remedy="turn or crop the picture to that aspect, or correct the intrinsics",
        )
    if model == _FISHEYE:
        keys, unread = _FISHEYE_BENDS, ("p1", "p2", *_DIVIDED[1:])
        k1, k2, k3, k4 = (fields.number(key, 0.0) for key in keys)
        lens = Lens(pinhole, fisheye=(k1, k2, k3, k4))
    else:
        keys, unread = (_BENDS + _DIVIDED, ()) if model == _FULL else (_BENDS, _DIVIDED)
        k1, k2, p1, p2, k3, k4, k5, k6 = (
            fields.number(key, 0.0) if key in keys else 0.0 for key in _BENDS + _DIVIDED
        )
        lens = Lens(pinhole, (k1, k2, p1, p2, k3), (k4, k5, k6))
    for key in unread:
        if fields.number(key, 0.0) != 0:
            problem = f"only {', '.join(keys)} of {model} can be undistorted, but {key} is not 0"
            raise fields.wrong(key, problem, remedy=_UNDISTORT)
    if lens.fault is not None:
        bends = ", ".join(f"{key} {fields.number(key, 0.0):g}" for key in keys)
        raise fields.wrong(
            next((key for key in keys if fields.number(key, 0.0) != 0), "camera_model"),
            f"the lens would {lens.fault} ({bends})",
            remedy="calibrate the camera again with more pictures, or with k1 and k2 alone",
        )
    return lens.resized(*stored_px)


def _pinhole(fields: Fields, stored_px: tuple[int, int]) -> Pinhole:
    """Return the intrinsics at the size that the file states."""
    by_angle = fields.get("fl_x") is None and fields.get("camera_angle_x") is not None
    if by_angle and fields.get("w") is None and fields.get("h") is None:
        width_px, height_px = stored_px  # Blender's files hold no size
    else:
        width_px, height_px = fields.count("w"), fields.count("h")
    if by_angle:
        fx_px = width_px / 2 / math.tan(_angle_rad(fields, "camera_angle_x") / 2)
        fy_px = fx_px
        if fields.get("camera_angle_y") is not None:
            fy_px = height_px / 2 / math.tan(_angle_rad(fields, "camera_angle_y") / 2)
        cx_px, cy_px = fields.number("cx", width_px / 2), fields.number("cy", height_px / 2)
    else:
        fx_px = fields.positive("fl_x")
        fy_px = fields.positive("fl_y", fx_px)
        cx_px, cy_px = fields.number("cx"), fields.number("cy")
    return Pinhole(width_px, height_px, fx_px, fy_px, cx_px, cy_px)


def _model_of(fields: Fields) -> str:
    """Return the name of the camera model, one of those that are read.

    Raises:
        RecordingError: It is another.
    """
    for key in _NGP_ROUND_ABOUT:
        if fields.get(key):
            raise fields.wrong(key, "pictures all around cannot be read", remedy=_CUT)
    if fields.get(_NGP_FTHETA) is not None:
        problem = "lenses by an f-theta polynomial cannot be read"
        raise fields.wrong(_NGP_FTHETA, problem, remedy=_UNDISTORT)
    model = fields.text("camera_model") or _SIMPLE[-1]
    if fields.get("is_fisheye"):  # instant-ngp's way to say it
        if model not in (_SIMPLE[-1], _FISHEYE):
            remedy = "remove one of the two fields"
            raise fields.wrong(
                "is_fisheye", f"is set, but the lens is {shown(model)}", remedy=remedy
            )
        return _FISHEYE
    if model in _READ:
        return model
    raise _unread_model(fields, model)


def _unread_model(fields: Fields, model: str) -> RecordingError:
    if model in _ROUND_ABOUT + _HALF_ROUND:
        around = "all around" if model in _ROUND_ABOUT else "of half of everything around"
        problem, remedy = f"{shown(model)} cannot be read: pictures {around}", _CUT
    elif model in _FLAT:
        problem = f"{shown(model)} cannot be read: pictures without perspective"
        remedy = _FROM_PERSPECTIVE
    else:
        problem = f"{shown(model)} cannot be read: only {', '.join(_READ)}"
        remedy = _UNDISTORT
    return fields.wrong("camera_model", problem, remedy=remedy)


def _angle_rad(fields: Fields, key: str) -> float:
    angle_rad = fields.positive(key)
    if angle_rad >= math.pi:
        raise fields.wrong(key, f"need an angle in radians, below pi, got {angle_rad:g}")
    return angle_rad
