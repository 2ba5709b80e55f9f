"""RealityScan's (RealityCapture's) cameras: "Internal/External camera parameters" as CSV, or XMP.

Both give the focal length for film of 36 mm along the longer side, and the principal point from
the middle of the picture, in longer sides. A CSV has heading, pitch and roll of a camera that looks
down, its top to the north, where all are 0; an XMP the rotation from the world into OpenCV's axes,
by rows, and the camera's place. The tangential coefficients t1, t2 are OpenCV's p2, p1. (M.
Hornáček: On the coordinate systems employed ... by RealityScan, 2026, sections 3 to 5, A and B.)
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from jaxtyping import Float64

from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.lens import Lens
from peaking.datasets.named_cameras import NamedCamera, NamedCameras, recording_of
from peaking.datasets.picture_files import by_number, lens_for
from peaking.datasets.posed_frames import PosedRecording
from peaking.datasets.safe_xml import xml_of
from peaking.datasets.text_tables import counted, pose_of_matrix
from peaking.errors import RecordingError
from peaking.geometry import OPENCV_FROM_OPENGL, Pinhole
from peaking.limits import MAX_TEXT_BYTES

_FILM_MM = 36.0
_NEEDED = ("name", "x", "y", "alt", "heading", "pitch", "roll", "f")
_LENS = ("f", "px", "py", "k1", "k2", "k3", "k4", "t1", "t2")
_HEAD_BYTES, _MOST_LOOKED_AT = 65536, 20
_XMP_MARKS = (b"capturingreality.com/ns/xcr", b"Rotation")
_STRAIGHT, _DIVISION = ("", "none", "perspective"), "division"
_BROWNS = ("brown3", "brown4", "brown3t2", "brown4t2")
_TOOL = "RealityScan"
_AGAIN = "export it again from RealityScan"
_UNDISTORT = "export undistorted pictures and their cameras from RealityScan"
_UNIT = "its unit of length is taken for the metre: it is, where the project was scaled"


@dataclass(frozen=True)
class _LensValues:
    """A lens for a picture of any size: lengths are parts of the longer side.

    Attributes:
        f: Focal length for 36 mm.
        px: Principal point from the middle.
        py: The same.
        k1_k2_k3_k4: Of the polynomial.
        t1_t2: Tangential.
        division: Of the polynomial that divides.
    """

    f: float
    px: float
    py: float
    k1_k2_k3_k4: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    t1_t2: tuple[float, float] = (0.0, 0.0)
    division: float = 0.0


def recognises(path: Path) -> bool:
    """Return whether a path is a CSV of cameras, or a folder with one, or with XMP files."""
    return bool(_tables(path)) or bool(_sidecars(path))


def open_recording(
    root: Path, *, images: Path | None = None, confined: bool = False
) -> PosedRecording:
    """Open exported cameras with their pictures.

    Args:
        root: The CSV, or the folder that holds it, or the pictures with their XMP files.
        images: The folder of the pictures; else found beside the file by their names.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    tables = _tables(root)
    if len(tables) > 1:
        names = ", ".join(one.name for one in tables)
        raise RecordingError(root, f"holds cameras in {names}", remedy="name one of these files")
    folder = root if root.is_dir() else root.parent
    within = folder if confined else None
    if tables:
        named = _of_table(tables[0], within)
    else:
        sidecars = _sidecars(root)
        if not sidecars:
            problem = "holds no cameras of RealityScan's"
            raise RecordingError(root, problem, remedy="name the CSV, or the folder of XMP files")
        named = _of_sidecars(sidecars, within)
    return recording_of(named, folder, images, confined=confined)


def _tables(path: Path) -> list[Path]:
    try:
        files = sorted(path.glob("*.csv")) if path.is_dir() else [path]
    except OSError:
        return []
    return [one for one in files if one.suffix.lower() == ".csv" and _has_header(one)]


def _has_header(path: Path) -> bool:
    try:
        lines = read_bytes(path, _HEAD_BYTES).decode(errors="replace").splitlines()
    except RecordingError:
        return False
    return any(set(_NEEDED) <= set(_columns(line)) for line in lines[:2])


def _columns(line: str) -> list[str]:
    return [word.strip().lstrip("\ufeff#").strip().lower() for word in line.split(",")]


def _sidecars(path: Path) -> list[Path]:
    """Return the XMP files of a folder of pictures, where one of the first has a pose."""
    for folder in (path, path / "images"):
        try:
            files = sorted(folder.glob("*.xmp"), key=lambda one: by_number(one.name))
            if any(_has_pose(one) for one in files[:_MOST_LOOKED_AT]):
                return files
        except OSError:
            continue
    return []


def _has_pose(path: Path) -> bool:
    try:
        head = read_bytes(path, _HEAD_BYTES)
    except RecordingError:
        return False
    return all(mark in head for mark in _XMP_MARKS)


def _of_table(path: Path, within: Path | None) -> NamedCameras:
    data = read_bytes(path, within=within, at_most=MAX_TEXT_BYTES)
    lines = data.decode("utf-8-sig", errors="replace").splitlines()
    start = next(i for i in (0, 1) if set(_NEEDED) <= set(_columns(lines[i])))
    columns, cameras, rows = _columns(lines[start]), list[NamedCamera](), 0
    try:
        table = list(enumerate(csv.reader(lines[start + 1 :]), start=start + 2))
    except csv.Error as error:
        raise RecordingError(path, f"is no sound CSV ({error})", remedy=_AGAIN) from error
    for number, words in table:
        if not words or not words[0].strip():
            continue
        rows += 1
        field = f"line {number}"
        if len(words) < len(columns):
            problem = f"need {len(columns)} values, got {len(words)}"
            raise RecordingError(path, problem, field=field, remedy=_AGAIN)
        row = dict(zip(columns, (word.strip() for word in words), strict=False))
        value = {
            name: _number(path, field, row.get(name, "0")) for name in (*_NEEDED[1:], *_LENS[1:])
        }
        matrix = np.eye(4)
        matrix[:3, :3] = _rotation(value["heading"], value["pitch"], value["roll"])
        matrix[:3, 3] = value["x"], value["y"], value["alt"]
        pose = pose_of_matrix(path, matrix @ OPENCV_FROM_OPENGL, field=field)
        if pose is not None:
            f, px, py, k1, k2, k3, k4, t1, t2 = (value[name] for name in _LENS)
            lens = _LensValues(f, px, py, (k1, k2, k3, k4), (t1, t2))
            cameras.append(NamedCamera(row["name"], partial(_lens, path, field, lens), pose))
    notes = [*counted(rows - len(cameras), "without a finite pose"), _UNIT]
    return NamedCameras(path, "realityscan", cameras, notes, _TOOL)


def _rotation(heading: float, pitch: float, roll: float) -> Float64[np.ndarray, "3 3"]:
    """Return the axes of a camera (right, up, back) in east, north, up; angles in degrees."""
    with np.errstate(invalid="ignore"):
        (ch, cp, cr), (sh, sp, sr) = (
            turn(np.deg2rad([heading, pitch, roll])) for turn in (np.cos, np.sin)
        )
    clockwise = np.array([[ch, sh, 0.0], [-sh, ch, 0.0], [0.0, 0.0, 1.0]])
    nose_up = np.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
    right_down = np.array([[cr, 0.0, sr], [0.0, 1.0, 0.0], [-sr, 0.0, cr]])
    return clockwise @ nose_up @ right_down


def _of_sidecars(paths: Sequence[Path], within: Path | None) -> NamedCameras:
    cameras: list[NamedCamera] = []
    for path in paths:
        values = _xcr_values(xml_of(path, within=within))
        if "Rotation" not in values or "Position" not in values:
            continue
        matrix = np.eye(4)
        matrix[:3, :3] = _numbers(path, "xcr:Rotation", values["Rotation"], 9).reshape(3, 3).T
        matrix[:3, 3] = _numbers(path, "xcr:Position", values["Position"], 3)
        pose = pose_of_matrix(path, matrix, field="xcr:Rotation")
        if pose is not None:
            lens = partial(_lens, path, "xcr:FocalLength35mm", _lens_of_xmp(path, values))
            cameras.append(NamedCamera(path.stem, lens, pose))
    notes = [*counted(len(paths) - len(cameras), "without a pose"), _UNIT]
    return NamedCameras(paths[0].parent, "realityscan", cameras, notes, _TOOL)


def _xcr_values(root: Element) -> dict[str, str]:
    """Return what stands in attributes and elements of descriptions."""
    found: dict[str, str] = {}
    for description in root.iter("Description"):
        found |= dict(description.attrib)
        found |= {child.tag: child.text or "" for child in description}
    return found


def _lens_of_xmp(path: Path, values: Mapping[str, str]) -> _LensValues:
    if values.get("ProjectionModel", "perspective") != "perspective":
        problem = f"{values['ProjectionModel']!r} cannot be read"
        raise RecordingError(path, problem, field="xcr:ProjectionModel", remedy=_UNDISTORT)

    def number(name: str, default: str) -> float:
        return _number(path, f"xcr:{name}", values.get(name, default))

    if abs(number("Skew", "0")) > 1e-6 or abs(number("AspectRatio", "1") - 1) > 1e-6:
        problem = "skewed pixels, or such as are no squares, are not undone here"
        raise RecordingError(path, problem, field="xcr:AspectRatio", remedy=_UNDISTORT)
    film = number("FocalLength35mm", "0"), number("PrincipalPointU", "0")
    straight = _LensValues(*film, number("PrincipalPointV", "0"))
    model = values.get("DistortionModel", "")
    text = values.get("DistortionCoeficients", values.get("DistortionCoefficients", ""))
    if model in _STRAIGHT or not text.strip():
        return straight
    k1, k2, k3, k4, t1, t2 = _numbers(path, "xcr:DistortionCoeficients", text, 6).tolist()
    if model == _DIVISION:
        return _LensValues(straight.f, straight.px, straight.py, division=k1)
    if model in _BROWNS:
        return _LensValues(straight.f, straight.px, straight.py, (k1, k2, k3, k4), (t1, t2))
    problem = f"{model!r} cannot be undistorted here"
    raise RecordingError(path, problem, field="xcr:DistortionModel", remedy=_UNDISTORT)


def _lens(path: Path, field: str, values: _LensValues, stored_px: tuple[int, int]) -> Lens:
    (width, height), longer = stored_px, max(stored_px)
    focal_px = values.f / _FILM_MM * longer
    cx, cy = width / 2 + values.px * longer, height / 2 + values.py * longer
    try:
        pinhole = Pinhole(width, height, focal_px, focal_px, cx, cy)
    except ValueError as error:
        raise RecordingError(path, str(error), field=field, remedy=_AGAIN) from error
    (k1, k2, k3, k4), (t1, t2) = values.k1_k2_k3_k4, values.t1_t2
    lens = Lens(pinhole, (k1, k2, t2, t1, k3), (values.division, 0.0, 0.0), r8=k4)
    return lens_for(path, field, lens, stored_px, _TOOL)


def _number(path: Path, field: str, text: str) -> float:
    return float(_numbers(path, field, text, 1)[0])


def _numbers(path: Path, field: str, text: str, count: int) -> Float64[np.ndarray, "count"]:
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != count:
        raise RecordingError(
            path, f"need {count} numbers, got {text[:40]!r}", field=field, remedy=_AGAIN
        )
    return numbers
