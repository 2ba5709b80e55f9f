"""Cameras, lenses and points from pictures without poses: structure from motion by COLMAP.

Features are SIFT's (Lowe 2004), which need no download. Pictures are matched with their neighbours
in order and with those that hold the same visual words (Sivic & Zisserman 2003), and placed
all at once (Pan et al. 2024) or one after the other (Schönberger & Frahm 2016). The world has
COLMAP's own axes and scale.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from peaking.errors import CamerasNotFound
from peaking.geometry import Cam, Pinhole, Rigid, World
from peaking.output import encode_png
from peaking.poses import at_once
from peaking.poses.extra import hush, imported

NUM_FEATURES = 2048
EXHAUSTIVE = 60
"""So many pictures, or fewer, are all matched with each other."""
NEIGHBOURS = 8
"""Of pictures in order, each is matched with so many that follow it, and with ever rarer ones."""
SIMILAR = 8
"""Each is also matched with so many others that look alike."""
WORDS, WORD_FEATURES = 512, 40_000
"""Visual words, and from how many features they are learnt."""
GUESSED_FOCAL = 1.2
"""Focal length over the longer side of a picture that tells nothing (COLMAP's guess)."""
LENS_PICTURES = 8
"""A camera that took fewer pictures has one coefficient of distortion; else four."""
MANY, LEAST_PLACED = 30, 0.9
"""So many pictures are placed all at once, which takes a quarter of the time; where fewer than this
share has a place then, and where there are fewer, one after the other."""
MAX_POINTS = 400
"""Of the points that a picture shows, so many are kept: those that most pictures see."""
_CHUNK, _PAIRS_CHUNK = 8, 200

Progress = Callable[[str, int, int], None]
"""Told what is done, how much of it is, and of how much."""


@dataclass(frozen=True)
class Photograph:
    """A picture whose pose is looked for.

    Attributes:
        read: Decodes it, upright, at the size at which features are looked for.
        size_px: Width and height of the whole picture, upright.
        camera: Pictures with the same text were taken with the same lens at the same size.
        focal_px: Focal length in pixels of the whole picture, None where nothing tells it.
    """

    read: Callable[[], UInt8[np.ndarray, "h w 3"]]
    size_px: tuple[int, int]
    camera: str
    focal_px: float | None = None


@dataclass(frozen=True, eq=False)
class Placed:
    """Where a picture was taken, with what lens, and which points it shows."""

    pinhole: Pinhole
    k1_k2_p1_p2_k3: tuple[float, float, float, float, float]
    world_from_cam: Rigid[World, Cam]
    points: Float64[np.ndarray, "n 3"]


@dataclass(frozen=True, eq=False)
class Structure:
    """What was found.

    Attributes:
        placed: One for each picture; None where it could not be placed.
        error_px: Mean distance of points from where they were seen, in pixels of the pictures in
            which features were looked for.
    """

    placed: Sequence[Placed | None]
    error_px: float


def find_structure(
    photographs: Sequence[Photograph],
    *,
    in_order: bool,
    seed: int = 0,
    progress: Progress = lambda what, done, total: None,
) -> Structure:
    """Estimate where pictures were taken, with what lens, and points that they show.

    Args:
        photographs: At least three.
        in_order: Neighbours were taken one after the other, as in a video.
        seed: Seed of random samples.
        progress: Told how far it is.

    Raises:
        BackendUnavailable: pycolmap is not installed.
        CamerasNotFound: Fewer than three pictures could be joined.
    """
    pycolmap = imported()
    hush(pycolmap)
    pycolmap.set_random_seed(seed)
    with tempfile.TemporaryDirectory(prefix="peaking-poses-") as made:
        folder = Path(made)
        shrunk = _extract(pycolmap, photographs, folder, progress)
        database = folder / "database.db"
        words = _descriptors(pycolmap, database, len(photographs))
        pairs = pairs_to_try(words, in_order=in_order, rng=np.random.default_rng(seed))
        _match(pycolmap, database, pairs, folder, progress)
        model = _map(pycolmap, folder, seed, len(photographs), progress)
    if model is None or model.num_reg_images() < 3:
        raise CamerasNotFound(f"no three of {len(photographs)} pictures could be joined")
    placed: list[Placed | None] = [None] * len(photographs)
    for image in model.images.values():
        if image.has_pose:
            index = int(Path(image.name).stem)
            placed[index] = _placed(model, image, photographs[index], shrunk[index])
    return Structure(placed, float(model.compute_mean_reprojection_error()))


def pairs_to_try(
    descriptors: Sequence[UInt8[np.ndarray, "n 128"]],
    *,
    in_order: bool,
    rng: np.random.Generator,
) -> list[tuple[int, int]]:
    """Pair each picture with its neighbours in order and with those that look alike.

    Args:
        descriptors: Features of each picture.
        in_order: Neighbours were taken one after the other.
        rng: Draws the features from which words are learnt.
    """
    count = len(descriptors)
    if count <= EXHAUSTIVE:
        return [(a, b) for a in range(count) for b in range(a + 1, count)]
    steps = [*range(1, NEIGHBOURS + 1)]
    while in_order and steps[-1] * 2 < count:
        steps.append(steps[-1] * 2)
    pairs = {(a, a + step) for step in steps for a in range(count - step)}
    alike = _likeness(descriptors, rng)
    near = NEIGHBOURS if in_order else 0
    for index in range(count):
        alike[index, max(0, index - near) : index + near + 1] = -np.inf
        similar = SIMILAR if in_order else 3 * SIMILAR
        for other in np.argsort(-alike[index], kind="stable")[:similar].tolist():
            if np.isfinite(alike[index, other]):
                pairs.add((min(index, other), max(index, other)))
    return sorted(pairs)


def _likeness(
    descriptors: Sequence[UInt8[np.ndarray, "n 128"]], rng: np.random.Generator
) -> Float32[np.ndarray, "pictures pictures"]:
    """Return how many rare visual words two pictures share (tf-idf, cosine)."""
    every = np.concatenate(descriptors).astype(np.float32)
    if len(every) < WORDS:
        return np.zeros((len(descriptors), len(descriptors)), np.float32)
    sample = every[rng.permutation(len(every))[:WORD_FEATURES]]
    cv2.setRNGSeed(0)
    until = (cv2.TERM_CRITERIA_COUNT, 8, 0.0)
    labels = np.zeros(len(sample), np.int32)
    _, _, centres = cv2.kmeans(sample, WORDS, labels, until, 1, cv2.KMEANS_RANDOM_CENTERS)
    words = np.asarray(centres, np.float32)
    lengths = (words**2).sum(axis=1)
    counts = np.zeros((len(descriptors), WORDS), np.float32)
    for row, features in zip(counts, descriptors, strict=True):
        if len(features):
            nearest = np.argmin(lengths - 2 * features.astype(np.float32) @ words.T, axis=1)
            row += np.bincount(nearest, minlength=WORDS)
    rarity = np.log(len(descriptors) / np.maximum((counts > 0).sum(axis=0), 1))
    weighted = np.sqrt(counts) * rarity
    weighted /= np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), 1e-9)
    return (weighted @ weighted.T).astype(np.float32)


def _extract(
    pycolmap: Any, photographs: Sequence[Photograph], folder: Path, progress: Progress
) -> list[tuple[int, int]]:
    """Find features; return the size of each picture in which they were looked for."""
    pictures, database = folder / "pictures", folder / "database.db"
    cameras = {name: i for i, name in enumerate(dict.fromkeys(p.camera for p in photographs))}
    took = [sum(p.camera == name for p in photographs) for name in cameras]
    names: list[str] = []
    sizes: list[tuple[int, int]] = []
    for index, photograph in enumerate(photographs):
        rgb = photograph.read()
        number = cameras[photograph.camera]
        name = f"{number}/{index:06d}.png"
        (pictures / name).parent.mkdir(parents=True, exist_ok=True)
        (pictures / name).write_bytes(encode_png(rgb))
        names.append(name)
        sizes.append((rgb.shape[1], rgb.shape[0]))
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.sift.max_num_features = NUM_FEATURES
    for start in range(0, len(names), _CHUNK):
        progress("features", start, len(names))
        for model in ("OPENCV", "SIMPLE_RADIAL"):
            few = model == "SIMPLE_RADIAL"
            chunk = [
                name
                for name in names[start : start + _CHUNK]
                if (took[int(name.split("/")[0])] < LENS_PICTURES) == few
            ]
            if chunk:
                reader = pycolmap.ImageReaderOptions()
                reader.camera_model = model
                pycolmap.extract_features(
                    database,
                    pictures,
                    image_names=chunk,
                    camera_mode=pycolmap.CameraMode.PER_FOLDER,
                    reader_options=reader,
                    extraction_options=extraction,
                    device=pycolmap.Device.cpu,
                )
    progress("features", len(names), len(names))
    opened = pycolmap.Database.open(database)
    try:
        for image in opened.read_all_images():
            index = int(Path(image.name).stem)
            photograph, (width, height) = photographs[index], sizes[index]
            camera = opened.read_camera(image.camera_id)
            known = photograph.focal_px
            scale = max(width, height) / max(photograph.size_px)
            focal = GUESSED_FOCAL * max(width, height) if known is None else known * scale
            focals = [focal] if len(camera.params) == 4 else [focal, focal]
            rest = [0.0] * (len(camera.params) - len(focals) - 2)
            camera.params = [*focals, width / 2, height / 2, *rest]
            camera.has_prior_focal_length = known is not None
            opened.update_camera(camera)
    finally:
        opened.close()
    return sizes


def _descriptors(pycolmap: Any, database: Path, count: int) -> list[UInt8[np.ndarray, "n 128"]]:
    found: list[UInt8[np.ndarray, "n 128"]] = [np.zeros((0, 128), np.uint8)] * count
    if count <= EXHAUSTIVE:
        return found
    opened = pycolmap.Database.open(database)
    try:
        for image in opened.read_all_images():
            data = opened.read_descriptors(image.image_id).data
            found[int(Path(image.name).stem)] = np.asarray(data, np.uint8).reshape(-1, 128)
    finally:
        opened.close()
    return found


def _match(
    pycolmap: Any,
    database: Path,
    pairs: Sequence[tuple[int, int]],
    folder: Path,
    progress: Progress,
) -> None:
    names = {int(path.stem): path for path in (folder / "pictures").glob("*/*.png")}
    stored = {i: path.relative_to(folder / "pictures").as_posix() for i, path in names.items()}
    listed = folder / "pairs.txt"
    for start in range(0, len(pairs), _PAIRS_CHUNK):
        progress("matches", start, len(pairs))
        chunk = pairs[start : start + _PAIRS_CHUNK]
        lines = [f"{stored[a]} {stored[b]}\n" for a, b in chunk]
        listed.write_text("".join(lines), encoding="ascii")
        pairing = pycolmap.ImportedPairingOptions()
        pairing.match_list_path = listed
        pycolmap.match_image_pairs(database, pairing_options=pairing, device=pycolmap.Device.cpu)
    progress("matches", len(pairs), len(pairs))


def _map(pycolmap: Any, folder: Path, seed: int, count: int, progress: Progress) -> Any:
    """Return the largest reconstruction, or None."""
    database, pictures = folder / "database.db", folder / "pictures"
    if count >= MANY:
        progress("poses", 0, count)
        found = at_once.run(database, pictures, folder / "once", seed=seed)
        model = _largest([pycolmap.Reconstruction(path) for path in found])
        if model is not None and model.num_reg_images() >= LEAST_PLACED * count:
            progress("poses", count, count)
            return model
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = seed
    options.min_model_size = 3
    joined = iter(range(1, count + 1))

    def next_image() -> None:
        progress("poses", next(joined, count), count)

    models = folder / "models"
    models.mkdir()
    one_by_one = pycolmap.incremental_mapping(
        database, pictures, models, options=options, next_image_callback=next_image
    )
    progress("poses", count, count)
    return _largest(list(one_by_one.values()))


def _largest(models: Sequence[Any]) -> Any:
    return max(models, key=lambda model: model.num_reg_images(), default=None)


def _placed(model: Any, image: Any, photograph: Photograph, size_px: tuple[int, int]) -> Placed:
    matrix = np.eye(4)
    matrix[:3] = image.cam_from_world().matrix()
    cam_from_world = Rigid[Cam, World](matrix[:3, :3], matrix[:3, 3])
    params = [float(value) for value in model.cameras[image.camera_id].params]
    fx, fy, cx, cy, *bends = params if len(params) == 8 else [params[0], *params]
    k1, k2, p1, p2 = [*bends, 0.0, 0.0, 0.0][:4]
    pinhole = Pinhole(*size_px, fx, fy, cx, cy).resized(*photograph.size_px)
    return Placed(
        pinhole,
        (k1, k2, p1, p2, 0.0),
        cam_from_world.inverse(),
        np.array(list(_points(model, image))).reshape(-1, 3),
    )


def _points(model: Any, image: Any) -> Iterator[Float64[np.ndarray, "3"]]:
    observed = [point for point in image.points2D if point.has_point3D()]
    seen = [model.points3D[point.point3D_id] for point in observed]
    seen.sort(key=lambda point: -point.track.length())
    return (np.asarray(point.xyz, np.float64) for point in seen[:MAX_POINTS])
