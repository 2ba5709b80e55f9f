"""Render the sample scene `scenes/desk`: an office desk filmed by a phone, with exact geometry.

A developer's tool; nothing in the package needs it. It runs on a CPU (a frame takes about
6 s on two cores). The same `--seed` gives the same scene; repeated runs gave the
same depth and labels, and pictures the same but for rounding (mostly none, at worst 7 grey levels
in single pixels). What it needs:

    apt-get install libllvm19        # LLVM 14 to 16 do not work
    pip install mitsuba==3.9.1 mitsuba-oidn==0.1.2 numpy opencv-python-headless==5.0.0.93

    python scripts/make_desk_scene.py --out build/desk    # then put it in place of scenes/desk

`--only 30:60` renders frames 30 to 59 and keeps the others: so an interrupted run goes on.
`transforms.json` is written in any case and always lists every frame.
"""

import argparse
import itertools
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
import drjit as dr  # noqa: E402
import mitsuba_oidn  # noqa: E402

from desk_scene import desk as near  # noqa: E402  (needs the variant)
from desk_scene import model as far  # noqa: E402
from desk_scene.phone import DEPTH_SIZE_PX, phone_depth_mm, scale_errors, world_from_cam  # noqa: E402

WIDTH_PX, HEIGHT_PX = 294, 639
FOV_X_DEG = 45.93
FOCAL_PX = WIDTH_PX / 2 / np.tan(np.radians(FOV_X_DEG / 2))
FRAMES_PER_S = 15.0
LENS_BLUR_PX = 0.56
GUIDE_STEPS = 3
"""The denoiser's guides (albedo, normals) have this many samples along each side of a pixel."""
OTHER, MIRROR_LIKE, GLASS_LIKE = 0, 1, 2


@dataclass(frozen=True)
class FirstHit:
    """What the rays through the pixel centres meet; all `height width`."""

    exact_m: np.ndarray
    """Depth along the optical axis of the first surface."""
    seen_m: np.ndarray
    """As a depth sensor sees it: through the glass, and into the mirror."""
    material: np.ndarray
    """Labels, uint8."""


def build_scene(seed: int) -> mi.Scene:
    """The whole model; every part has its own generator, so that one can change alone."""
    makers = (
        far.room,
        far.bookshelf,
        far.far_furniture,
        near.desk,
        near.near_plant,
        near.computer,
        near.papers,
        near.small_things,
        near.mirror_and_glass,
    )
    model: dict[str, Any] = {"type": "scene"} | far.lights()
    for k, make in enumerate(makers):
        model |= make(np.random.default_rng((seed, k)))
    # The order of the lights decides the noise: optimize=True leaves it to chance, and the shipped
    # pictures were rendered with the last light first.
    return mi.load_dict(dict(reversed(model.items())), parallel=False, optimize=False)


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
    scene: mi.Scene, sensor: mi.Sensor, pose: np.ndarray, *, spp: int, seed: int
) -> np.ndarray:
    """Denoised radiance, `height width 3`."""
    axes = np.diag((-1.0, 1.0, -1.0, 1.0))  # Mitsuba's camera looks along +z with x to the left
    place = mi.traverse(sensor)
    place["to_world"] = mi.Transform4f((pose @ axes).astype(np.float32))
    dr.make_opaque(place["to_world"])  # a literal would compile the kernels anew for each frame
    place.update()
    path = mi.load_dict({"type": "path", "max_depth": 7, "rr_depth": 4})
    noisy = np.array(mi.render(scene, sensor=sensor, integrator=path, spp=spp, seed=seed))
    albedo, normal = denoiser_guides(scene, pose)
    return np.array(mitsuba_oidn.denoise(noisy, albedo=albedo, normal=normal, hdr=True))


def denoiser_guides(scene: mi.Scene, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Albedo and normals, averaged over each pixel; in the mirror, those of the mirrored scene."""
    total = np.zeros((2, HEIGHT_PX, WIDTH_PX, 3), np.float32)
    steps = (np.arange(GUIDE_STEPS) + 0.5) / GUIDE_STEPS
    for right, down in itertools.product(steps, steps):
        ray, _ = pixel_rays(pose, right, down)
        hit = scene.ray_intersect(ray)
        on_mirror = is_shape(scene, hit, far.MIRROR)
        mirrored = hit.spawn_ray(ray.d - 2 * dr.dot(ray.d, hit.n) * hit.n)
        hit = dr.select(on_mirror, scene.ray_intersect(mirrored, on_mirror), hit)
        albedo = hit.bsdf().eval_diffuse_reflectance(hit, hit.is_valid())
        normal = hit.sh_frame.n
        dr.eval(albedo, normal)  # together: the rays are shot once
        for k, value in enumerate((albedo, normal)):
            total[k] += np.array(value).T.reshape(HEIGHT_PX, WIDTH_PX, 3)
    total /= GUIDE_STEPS**2
    return total[0], total[1]


def pixel_rays(pose: np.ndarray, right: float, down: float) -> tuple[mi.Ray3f, np.ndarray]:
    """A ray through each pixel, at this offset from its corner; and depth per metre of each ray."""
    v, u = np.mgrid[0:HEIGHT_PX, 0:WIDTH_PX]
    x, y = (u + right - WIDTH_PX / 2) / FOCAL_PX, (v + down - HEIGHT_PX / 2) / FOCAL_PX
    toward = np.stack([x, -y, -np.ones_like(x)], -1).reshape(-1, 3) @ pose[:3, :3].T
    depth_per_m = 1.0 / np.linalg.norm(toward, axis=1)
    toward *= depth_per_m[:, None]
    origin = (mi.Float(np.array([c], np.float32)) for c in pose[:3, 3])
    return mi.Ray3f(mi.Point3f(*origin), mi.Vector3f(*toward.T.astype(np.float32))), depth_per_m


def is_shape(scene: mi.Scene, hit: mi.SurfaceInteraction3f, name: str) -> mi.Bool:
    """Where the hit lies on the shape of this name."""
    return hit.shape == mi.ShapePtr(next(shape for shape in scene.shapes() if shape.id() == name))


def develop(linear: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A phone's picture, sRGB uint8: filmic curve, a lens's softness, a trace of noise."""
    x = np.maximum(linear, 0.0)
    x = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0)
    srgb = np.where(x > 0.0031308, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055, 12.92 * x)
    srgb = cv2.GaussianBlur(srgb, (0, 0), LENS_BLUR_PX) + 0.002 * rng.standard_normal(srgb.shape)
    return (np.clip(srgb, 0, 1) * 255 + 0.5).astype(np.uint8)


def first_hit(scene: mi.Scene, pose: np.ndarray) -> FirstHit:
    """Shoot a ray through each pixel's centre; follow it through the glass or off the mirror."""
    ray, depth_per_m = pixel_rays(pose, 0.5, 0.5)
    hit = scene.ray_intersect(ray)
    is_mirror, is_glass = (is_shape(scene, hit, name) for name in (far.MIRROR, far.GLASS))
    first_m, total_m = mi.Float(hit.t), mi.Float(hit.t)
    for _ in range(3):  # into the glass, out of it, and one more for the mirror
        on_mirror, on_glass = (is_shape(scene, hit, name) for name in (far.MIRROR, far.GLASS))
        onward = dr.select(on_mirror, ray.d - 2 * dr.dot(ray.d, hit.n) * hit.n, ray.d)
        go_on = on_mirror | on_glass
        ray = dr.select(go_on, hit.spawn_ray(onward), ray)
        further = scene.ray_intersect(ray)
        total_m = dr.select(go_on, total_m + further.t, total_m)
        hit = dr.select(go_on, further, hit)
    size = (HEIGHT_PX, WIDTH_PX)
    material = np.where(
        np.array(is_mirror), MIRROR_LIKE, np.where(np.array(is_glass), GLASS_LIKE, OTHER)
    )
    return FirstHit(
        exact_m=(np.array(first_m) * depth_per_m).reshape(size),
        seen_m=np.minimum((np.array(total_m) * depth_per_m).reshape(size), 20.0),
        material=material.astype(np.uint8).reshape(size),
    )


def write_png(path: Path, image: np.ndarray) -> None:
    """Write a PNG as small as it gets."""
    labels = image.dtype == np.uint8
    choice = cv2.IMWRITE_PNG_ALL_FILTERS if labels else cv2.IMWRITE_PNG_FILTER_PAETH
    strategy = cv2.IMWRITE_PNG_STRATEGY_FILTERED
    small = [
        cv2.IMWRITE_PNG_COMPRESSION,
        9,
        cv2.IMWRITE_PNG_FILTER,
        choice,
        cv2.IMWRITE_PNG_STRATEGY,
        strategy,
    ]
    cv2.imwrite(str(path), image, small)


def millimetres(depth_m: np.ndarray) -> np.ndarray:
    """Depth as stored."""
    return np.clip(depth_m * 1000.0 + 0.5, 0, 65535).astype(np.uint16)


def make_frame(
    scene: mi.Scene,
    sensor: mi.Sensor,
    frame: int,
    *,
    options: argparse.Namespace,
    scale: float,
) -> None:
    """Render one frame and write its four pictures."""
    rng, out = np.random.default_rng((options.seed, 1000 + frame)), options.out
    pose = world_from_cam(frame, options.seed)
    linear = render_linear(
        scene, sensor, pose, spp=options.spp, seed=options.seed * 100_003 + frame
    )
    image = develop(linear, rng)
    hit = first_hit(scene, pose)
    dropout = np.select([hit.material == MIRROR_LIKE, hit.material == GLASS_LIKE], [0.35, 0.4], 0.0)
    sensed = phone_depth_mm(hit.seen_m, image, dropout, scale=scale, rng=rng)
    jpeg = [
        cv2.IMWRITE_JPEG_QUALITY, options.quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1,
        cv2.IMWRITE_JPEG_PROGRESSIVE, 1,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420,
    ]  # fmt: skip
    cv2.imwrite(str(out / f"images/frame_{frame:05d}.jpg"), image[..., ::-1], jpeg)
    write_png(out / f"depths/frame_{frame:05d}.png", sensed)
    write_png(out / f"depths_exact/frame_{frame:05d}.png", millimetres(hit.exact_m))
    write_png(out / f"materials/frame_{frame:05d}.png", hit.material)


def transforms(count: int, seed: int) -> dict[str, Any]:
    """The scene's description in nerfstudio's format, with keys of ours for the extra pictures."""
    frames = [
        {
            "file_path": f"images/frame_{k:05d}.jpg",
            "depth_file_path": f"depths/frame_{k:05d}.png",
            "exact_depth_file_path": f"depths_exact/frame_{k:05d}.png",
            "materials_file_path": f"materials/frame_{k:05d}.png",
            "timestamp_s": round(k / FRAMES_PER_S, 6),
            "transform_matrix": np.round(world_from_cam(k, seed), 9).tolist(),
        }
        for k in range(count)
    ]
    lens = {
        "fl_x": FOCAL_PX,
        "fl_y": FOCAL_PX,
        "cx": WIDTH_PX / 2,
        "cy": HEIGHT_PX / 2,
        "w": WIDTH_PX,
        "h": HEIGHT_PX,
    }
    still = dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0)
    return {
        "camera_model": "PINHOLE",
        **lens,
        **still,
        "depth_unit_scale_factor": 0.001,
        "frames": frames,
    }


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder to write")
    parser.add_argument("--frames", type=int, default=150, help="frames of the recording")
    parser.add_argument("--spp", type=int, default=14, help="light paths per pixel")
    parser.add_argument("--quality", type=int, default=80, help="JPEG quality")
    parser.add_argument(
        "--only", default=":", metavar="START:END[:STEP]", help="render these frames only"
    )
    parser.add_argument(
        "--seed", type=int, default=7, help="of textures, tremor, light paths and sensor noise"
    )
    return parser.parse_args()


def main() -> None:
    """Render what was asked for."""
    options = arguments()
    for folder in ("images", "depths", "depths_exact", "materials"):
        (options.out / folder).mkdir(parents=True, exist_ok=True)
    (options.out / "transforms.json").write_text(
        json.dumps(transforms(options.frames, options.seed), indent=1) + "\n"
    )
    wanted = range(options.frames)[slice(*(int(n) if n else None for n in options.only.split(":")))]
    scene, sensor = build_scene(options.seed), phone_camera()
    scales = scale_errors(options.frames, options.seed)
    start_s = time.monotonic()
    for done, frame in enumerate(wanted, start=1):
        make_frame(scene, sensor, frame, options=options, scale=float(scales[frame]))
        spent_s = time.monotonic() - start_s
        left_min = spent_s / done * (len(wanted) - done) / 60
        print(f"frame {frame}: {done} of {len(wanted)}, {left_min:.1f} min left", flush=True)
    print(f"depth pictures are {DEPTH_SIZE_PX[0]}x{DEPTH_SIZE_PX[1]}; all in {options.out}")


if __name__ == "__main__":
    main()
