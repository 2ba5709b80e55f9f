"""How good is a view made from one picture with depth, 5, 10 and 20 cm away from it?

From a recording with depth, pairs of views are chosen; every method gets the first picture with its
completed depth and renders the second view, and the rendering is compared with the photograph.
`layered` is compared with the methods of `baselines.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.benchmarks import baselines
from peaking.datasets import Recording, open_recording
from peaking.error_map.exposure import measure_exposure
from peaking.errors import RecordingError
from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera
from peaking.metrics.psnr_ssim import psnr, relative_sharpness, ssim
from peaking.rendering import Rendering

SingleViewRenderer = Callable[[Frame, Float32[np.ndarray, "h w"], Camera], Rendering]
"""Renders what a camera sees, from one picture and its depth (known everywhere)."""

Complete = Callable[
    [Float32[np.ndarray, "dh dw"], UInt8[np.ndarray, "h w 3"]], Float32[np.ndarray, "h w"]
]
"""Fills sensor depth at the picture's size, as `peaking.depth.complete` does."""

OURS = "layered"
"""The method that the others are counted against, pair by pair."""

DISTANCE_TOLERANCE = 0.2
"""A pair's distance may differ from the wanted one by this share of it."""

MAX_ANGLE_RAD = np.deg2rad(15.0)
"""Largest rotation between the views of a pair."""

MIN_OVERLAP = 0.6
"""Share of the first view's measured points that has to fall into the second picture."""

COVERED = 0.5
"""Alpha above which a pixel counts as drawn."""


@dataclass(frozen=True)
class Pair:
    """Numbers of a source and a target view, their distance and their rotation."""

    source: int
    target: int
    distance_m: float
    angle_rad: float


@dataclass(frozen=True)
class Score:
    """One method on one pair; see `Row`."""

    psnr_common_db: float
    ssim_common: float
    sharpness: float
    psnr_own_db: float
    ssim_own: float
    psnr_whole_db: float
    coverage: float


@dataclass(frozen=True)
class Row:
    """One method at one distance: means over pairs.

    Attributes:
        method: Name in the registry.
        baseline_m: Wanted distance.
        distance_m: Mean distance of the chosen pairs.
        pairs: How many.
        psnr_common_db: PSNR over the pixels that every method drew.
        ssim_common: SSIM over the same pixels.
        sharpness: Relative sharpness over the same pixels: where poses are not good to a pixel,
            blur alone raises PSNR and SSIM, so compare methods of like sharpness.
        psnr_own_db: PSNR over the pixels that this method drew.
        ssim_own: SSIM over the same pixels.
        psnr_whole_db: PSNR over the whole picture, drawn over black.
        coverage: Share of the picture with alpha above `COVERED`.
        common: Share of the picture that every method drew.
        beaten_in_psnr: In how many pairs `OURS` has the higher PSNR over common pixels; None for
            `OURS` itself and when it does not take part.
        beaten_in_ssim: The same for SSIM over common pixels.
        beaten_in_whole: The same for PSNR over the whole picture.
    """

    method: str
    baseline_m: float
    distance_m: float
    pairs: int
    psnr_common_db: float
    ssim_common: float
    sharpness: float
    psnr_own_db: float
    ssim_own: float
    psnr_whole_db: float
    coverage: float
    common: float
    beaten_in_psnr: int | None
    beaten_in_ssim: int | None
    beaten_in_whole: int | None


def render_splat(frame: Frame, depth_m: Float32[np.ndarray, "h w"], target: Camera) -> Rendering:
    """Render by forward point splatting."""
    return _rendering(*baselines.splat(frame.rgb, depth_m, frame.camera, target))


def render_mesh(frame: Frame, depth_m: Float32[np.ndarray, "h w"], target: Camera) -> Rendering:
    """Render as a textured depth mesh that is cut at depth edges."""
    return _rendering(*baselines.mesh(frame.rgb, depth_m, frame.camera, target))


def render_layered(frame: Frame, depth_m: Float32[np.ndarray, "h w"], target: Camera) -> Rendering:
    """Render the multi-plane image of the default generator."""
    from peaking.generators.layered import Layered
    from peaking.rendering import render

    return render(Layered()(frame.rgb, depth_m, frame.camera), target)


def _rendering(rgb: Float32[np.ndarray, "h w 3"], alpha: Float32[np.ndarray, "h w"]) -> Rendering:
    """Return premultiplied colour and alpha as a rendering without depth."""
    return Rendering(np.dstack([rgb, alpha]), np.zeros_like(alpha))


METHODS: Mapping[str, SingleViewRenderer] = {
    "splat": render_splat,
    "mesh": render_mesh,
    OURS: render_layered,
}
"""What `single_view_quality` compares; give it more to compare more."""


def single_view_quality(
    recording_root: Path,
    *,
    baselines_m: Sequence[float] = (0.05, 0.10, 0.20),
    pairs_per_distance: int = 20,
    size_px: tuple[int, int] | None = None,
    methods: Mapping[str, SingleViewRenderer] = METHODS,
    complete: Complete | None = None,
) -> list[Row]:
    """Score every method at every distance, on the same pairs with the same depth.

    Args:
        recording_root: A nerfstudio folder with depth.
        baselines_m: Wanted distances between the cameras of a pair.
        pairs_per_distance: At most so many pairs, spread evenly over the recording.
        size_px: Width and height to work at, else the paper's number of pixels.
        methods: Name and function of everything to compare.
        complete: Fills the depth, else `peaking.depth.complete`.

    Raises:
        RecordingError: The recording cannot be read, or has no pair at any of the distances.
        ValueError: A distance or the number of pairs is not positive.
    """
    if pairs_per_distance < 1 or min(baselines_m, default=0.0) <= 0 or not methods:
        raise ValueError(
            f"need distances > 0, pairs_per_distance >= 1 and a method, got {list(baselines_m)}, "
            f"{pairs_per_distance}, {list(methods)}"
        )
    if complete is None:
        from peaking import depth

        complete = depth.complete
    recording = open_recording(recording_root)
    rows: list[Row] = []
    for baseline_m in baselines_m:
        pairs = choose_pairs(recording, baseline_m, count=pairs_per_distance)
        scores: dict[str, list[Score]] = {name: [] for name in methods}
        shares: list[float] = []
        distances_m: list[float] = []
        for pair in pairs:
            source = _read(recording, pair.source, size_px)
            target = _read(recording, pair.target, size_px)
            of_pair = score_pair(source, target, methods=methods, complete=complete)
            if of_pair is None:
                continue
            shares.append(of_pair[1])
            distances_m.append(pair.distance_m)
            for name, score in of_pair[0].items():
                scores[name].append(score)
        if shares:
            rows += _rows(scores, baseline_m, float(np.mean(distances_m)), float(np.mean(shares)))
    if not rows:
        raise RecordingError(
            recording_root,
            f"has no pair of views with depth at {list(baselines_m)} m from each other",
            remedy="use a recording with smaller or larger steps, or other distances",
        )
    return rows


def choose_pairs(recording: Recording, baseline_m: float, *, count: int) -> list[Pair]:
    """Choose at most `count` pairs at about the wanted distance, evenly over the recording.

    Every view with depth is paired with the view that fits best in distance and angle. The views
    that have a partner are cut into `count` runs in the order of capture; of each run the pair
    nearest to its middle that overlaps enough is taken. Nothing is random.
    """
    cameras = recording.cameras
    partners = [
        pair
        for i, has_depth in enumerate(recording.has_depth)
        if has_depth and (pair := _partner(cameras, i, baseline_m)) is not None
    ]
    chosen: list[Pair] = []
    runs = min(count, len(partners))
    for k in range(runs):
        run = partners[len(partners) * k // runs : len(partners) * (k + 1) // runs]
        for pair in _from_the_middle(run):
            if _overlap(recording.read(pair.source), cameras[pair.target]) >= MIN_OVERLAP:
                chosen.append(pair)
                break
    return chosen


def _from_the_middle(run: Sequence[Pair]) -> list[Pair]:
    """Return the pairs sorted by how far they stand from the middle of their run."""
    order = sorted(range(len(run)), key=lambda k: abs(2 * k - (len(run) - 1)))
    return [run[k] for k in order]


def _partner(cameras: Sequence[Camera], source: int, baseline_m: float) -> Pair | None:
    """Return the best partner of a view by its pose alone, or None."""
    here = cameras[source]
    best: tuple[float, Pair] | None = None
    for target, there in enumerate(cameras):
        distance_m = float(np.linalg.norm(there.position_m - here.position_m))
        away = abs(distance_m - baseline_m) / (DISTANCE_TOLERANCE * baseline_m)
        if target == source or away > 1.0:
            continue
        turn = here.world_from_cam.rotation.T @ there.world_from_cam.rotation
        angle_rad = float(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1.0, 1.0)))
        cost = away + angle_rad / MAX_ANGLE_RAD
        if angle_rad <= MAX_ANGLE_RAD and (best is None or cost < best[0]):
            best = cost, Pair(source, target, distance_m, angle_rad)
    return None if best is None else best[1]


def _overlap(frame: Frame, target: Camera, *, step_px: int = 8) -> float:
    """Return the share of a frame's measured points that the target sees, occlusion aside."""
    if frame.depth_m is None:
        return 0.0
    height, width = frame.depth_m.shape
    rays = frame.camera.pinhole.resized(width, height).rays()[::step_px, ::step_px]
    depth_m = frame.depth_m[::step_px, ::step_px].astype(np.float64)
    known = depth_m > 0
    if not known.any():
        return 0.0
    points_m = frame.camera.world_from_cam.apply((rays * depth_m[..., None])[known])
    xy_px, there_m = target.project(points_m)
    inside = (xy_px >= 0).all(axis=-1) & (xy_px <= np.array(target.pinhole.size_px)).all(axis=-1)
    return float((inside & (there_m > 0)).mean())


def _read(recording: Recording, index: int, size_px: tuple[int, int] | None) -> Frame:
    frame = recording.read(index)
    return frame.resized(*(size_px or working_size_px(*frame.camera.pinhole.size_px)))


def score_pair(
    source: Frame, target: Frame, *, methods: Mapping[str, SingleViewRenderer], complete: Complete
) -> tuple[dict[str, Score], float] | None:
    """Render the target from the source by every method; return scores and the common share.

    Exposure and vignette are those of the error map; they are estimated once, from the splat, and
    applied to all methods alike.

    None when the methods have too little in common to be compared.
    """
    if source.depth_m is None:
        raise ValueError(f"need a source with depth, got {source.name}")
    depth_m = complete(source.depth_m, source.rgb)
    photo = target.rgb.astype(np.float32) / np.float32(255.0)
    rendered = {name: method(source, depth_m, target.camera) for name, method in methods.items()}
    gain = measure_exposure(render_splat(source, depth_m, target.camera), target.rgb).gain
    rendered = {name: _with_gain(rendering, gain) for name, rendering in rendered.items()}
    common = np.logical_and.reduce([each.alpha > COVERED for each in rendered.values()])
    if common.mean() < 0.05:
        return None
    scores = {name: _score(each, photo, common) for name, each in rendered.items()}
    return scores, float(common.mean())


def _with_gain(rendering: Rendering, gain: Float32[np.ndarray, "3"]) -> Rendering:
    rgb = np.minimum(rendering.rgba[..., :3] * gain, rendering.rgba[..., 3:])
    return _rendering(rgb, rendering.alpha)


def _score(
    rendering: Rendering, photo: Float32[np.ndarray, "h w 3"], common: Bool[np.ndarray, "h w"]
) -> Score:
    own = rendering.alpha > COVERED
    colour = rendering.rgb()
    return Score(
        psnr_common_db=psnr(colour, photo, common),
        ssim_common=ssim(colour, photo, common),
        sharpness=relative_sharpness(colour, photo, common),
        psnr_own_db=psnr(colour, photo, own),
        ssim_own=ssim(colour, photo, own),
        psnr_whole_db=psnr(rendering.rgba[..., :3], photo),
        coverage=float(own.mean()),
    )


def _rows(
    scores: Mapping[str, Sequence[Score]], baseline_m: float, distance_m: float, common: float
) -> list[Row]:
    """Return the means over pairs, and how often `OURS` is the better one."""
    ours = scores.get(OURS)
    rows: list[Row] = []
    for name, of_method in scores.items():
        means = {key: float(np.mean([asdict(s)[key] for s in of_method])) for key in _FIELDS}
        wins: list[int | None] = [None] * 3
        if ours is not None and name != OURS:
            both = list(zip(ours, of_method, strict=True))
            wins[0] = sum(a.psnr_common_db > b.psnr_common_db for a, b in both)
            wins[1] = sum(a.ssim_common > b.ssim_common for a, b in both)
            wins[2] = sum(a.psnr_whole_db > b.psnr_whole_db for a, b in both)
        rows.append(
            Row(
                method=name,
                baseline_m=baseline_m,
                distance_m=distance_m,
                pairs=len(of_method),
                common=common,
                beaten_in_psnr=wins[0],
                beaten_in_ssim=wins[1],
                beaten_in_whole=wins[2],
                **means,
            )
        )
    return rows


_FIELDS = tuple(Score.__dataclass_fields__)

_HEADINGS = (
    "distance",
    "method",
    "PSNR common",
    "SSIM common",
    "sharpness",
    "PSNR own",
    "SSIM own",
    "PSNR whole",
    "covered",
    f"{OURS} better (PSNR, SSIM, whole)",
)


def as_markdown(rows: Sequence[Row]) -> str:
    """Return the rows as a table; PSNR in dB."""
    lines = ["| " + " | ".join(_HEADINGS) + " |", "|" + "---|" * len(_HEADINGS)]
    for row in rows:
        wins = (row.beaten_in_psnr, row.beaten_in_ssim, row.beaten_in_whole)
        cells = (
            f"{100 * row.baseline_m:g} cm",
            row.method,
            f"{row.psnr_common_db:.2f}",
            f"{row.ssim_common:.4f}",
            f"{row.sharpness:.3f}",
            f"{row.psnr_own_db:.2f}",
            f"{row.ssim_own:.4f}",
            f"{row.psnr_whole_db:.2f}",
            f"{100 * row.coverage:.1f} %",
            "-" if None in wins else f"{wins[0]}, {wins[1]}, {wins[2]} of {row.pairs}",
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def as_dict(rows: Sequence[Row]) -> dict[str, object]:
    """Return the rows as plain values for a JSON file; an infinite PSNR becomes None."""
    plain = [
        {
            k: None if isinstance(v, float) and not np.isfinite(v) else v
            for k, v in asdict(r).items()
        }
        for r in rows
    ]
    return {"ours": OURS, "rows": plain}
