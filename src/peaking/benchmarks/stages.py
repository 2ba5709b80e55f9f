"""The stages of the method, timed on real frames at the paper's size."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import UInt8

from peaking import mpi_file
from peaking.benchmarks.measure import Candidate, Result, machine, time_in_turn
from peaking.benchmarks.peers import bandwidth_bytes_per_ms, depth_anything_small, torch_layer_loop
from peaking.datasets import Recording
from peaking.depth import complete
from peaking.errors import RecordingError
from peaking.frame import Frame
from peaking.generators.layered import Layered
from peaking.geometry import Cam, Camera, Rigid
from peaking.mpi import Mpi
from peaking.options import PRESETS, Options
from peaking.pipeline import Reconstruction
from peaking.rendering import Rendering, render
from peaking.scale_alignment import align_scale
from peaking.tracking import align
from peaking.tracking.solution import rotation_of

PAPER_SIZE_PX = (294, 639)
ALIGN_SIZE_PX = (105, 229)
NUM_PLANES = 32
VIEWS_PER_SCENE = 6


@dataclass(frozen=True)
class Sample:
    """A captured frame, and a later one that it is looked at from."""

    frame: Frame
    later: Frame
    read: Callable[[], Frame]
    """Read the later frame again, as a replay does."""


def samples(recordings: Sequence[Recording]) -> list[Sample]:
    """Take frames evenly from recordings, cut to the paper's aspect and size.

    Raises:
        RecordingError: A frame has no depth.
    """
    taken: list[Sample] = []
    for recording in recordings:
        step = max(1, len(recording) // VIEWS_PER_SCENE)
        for index in range(0, max(1, len(recording) - 1), step)[:VIEWS_PER_SCENE]:
            later = min(index + 5, len(recording) - 1)
            frame = recording.read(index)
            if frame.depth_m is None:
                raise RecordingError(
                    recording.path,
                    "this frame has no depth",
                    field=f"frames[{index}].depth_file_path",
                    remedy="benchmark a recording with depth at every frame",
                )
            taken.append(
                Sample(
                    at_paper_size(frame),
                    at_paper_size(recording.read(later)),
                    lambda recording=recording, later=later: recording.read(later),
                )
            )
    return taken


def at_paper_size(frame: Frame) -> Frame:
    """Cut the middle of the picture (and depth) in the paper's aspect, and resize the picture."""
    width, height = frame.camera.pinhole.size_px
    aspect = PAPER_SIZE_PX[0] / PAPER_SIZE_PX[1]
    cut_width = min(width, round(height * aspect))
    cut_height = min(height, round(cut_width / aspect))
    left, top = (width - cut_width) // 2, (height - cut_height) // 2
    depth_m = frame.depth_m
    if depth_m is not None:
        sy, sx = depth_m.shape[0] / height, depth_m.shape[1] / width
        rows = slice(round(top * sy), round((top + cut_height) * sy))
        cols = slice(round(left * sx), round((left + cut_width) * sx))
        depth_m = np.ascontiguousarray(depth_m[rows, cols])
    camera = Camera(
        frame.camera.pinhole.cropped(left, top, cut_width, cut_height), frame.camera.world_from_cam
    )
    rgb = np.ascontiguousarray(frame.rgb[top : top + cut_height, left : left + cut_width])
    return replace(frame, rgb=rgb, camera=camera, depth_m=depth_m).resized(*PAPER_SIZE_PX)


def run(
    recordings: Sequence[Recording],
    *,
    rounds: int,
    with_peers: bool,
    progress: Callable[[range], Iterable[int]] = iter,
) -> dict[str, object]:
    """Time every stage and peer; return what `peaking bench --json` writes."""
    frames = samples(recordings)
    generate = Layered(num_planes=NUM_PLANES)

    def pick(n: int) -> Sample:
        return frames[n % len(frames)]

    def make(sample: Sample) -> Mpi:
        """From the picture and the depth that the phone sends to an MPI: complete, and layers."""
        depth_m = complete(_depth(sample.frame), sample.frame.rgb)
        return generate(sample.frame.rgb, depth_m, sample.frame.camera)

    completed = [complete(_depth(s.frame), s.frame.rgb) for s in frames]
    mpis = [make(s) for s in frames]
    latest = [mpis[-1]]  # what `generate` made last is encoded next, as a server does
    files = [mpi_file.encode(mpi) for mpi in mpis]
    fields = {name: _field_of_three(PRESETS[name], frames) for name in ("default", "paper")}

    disturbed = [
        _disturbed(field, sample.later)
        for field, sample in zip(fields["default"], frames, strict=True)
    ]

    two, two_filled = (
        _fields(frames, neighbours=2, filling_views=filling_views) for filling_views in (0, 1)
    )

    def look(n: int) -> object:
        """Ask the memory of three views what was never seen, by live depth."""
        k = n % len(frames)
        memory = fields["default"][k].light_field.memory
        assert memory is not None
        return memory.look(frames[k].later.camera, _depth(frames[k].later))

    def make_next(n: int) -> None:
        latest[0] = make(pick(n))

    def layers(n: int) -> Mpi:
        k = n % len(frames)
        return generate(frames[k].frame.rgb, completed[k], frames[k].frame.camera)

    def replay_frame(n: int) -> None:
        k = n % len(frames)
        field = fields["default"][k]
        small = field.prepare(frames[k].read())
        field.compare(small.rgb, small.camera)

    def render_one(n: int) -> object:
        """Render one of the three views that `compare_three` renders together, each in its turn."""
        k = n % len(frames)
        views = fields["default"][k].light_field.mpis
        return render(views[(n // len(frames)) % len(views)], frames[k].later.camera)

    candidates = [
        Candidate("align_scale", lambda n: align_scale(mpis[n % len(mpis)], _depth(pick(n).frame))),
        Candidate("complete", lambda n: complete(_depth(pick(n).frame), pick(n).frame.rgb)),
        Candidate("layers", layers),
        Candidate("generate", make_next),
        Candidate("encode", lambda _: mpi_file.encode(latest[0])),
        Candidate("decode", lambda n: mpi_file.decode(files[n % len(files)])),
        Candidate("render_one", render_one),
        Candidate("align", lambda n: align(*disturbed[n % len(disturbed)])),
        Candidate("look", look),
        Candidate("compare_two", lambda n: _compare(two, frames, n)),
        Candidate("compare_two_filled", lambda n: _compare(two_filled, frames, n)),
        Candidate("compare_three", lambda n: _compare(fields["default"], frames, n)),
        Candidate("compare_three_paper", lambda n: _compare(fields["paper"], frames, n)),
        Candidate("replay_frame", replay_frame),
    ]
    if with_peers:
        loops = [
            [torch_layer_loop(view.mpi) for view in field.views] for field in fields["default"]
        ]
        forward = depth_anything_small()

        def loop(n: int) -> object:
            mine = loops[n % len(loops)]
            return mine[(n // len(frames)) % len(mine)](pick(n).later.camera)

        def estimate(_: int) -> object:
            return forward()

        candidates += [
            Candidate("torch_layer_loop", loop, every=2),
            Candidate("dav2_small_forward", estimate, every=max(1, rounds // 6)),
        ]
    timings = time_in_turn(candidates, rounds=rounds, progress=progress)
    results = {name: Result(timing) for name, timing in timings.items()}
    _add_ratios(results)
    _add_sizes(results, mpis, files)
    return {
        "machine": machine(),
        "size": [*PAPER_SIZE_PX, NUM_PLANES],
        "scenes": [recording.name for recording in recordings],
        "frames": len(frames),
        "results": [result.as_dict() for result in results.values()],
    }


def _depth(frame: Frame) -> np.ndarray:
    assert frame.depth_m is not None  # `samples` made sure
    return frame.depth_m


def _compare(fields: Sequence[Reconstruction], frames: Sequence[Sample], n: int) -> object:
    """Render, blend and compare; what is remembered and the pose are candidates of their own."""
    k = n % len(frames)
    later = frames[k].later
    field = replace(fields[k].light_field, memory=None)
    return field.compare(later.rgb, later.camera)


def _field_of_three(options: Options, frames: Sequence[Sample]) -> list[Reconstruction]:
    return _fields(frames, options, neighbours=3)


def _fields(
    frames: Sequence[Sample], options: Options = PRESETS["default"], **choices: int
) -> list[Reconstruction]:
    """Return for every sample a scene of the frame, the later one, and the next sample's."""
    fields: list[Reconstruction] = []
    for k, sample in enumerate(frames):
        field = Reconstruction(replace(options, **choices))
        for frame in (sample.frame, sample.later, frames[(k + 1) % len(frames)].frame):
            field.add_view(frame)
        fields.append(field)
    return fields


def _disturbed(
    field: Reconstruction, live: Frame
) -> tuple[Rendering, Camera, UInt8[np.ndarray, "h w 3"]]:
    """Return what is rendered from 1 cm and half a degree away, the camera, and the live picture.

    They have the size that phones align at.
    """
    width, height = ALIGN_SIZE_PX
    turn = rotation_of(np.radians([0.3, -0.4, 0.0]))
    away: Rigid[Cam, Cam] = Rigid(turn, np.array([0.006, 0.0, -0.008]))
    exact = live.camera.resized(width, height)
    camera = Camera(exact.pinhole, exact.world_from_cam @ away)
    small = cv2.resize(live.rgb, ALIGN_SIZE_PX, interpolation=cv2.INTER_AREA)
    return field.render(camera), camera, np.asarray(small, np.uint8)


def _add_ratios(results: dict[str, Result]) -> None:
    """Say how many times faster than its peers each stage is."""
    against = {
        "generate": ("dav2_small_forward",),
        "layers": ("dav2_small_forward",),
        "render_one": ("torch_layer_loop",),
        "encode": ("generate",),
        "align": ("render_one",),
        "look": ("compare_three",),
        "compare_two_filled": ("compare_two",),
        "compare_three": ("render_one", "torch_layer_loop"),
        "compare_three_paper": ("render_one", "torch_layer_loop"),
    }
    for name, peers in against.items():
        for peer in peers:
            if peer in results:
                ours_ms = results[name].timing.median_ms
                results[name].vs[peer] = results[peer].timing.median_ms / ours_ms


def _add_sizes(results: dict[str, Result], mpis: Sequence[Mpi], files: Sequence[bytes]) -> None:
    """Add bytes, and how far rendering is from only reading the memory it needs."""
    atlas_bytes = int(np.median([mpi.texels.nbytes for mpi in mpis]))
    results["generate"].bytes = atlas_bytes
    results["layers"].bytes = atlas_bytes
    results["decode"].bytes = atlas_bytes
    results["encode"].bytes = int(np.median([len(data) for data in files]))
    per_ms = bandwidth_bytes_per_ms()
    view_bytes = PAPER_SIZE_PX[0] * PAPER_SIZE_PX[1] * 5 * 4
    for name, touched in (
        ("render_one", atlas_bytes + view_bytes),
        ("compare_three", 3 * (atlas_bytes + 2 * view_bytes) + 2 * view_bytes),
    ):
        floor_ms = touched / per_ms
        results[name].bytes = touched
        results[name].vs["bandwidth_floor"] = floor_ms / results[name].timing.median_ms
        results[name].note = f"bandwidth_floor {floor_ms:.3f} ms at {per_ms / 1e6:.1f} GB/s"
