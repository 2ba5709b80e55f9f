"""Pictures, depth and labels of a drawn scene, by Mitsuba 3."""

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import drjit as dr
import mitsuba as mi
import mitsuba_oidn
import numpy as np

from peaking.photographers.drawn.mesh import Pose
from peaking.photographers.drawn.parts import Part

WIDTH_PX, HEIGHT_PX = 294, 639
FOV_X_DEG = 45.93
FOCAL_PX = WIDTH_PX / 2 / np.tan(np.radians(FOV_X_DEG / 2))
LENS_BLUR_PX = 0.56
GUIDE_STEPS = 3
"""The denoiser's guides (albedo, normals) have this many samples along each side of a pixel."""
OTHER, MIRROR_LIKE, GLASS_LIKE, MOVING, OVEREXPOSED = range(5)

Maker = Callable[[np.random.Generator], dict[str, Any]]


@dataclass(frozen=True)
class DrawnScene:
    """A model, and the names of the shapes that break the rules."""

    model: mi.Scene
    mirrors: tuple[str, ...] = ()
    glasses: tuple[str, ...] = ()
    moving: tuple[str, ...] = ()
    """These are meshes that stand at the origin until `MovingParts` places them."""


@dataclass(frozen=True)
class FirstHit:
    """What the rays through the pixel centres meet; all `height width`."""

    exact_m: np.ndarray
    """Depth along the optical axis of the first surface."""
    seen_m: np.ndarray
    """As a depth sensor sees it: through the glass, and into the mirror."""
    material: np.ndarray
    """Labels, uint8."""


def build_model(lights: dict[str, Any], makers: Sequence[Maker], seed: int) -> mi.Scene:
    """The whole model; every part has its own generator, so that one can change alone."""
    model: dict[str, Any] = {"type": "scene"} | _as_mitsuba(lights)
    for k, make in enumerate(makers):
        model |= _as_mitsuba(make(np.random.default_rng((seed, k))))
    # The order of the lights decides the noise: optimize=True leaves it to chance, and the shipped
    # pictures were rendered with the last light first.
    return mi.load_dict(dict(reversed(model.items())), parallel=False, optimize=False)


def _as_mitsuba(value: Any) -> Any:
    """Plain data of a scene with Mitsuba's own types in it."""
    if isinstance(value, Part):
        return _mesh(value)
    if not isinstance(value, dict):
        return value
    made = {key: _as_mitsuba(inner) for key, inner in value.items()}
    if "bitmap" in made:
        made["bitmap"] = mi.Bitmap(made["bitmap"])
    if "to_world" in made:
        made["to_world"] = mi.ScalarTransform4f(made["to_world"])
    return made


def _mesh(part: Part) -> mi.Mesh:
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(_as_mitsuba(part.bsdf))
    mesh = mi.Mesh(
        part.name,
        len(part.points_m),
        len(part.faces),
        has_vertex_normals=part.normals is not None,
        has_vertex_texcoords=True,
        props=properties,
    )
    params = mi.traverse(mesh)
    params["vertex_positions"] = part.points_m.astype(np.float32).ravel()
    params["vertex_texcoords"] = part.uvs.astype(np.float32).ravel()
    params["faces"] = part.faces.astype(np.uint32).ravel()
    if part.normals is not None:
        params["vertex_normals"] = part.normals.astype(np.float32).ravel()
    params.update()
    return mesh


class MovingParts:
    """The meshes of a scene that stand somewhere else in every frame."""

    def __init__(self, scene: DrawnScene) -> None:
        self._params = mi.traverse(scene.model)
        keys = (
            f"{name}.vertex_{kind}s" for name in scene.moving for kind in ("position", "normal")
        )
        self._at_origin = {
            key: np.array(self._params[key]).reshape(-1, 3) for key in keys if key in self._params
        }

    def place(self, pose: Pose) -> None:
        """Move the meshes from the origin to `pose`."""
        for key, values in self._at_origin.items():
            turned = values @ pose.rotation().T
            moved = turned + np.asarray(pose.at_m) if key.endswith("positions") else turned
            self._params[key] = moved.astype(np.float32).ravel()
        self._params.update()


def phone_camera() -> mi.Sensor:
    """The pinhole camera, at the origin."""
    return mi.load_dict(
        {
            "type": "perspective",
            "fov": FOV_X_DEG,
            "fov_axis": "x",
            "near_clip": 0.05,
            "film": {
                "type": "hdrfilm", "width": WIDTH_PX, "height": HEIGHT_PX, "pixel_format": "rgb",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent"},
        }
    )  # fmt: skip


def render_linear(
    scene: DrawnScene, sensor: mi.Sensor, pose: np.ndarray, *, spp: int, seed: int
) -> np.ndarray:
    """Denoised radiance, `height width 3`."""
    axes = np.diag((-1.0, 1.0, -1.0, 1.0))  # Mitsuba's camera looks along +z with x to the left
    place = mi.traverse(sensor)
    place["to_world"] = mi.Transform4f((pose @ axes).astype(np.float32))
    dr.make_opaque(place["to_world"])  # a literal would compile the kernels anew for each frame
    place.update()
    path = mi.load_dict({"type": "path", "max_depth": 7, "rr_depth": 4})
    noisy = np.array(mi.render(scene.model, sensor=sensor, integrator=path, spp=spp, seed=seed))
    albedo, normal = _denoiser_guides(scene, pose)
    return np.array(mitsuba_oidn.denoise(noisy, albedo=albedo, normal=normal, hdr=True))


def _denoiser_guides(scene: DrawnScene, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Albedo and normals, averaged over each pixel; in the mirror, those of the mirrored scene."""
    size_px = (WIDTH_PX, HEIGHT_PX)
    total = np.zeros((2, HEIGHT_PX, WIDTH_PX, 3), np.float32)
    steps = (np.arange(GUIDE_STEPS) + 0.5) / GUIDE_STEPS
    for right, down in itertools.product(steps, steps):
        ray, _ = pixel_rays(pose, size_px, (right, down))
        hit = scene.model.ray_intersect(ray)
        on_mirror = _is_one_of(scene, hit, scene.mirrors)
        mirrored = hit.spawn_ray(ray.d - 2 * dr.dot(ray.d, hit.n) * hit.n)
        hit = dr.select(on_mirror, scene.model.ray_intersect(mirrored, on_mirror), hit)
        albedo = hit.bsdf().eval_diffuse_reflectance(hit, hit.is_valid())
        normal = hit.sh_frame.n
        dr.eval(albedo, normal)  # together: the rays are shot once
        for k, value in enumerate((albedo, normal)):
            total[k] += np.array(value).T.reshape(HEIGHT_PX, WIDTH_PX, 3)
    total /= GUIDE_STEPS**2
    return total[0], total[1]


def pixel_rays(
    pose: np.ndarray, size_px: tuple[int, int], offset: tuple[float, float] = (0.5, 0.5)
) -> tuple[mi.Ray3f, np.ndarray]:
    """Rays through the pixels of a picture of any size that covers the camera's field of view.

    Each goes through its pixel at this offset (right, down) from its corner. Returned with them is
    the depth per metre of each ray.
    """
    wide, high = size_px
    v, u = np.mgrid[0:high, 0:wide]
    x = ((u + offset[0]) * (WIDTH_PX / wide) - WIDTH_PX / 2) / FOCAL_PX
    y = ((v + offset[1]) * (HEIGHT_PX / high) - HEIGHT_PX / 2) / FOCAL_PX
    toward = np.stack([x, -y, -np.ones_like(x)], -1).reshape(-1, 3) @ pose[:3, :3].T
    depth_per_m = 1.0 / np.linalg.norm(toward, axis=1)
    toward *= depth_per_m[:, None]
    origin = (mi.Float(np.array([c], np.float32)) for c in pose[:3, 3])
    return mi.Ray3f(mi.Point3f(*origin), mi.Vector3f(*toward.T.astype(np.float32))), depth_per_m


def _is_one_of(scene: DrawnScene, hit: mi.SurfaceInteraction3f, names: Iterable[str]) -> mi.Bool:
    """Where the hit lies on a shape of one of these names."""
    found = mi.Bool(False)
    for shape in scene.model.shapes():
        if shape.id() in names:
            found |= hit.shape == mi.ShapePtr(shape)
    return found


def first_hit(scene: DrawnScene, pose: np.ndarray, size_px: tuple[int, int]) -> FirstHit:
    """Shoot a ray through each pixel's centre; follow it through the glass or off the mirror."""
    ray, depth_per_m = pixel_rays(pose, size_px)
    hit = scene.model.ray_intersect(ray)
    first_m, total_m = mi.Float(hit.t), mi.Float(hit.t)
    size = size_px[::-1]
    material = np.zeros(size, np.uint8)
    for label, names in (
        (MIRROR_LIKE, scene.mirrors),
        (GLASS_LIKE, scene.glasses),
        (MOVING, scene.moving),
    ):
        if names:
            material[np.array(_is_one_of(scene, hit, names)).reshape(size)] = label
    for _ in range(3):  # into the glass, out of it, and one more for the mirror
        on_mirror = _is_one_of(scene, hit, scene.mirrors)
        on_glass = _is_one_of(scene, hit, scene.glasses)
        onward = dr.select(on_mirror, ray.d - 2 * dr.dot(ray.d, hit.n) * hit.n, ray.d)
        go_on = on_mirror | on_glass
        ray = dr.select(go_on, hit.spawn_ray(onward), ray)
        further = scene.model.ray_intersect(ray)
        total_m = dr.select(go_on, total_m + further.t, total_m)
        hit = dr.select(go_on, further, hit)
    return FirstHit(
        exact_m=(np.array(first_m) * depth_per_m).reshape(size),
        seen_m=np.minimum((np.array(total_m) * depth_per_m).reshape(size), 20.0),
        material=material,
    )


def develop(linear: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A phone's picture, sRGB uint8: filmic curve, a lens's softness, a trace of noise."""
    x = np.clip(_filmic(linear), 0.0, 1.0)
    srgb = np.where(x > 0.0031308, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055, 12.92 * x)
    srgb = cv2.GaussianBlur(srgb, (0, 0), LENS_BLUR_PX) + 0.002 * rng.standard_normal(srgb.shape)
    return (np.clip(srgb, 0, 1) * 255 + 0.5).astype(np.uint8)


def is_clipped(linear: np.ndarray) -> np.ndarray:
    """Where all channels are brighter than the picture can say."""
    return (_filmic(linear) >= 1.0).all(axis=-1)


def _filmic(linear: np.ndarray) -> np.ndarray:
    x = np.maximum(linear, 0.0)
    return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
