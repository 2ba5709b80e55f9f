"""Walk a recording, and capture the frames that a policy takes (paper, section 4.2).

The paper's policy captures the first frame, and after it every frame whose peaked share exceeds the
threshold; all policies of `peaking.selection` can be used. With a guide, the frames at its targets
are captured, whatever is red (`guided`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

import peaking
from peaking.datasets import Recording
from peaking.errors import RecordingError
from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera
from peaking.light_field import Comparison
from peaking.mpi import Mpi
from peaking.options import Marks, Options
from peaking.output import complete_or_absent
from peaking.overlay import Overlay, draw, mpi_over_black
from peaking.pipeline import Reconstruction
from peaking.replay.guided import GuidedWalk, GuideOptions, guided_walk
from peaking.replay.overlay_video import OverlayVideo, Panels
from peaking.replay.records import (
    FrameRecord,
    PoseCorrection,
    ReplayHeader,
    ReplaySummary,
    summarize,
    with_dropped_at,
    write_frames_csv,
    write_summary,
)
from peaking.replay.report import write_report
from peaking.replay.stills import StillPicker
from peaking.replay.video import VideoWriter
from peaking.selection.blur import sharpness
from peaking.selection.policy import Chosen, Decision, Policy
from peaking.selection.recorded_frames import RecordedFrames
from peaking.selection.registry import NeedsWholePath, SelectionOptions, create_policy
from peaking.timing import Stopwatch
from peaking.tracking import Alignment

RECORD_DEPTH = (
    "replay a recording with depth (16-bit PNG, millimetres), or have it estimated: --depth-model"
)

FrameProgress = Callable[[Iterable[int]], Iterable[int]]
"""Wraps the frame numbers to show how far the walk is, such as `tqdm`."""


@dataclass(frozen=True)
class ReplayOptions:
    """What to replay, and options."""

    recording: Recording
    preset: str
    method: Options
    selection: SelectionOptions = field(default_factory=SelectionOptions)
    """The policy that decides which frames are captured."""
    max_frames: int | None = None
    overlay: Overlay = "peaks"
    """The third picture of the video."""
    fps: float = 15.0
    with_video: bool = True
    guide: GuideOptions | None = None
    """Capture at the targets of a guide instead."""
    follow_links: bool = False
    """Copy into `captured/` also what links lead to from outside the recording."""
    keep_exif: bool = False
    """Keep the metadata of the pictures in `captured/`."""

    def __post_init__(self) -> None:
        if self.max_frames is not None and self.max_frames < 1:
            raise ValueError(f"need max_frames >= 1, got {self.max_frames}")
        if self.fps <= 0:
            raise ValueError(f"need fps > 0, got {self.fps}")

    @property
    def num_frames(self) -> int:
        """How many frames will be walked."""
        most = self.max_frames if self.max_frames is not None else len(self.recording)
        return min(most, len(self.recording))


@dataclass(frozen=True)
class WalkedFrame:
    """One frame of the walk: what was seen before the decision, and the decision."""

    frame: Frame
    seen: Comparison | None
    decision: Decision
    record: FrameRecord


class Walk:
    """Walks a recording frame by frame and captures what the policy takes.

    Without a depth model, a frame without depth can be looked at but not captured.
    """

    def __init__(self, options: ReplayOptions, policy: Policy) -> None:
        """Stand before the first frame."""
        self._options = options
        self._policy = policy
        self._stopwatch = Stopwatch()
        self._scene = Reconstruction(options.method, stopwatch=self._stopwatch)
        self._views: list[int] = []
        self.dropped_at: dict[int, int] = {}
        """Frames that were captured and given up, and the frame at which they were."""

    @property
    def views(self) -> Sequence[int]:
        """Frames that are captured now, in order."""
        return tuple(self._views)

    def frames(self, *, progress: FrameProgress = iter) -> Iterator[WalkedFrame]:
        """Walk.

        Args:
            progress: Wraps the frame numbers.

        Raises:
            RecordingError: A frame cannot be read, or no frame can be captured.
        """
        last = 0
        for index in progress(range(self._options.num_frames)):
            last = index
            with self._stopwatch.stage("read"):
                frame = self._options.recording.read(index)
            with self._stopwatch.stage("resize"):
                small = self._scene.prepare(frame)
            seen = None
            if self._views:
                seen = self._scene.compare(small.rgb, small.camera, depth_m=frame.depth_m)
                seen = replace(seen, errors=seen.errors.within(small.mask))
            decision = self._policy.observe(
                ReplayCandidate(index, frame, small.camera, self._scene, tuple(self._views), seen)
            )
            self._drop(decision, index)
            if decision.take:
                self._scene.add_view(frame)
                self._views.append(index)
            yield WalkedFrame(
                small, seen, decision, _record(index, small, seen, decision, self._stopwatch.take())
            )
        self._drop(self._policy.finish(), last)
        if not self._views and not self.dropped_at:
            raise RecordingError(
                self._options.recording.path,
                "no frame that the policy wanted has metric depth",
                remedy=RECORD_DEPTH,
            )

    def _drop(self, decision: Decision, index: int) -> None:
        for number in decision.dropped:
            place = self._views.index(number)
            self._scene.remove_view(place)
            del self._views[place]
            self.dropped_at[number] = index


@dataclass(frozen=True)
class ReplayCandidate:
    """The frame that is walked over, as a policy sees it (`selection.policy.Candidate`)."""

    number: int
    full: Frame
    camera: Camera
    scene: Reconstruction
    views: tuple[int, ...]
    seen: Comparison | None

    @property
    def accepted(self) -> bool:
        """Whether it can be captured."""
        return self.scene.accepts(self.full)

    def sharpness(self) -> float:
        """How sharp it is at the working size."""
        return sharpness(self.scene.prepare(self.full).rgb)

    def frame(self, pixels: int) -> Frame:
        """Return the picture and its camera with about so many pixels."""
        return self.scene.builder.with_pixels(pixels).prepare(self.full)

    def mpi(self, pixels: int) -> Mpi:
        """Return its MPI with about so many pixels."""
        return self.scene.builder.with_pixels(pixels).build(self.full, self.scene.views).mpi

    def peaked_share(self, views: Sequence[int]) -> float:
        """Return how much of it is red where the views captured so far show it.

        Raises:
            ValueError: These are not the views captured so far.
        """
        if tuple(views) != self.views or self.seen is None:
            raise ValueError(f"need the views captured so far, {self.views}, got {tuple(views)}")
        return self.seen.errors.peaked_share


def _record(
    index: int,
    small: Frame,
    seen: Comparison | None,
    decision: Decision,
    stage_ms: dict[str, float],
) -> FrameRecord:
    rotation = small.camera.world_from_cam.rotation
    return FrameRecord(
        index=index,
        name=small.name,
        timestamp_s=small.timestamp_s,
        position_m=small.camera.position_m,
        forward=rotation[:, 2],
        up=-rotation[:, 1],
        captured=decision.take,
        reason=decision.reason,
        nearest_distance_m=min(n.distance_m for n in seen.neighbours) if seen else None,
        peaked_share=seen.errors.peaked_share if seen else None,
        wrong_share=seen.errors.wrong_share if seen else None,
        unseen_share=seen.errors.unseen_share if seen else None,
        unfixable_share=seen.errors.unfixable_share if seen else None,
        mean_error=seen.errors.mean_error if seen else None,
        correction=None if seen is None else _correction(seen.alignment),
        stage_ms=stage_ms,
    )


def _correction(alignment: Alignment | None) -> PoseCorrection | None:
    if alignment is None:
        return None
    rotation = alignment.camera.world_from_cam.rotation
    return PoseCorrection(
        moved_m=alignment.moved_m,
        turned_rad=alignment.turned_rad,
        failure=alignment.failure,
        position_m=alignment.camera.position_m,
        forward=rotation[:, 2],
        up=-rotation[:, 1],
    )


def replay(options: ReplayOptions, out: Path, *, progress: FrameProgress = iter) -> ReplaySummary:
    """Replay and write `overlay.mp4`, `frames.csv`, `summary.json`, `report.html`, `captured/`.

    Raises:
        RecordingError: The recording or one of its frames cannot be used, or is reached by a link
            that leaves the recording.
        OutputError: `out` is taken, full or not writable; it is complete or absent.
        ToolMissing: There is no program to encode the video with.
    """
    if options.method.depth_model is None and not _has_maps(options):
        raise RecordingError(options.recording.path, "no frame has depth", remedy=RECORD_DEPTH)
    options.recording.check_subset(
        range(options.num_frames), follow_links=options.follow_links, keep_exif=options.keep_exif
    )
    with complete_or_absent(out) as folder:
        guided = _scanned(options)
        walk = Walk(options, _policy(options, guided))
        records: list[FrameRecord] = []
        stills = StillPicker()
        size_px = (0, 0)
        with contextlib.ExitStack() as stack:
            video: tuple[OverlayVideo, VideoWriter] | None = None
            for walked in walk.frames(progress=progress):
                panels = _panels(walked, options.overlay, options.method.marks)
                size_px = walked.frame.camera.pinhole.size_px
                if options.with_video:
                    if video is None:
                        drawing = OverlayVideo(
                            _panel_size_px(options),
                            frames=options.num_frames,
                            threshold_share=options.selection.threshold_share,
                        )
                        writer = VideoWriter(
                            folder / "overlay.mp4", drawing.size_px, fps=options.fps
                        )
                        video = drawing, stack.enter_context(writer)
                    video[1].write(video[0].draw(panels, walked.record))
                stills.offer(walked.record, panels)
                records.append(walked.record)
        records = [with_dropped_at(record, walk.dropped_at) for record in records]
        settings = ReplayHeader(
            version=peaking.__version__,
            preset=options.preset,
            options={
                **options.method.as_dict(),
                **asdict(options.selection),
                "max_frames": options.max_frames,
                "overlay": options.overlay,
            },
            scene=options.recording.name,
            size_px=size_px,
            fps=options.fps,
            threshold_share=options.selection.threshold_share,
            policy=options.selection.policy,
            num_views=options.selection.num_views,
            guide=None
            if options.guide is None or guided is None
            else {"kind": options.guide.kind, **guided.as_dict()},
        )
        summary = summarize(settings, records)
        options.recording.write_subset(
            summary.captured_indices,
            folder / "captured",
            follow_links=options.follow_links,
            keep_exif=options.keep_exif,
        )
        write_frames_csv(folder / "frames.csv", records)
        write_summary(folder / "summary.json", summary)
        write_report(
            folder / "report.html", summary=summary, records=records, stills=stills.stills()
        )
    return summary


def _has_maps(options: ReplayOptions) -> bool:
    """Return whether any frame has a depth map; nothing is decoded for that."""
    frames = range(options.num_frames)
    return any(options.recording.depth_size_px(number) is not None for number in frames)


def _panel_size_px(options: ReplayOptions) -> tuple[int, int]:
    """Return a size that all frames fit into: a phone may be turned in between."""
    sizes_px = [
        working_size_px(*camera.pinhole.size_px, pixels=options.method.pixels)
        for camera in options.recording.cameras[: options.num_frames]
    ]
    return max(width for width, _ in sizes_px), max(height for _, height in sizes_px)


def _scanned(options: ReplayOptions) -> GuidedWalk | None:
    if options.guide is None:
        return None
    return guided_walk(
        options.recording, options.guide, num_frames=options.num_frames, options=options.method
    )


def _policy(options: ReplayOptions, guided: GuidedWalk | None) -> Policy:
    """Return what decides; policies that need the whole path look at it first."""
    if guided is not None:
        return Chosen({i: f"target {target}" for i, target in guided.target_of_frame.items()})
    asked = options.selection.num_views
    if asked is not None and asked > len(_usable(options)):
        raise RecordingError(
            options.recording.path,
            f"leaves {len(_usable(options))} frames to choose from, and {asked} views were asked "
            "for",
            remedy="ask for fewer (--views), or replay more frames",
        )
    try:
        return create_policy(options.selection, options.method)
    except NeedsWholePath:
        recorded = RecordedFrames(options.recording, options.method)
        return create_policy(
            options.selection, options.method, path=recorded.path(_usable(options))
        )


def _usable(options: ReplayOptions) -> list[int]:
    """Return the frames that can be captured: those with depth, or all where none is needed."""
    has_depth = options.recording.has_depth
    anyway = options.method.depth_model is not None or not any(has_depth)
    return [i for i in range(options.num_frames) if has_depth[i] or anyway]


def _panels(walked: WalkedFrame, overlay: Overlay, marks: Marks) -> Panels:
    live = walked.frame.rgb
    if walked.seen is None:
        black = np.zeros_like(live)
        return Panels(live, black, black)
    rendering, errors = walked.seen.rendering, walked.seen.errors
    third = draw(overlay, rendering=rendering, errors=errors, live=live, marks=marks)
    return Panels(live, mpi_over_black(rendering), third)
