"""Metashape's cameras as XML (File > Export > Export Cameras): lenses, poses, and what scales them.

A camera's transform is component-from-camera, in OpenCV axes; that of its component, or of the
chunk, turns it into the world and into metres. Lenses are those of the manual's appendix "Camera
models", with corner origin: the principal point is given from the middle of the picture, P1 and P2
are OpenCV's p2 and p1, B1 is added to the focal length along x. Skew (B2) is left out where it is
less than `MOST_SKEW_PX`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from jaxtyping import Float64

from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.lens import Lens
from peaking.datasets.named_cameras import NamedCamera, NamedCameras, recording_of
from peaking.datasets.picture_files import lens_for
from peaking.datasets.posed_frames import PosedRecording
from peaking.datasets.safe_xml import xml_of
from peaking.datasets.text_tables import counted, pose_of_matrix
from peaking.errors import RecordingError
from peaking.geometry import Pinhole

MOST_SKEW_PX = 1.0
"""At the edge of the picture."""
_HEAD_BYTES = 4096
_TOOL = "Metashape"
_AGAIN = "export the cameras again from Metashape (File > Export > Export Cameras, Agisoft XML)"
_UNDISTORT = "undistort the pictures first (File > Export > Undistort Photos), and their cameras"
_FISHEYES = ("fisheye", "equidistant_fisheye")
_COEFFICIENTS = ("k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4")


@dataclass(frozen=True)
class _Similarity:
    """World from component: p_world = scale * R @ p + t."""

    rotation: Float64[np.ndarray, "3 3"]
    translation: Float64[np.ndarray, "3"]
    scale: float


def recognises(path: Path) -> bool:
    """Return whether a path is an XML file of cameras, or a folder with one."""
    return bool(_files_of(path))


def open_recording(
    root: Path, *, images: Path | None = None, confined: bool = False
) -> PosedRecording:
    """Open exported cameras with their pictures.

    Args:
        root: The XML file, or the folder that holds it.
        images: The folder of the pictures; else found beside the file by the cameras' labels.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    files = _files_of(root)
    if len(files) != 1:
        problem = "holds no cameras of Metashape's"
        if files:
            problem = f"holds cameras of Metashape's in {', '.join(one.name for one in files)}"
        raise RecordingError(root, problem, remedy="name one of the XML files")
    folder = root if root.is_dir() else root.parent
    named = _named(files[0], folder if confined else None)
    return recording_of(named, folder, images, confined=confined)


def _files_of(path: Path) -> list[Path]:
    try:
        files = sorted(path.glob("*.xml")) if path.is_dir() else [path]
    except OSError:
        return []
    return [one for one in files if one.suffix.lower() == ".xml" and _looks_like_one(one)]


def _looks_like_one(path: Path) -> bool:
    try:
        head = read_bytes(path, _HEAD_BYTES)
    except RecordingError:
        return False
    return b"<document" in head and b"<chunk" in head


def _named(path: Path, within: Path | None) -> NamedCameras:
    chunks = list(xml_of(path, within=within).iter("chunk"))
    if not chunks:
        raise RecordingError(path, "has no chunk", remedy=_AGAIN)
    chunk = max(chunks, key=lambda one: len(_aligned(one)))
    every, aligned = _cameras(chunk), _aligned(chunk)
    components = Counter(camera.get("component_id") for camera in aligned)
    largest = components.most_common(1)[0][0] if components else None
    kept = [camera for camera in aligned if camera.get("component_id") == largest]
    world = _world(path, chunk, largest)
    sensors = {one.get("id"): one for one in chunk.iter("sensor")}
    lenses = {key: _lens(path, key, sensors) for key in {one.get("sensor_id") for one in kept}}
    cameras: list[NamedCamera] = []
    for camera in kept:
        label, key = camera.get("label") or "", camera.get("sensor_id")
        numbers = _numbers(path, f"camera {label!r}", camera.findtext("transform"), 16)
        matrix = _in_world(numbers.reshape(4, 4), world)
        pose = pose_of_matrix(path, matrix, field=f"camera {label!r}")
        if pose is not None:
            fitted = partial(_fitted, path, f"sensor {key}", lenses[key])
            cameras.append(NamedCamera(label, fitted, pose))
    notes = [
        *counted(len(every) - len(aligned), "not aligned, or disabled,"),
        *counted(len(aligned) - len(kept), "of smaller components"),
        *counted(len(kept) - len(cameras), "without a finite pose"),
    ]
    if len(chunks) > 1:
        notes.append(f"of {len(chunks)} chunks the one with most cameras is read")
    if world is None:
        notes.append("its unit of length is taken for the metre: the chunk was not scaled")
    return NamedCameras(path, "metashape", cameras, notes, _TOOL)


def _cameras(chunk: Element) -> list[Element]:
    """Return all cameras, also those in groups."""
    return [one for listed in chunk.findall("cameras") for one in listed.iter("camera")]


def _aligned(chunk: Element) -> list[Element]:
    disabled = ("false", "0")
    return [
        one
        for one in _cameras(chunk)
        if one.find("transform") is not None and one.get("enabled") not in disabled
    ]


def _world(path: Path, chunk: Element, component: str | None) -> _Similarity | None:
    """Return where a component lies in the world; None where nothing tells it."""
    of_component = (
        one.find("transform")
        for listed in chunk.findall("components")
        for one in listed.iter("component")
        if one.get("id") == component
    )
    for found in (*of_component, chunk.find("transform")):
        if found is not None and found.find("rotation") is not None:
            field = "transform of the chunk"
            rotation = _numbers(path, field, found.findtext("rotation"), 9).reshape(3, 3)
            translation = _numbers(path, field, found.findtext("translation") or "0 0 0", 3)
            scale = float(_numbers(path, field, found.findtext("scale") or "1", 1)[0])
            is_turn = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4)
            finite = np.isfinite(translation).all() and np.isfinite(scale) and scale > 0
            if not (is_turn and finite and np.linalg.det(rotation) > 0):
                raise RecordingError(path, "is no similarity", field=field, remedy=_AGAIN)
            return _Similarity(rotation, translation, scale)
    return None


def _in_world(
    matrix: Float64[np.ndarray, "4 4"], world: _Similarity | None
) -> Float64[np.ndarray, "4 4"]:
    if world is None:
        return matrix
    moved = matrix.copy()
    with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers end as "not rigid"
        moved[:3, :3] = world.rotation @ matrix[:3, :3]
        moved[:3, 3] = world.scale * (world.rotation @ matrix[:3, 3]) + world.translation
    return moved


def _lens(path: Path, key: str | None, sensors: Mapping[str | None, Element]) -> Lens:
    field = f"sensor {key}"
    sensor = sensors.get(key)
    if sensor is None:
        raise RecordingError(path, "is missing, but took a picture", field=field, remedy=_AGAIN)
    found = sensor.findall("calibration")
    adjusted = [one for one in found if one.get("class") == "adjusted"]
    if not found:
        raise RecordingError(path, "has no calibration", field=field, remedy=_AGAIN)
    calibration = (adjusted or found)[-1]
    size = calibration.find("resolution")
    size = sensor.find("resolution") if size is None else size
    sides = "" if size is None else f"{size.get('width')} {size.get('height')}"
    width, height = _numbers(path, f"{field}: resolution", sides, 2)
    values = {
        name: float(_numbers(path, f"{field}: {name}", calibration.findtext(name) or "0", 1)[0])
        for name in ("f", "cx", "cy", "b1", "b2", *_COEFFICIENTS)
    }
    kind = calibration.get("type") or sensor.get("type") or "frame"
    try:
        if not np.isfinite(list(values.values())).all():
            raise ValueError(f"need finite numbers, got {values}")
        f, fx = values["f"], values["f"] + values["b1"]
        cx, cy = width / 2 + values["cx"], height / 2 + values["cy"]
        pinhole = Pinhole(round(width), round(height), fx, f, cx, cy)
    except (ValueError, OverflowError) as error:
        raise RecordingError(path, str(error), field=field, remedy=_AGAIN) from error
    if abs(values["b2"]) * height / 2 > MOST_SKEW_PX * f:
        problem = f"is skewed (b2 {values['b2']:g}), which is not undone here"
        raise RecordingError(path, problem, field=field, remedy=_UNDISTORT)
    k1, k2, k3, k4, p1, p2, p3, p4 = (values[name] for name in _COEFFICIENTS)
    if kind == "frame" and not (p3 or p4):
        return Lens(pinhole, (k1, k2, p2, p1, k3), r8=k4)
    if kind in _FISHEYES and not (p1 or p2 or p3 or p4):
        return Lens(pinhole, fisheye=(k1, k2, k3, k4))
    bends = ", ".join(f"{name} {values[name]:g}" for name in _COEFFICIENTS if values[name])
    problem = f"{kind} with {bends or 'no coefficients'} cannot be undistorted here"
    raise RecordingError(path, problem, field=field, remedy=_UNDISTORT)


def _fitted(path: Path, field: str, lens: Lens, stored_px: tuple[int, int]) -> Lens:
    return lens_for(path, field, lens, stored_px, _TOOL)


def _numbers(path: Path, field: str, text: str | None, count: int) -> Float64[np.ndarray, "count"]:
    words = (text or "").split()
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != count:
        problem = f"need {count} numbers, got {' '.join(words)[:40]!r}"
        raise RecordingError(path, problem, field=field, remedy=_AGAIN)
    return numbers
