"""The virtual photographer: walk a recording, and capture where the error peaks say so.

The first frame is captured; after it, every frame whose peaked share exceeds the threshold (paper,
section 4.2). With a guide, the frames at its targets are, whatever is red (`guided`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import peaking
from peaking.datasets.nerfstudio import Recording, write_recording_subset
from peaking.errors import RecordingError
from peaking.frame import Frame
from peaking.output import complete_or_absent
from peaking.overlay import Overlay, draw, mpi_over_black
from peaking.pipeline import LocalLightField, Seen
from peaking.presets import Options
from peaking.replay.guided import GuideChoice, GuidedWalk, guided_walk
from peaking.replay.overlay_video import OverlayVideo, Panels
from peaking.replay.records import (
    FrameRecord,
    ReplaySettings,
    ReplaySummary,
    summarize,
    write_frames_csv,
    write_summary,
)
from peaking.replay.report import write_report
from peaking.replay.stills import StillPicker
from peaking.replay.video import VideoWriter
from peaking.timing import Stopwatch

PAPER_THRESHOLD_SHARE = 0.0428
"""Mean peaked share over all viewpoints and participants of the paper's study."""

Progress = Callable[[Iterable[int]], Iterable[int]]
"""Wraps the frame numbers to show how far the walk is, such as `tqdm`."""


@dataclass(frozen=True)
class ReplayPlan:
    """What to replay, and how."""

    recording: Recording
    preset: str
    options: Options
    threshold_share: float = PAPER_THRESHOLD_SHARE
    """A frame with a greater peaked share is captured, 0…1."""
    max_frames: int | None = None
    overlay: Overlay = "peaks"
    """The third picture of the video."""
    fps: float = 15.0
    with_video: bool = True
    guide: GuideChoice | None = None
    """Capture at the targets of a guide instead of where it is red."""

    def __post_init__(self) -> None:
        if not 0 <= self.threshold_share < 1:
            raise ValueError(f"need 0 <= threshold < 1, got {self.threshold_share}")
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
class Step:
    """One frame of the walk: what was seen before the decision, and the decision."""

    frame: Frame
    seen: Seen | None
    record: FrameRecord


def walk(
    plan: ReplayPlan, *, guided: GuidedWalk | None = None, progress: Progress = iter
) -> Iterator[Step]:
    """Walk the recording frame by frame.

    Without a depth model, a frame without depth can be looked at but not captured; the next one
    with depth is.

    Args:
        plan: What to replay.
        guided: The frames to capture, of the plan's guide; without it, those that are too red.
        progress: Wraps the frame numbers.

    Raises:
        RecordingError: A frame cannot be read, or no frame has depth.
    """
    stopwatch = Stopwatch()
    scene = LocalLightField(plan.options, stopwatch=stopwatch)
    for index in progress(range(plan.num_frames)):
        with stopwatch.stage("read"):
            frame = plan.recording.read(index)
        with stopwatch.stage("resize"):
            small = scene.prepare(frame)
        seen = scene.see(small.rgb, small.camera) if scene.views else None
        if guided is None:
            wanted = seen is None or seen.errors.peaked_share > plan.threshold_share
        else:
            wanted = index in guided.target_of_frame
        captured = wanted and scene.takes(frame)
        if captured:
            scene.add_view(frame)
        yield Step(small, seen, _record(index, small, seen, captured, stopwatch.take()))
    if not scene.views:
        raise RecordingError(
            plan.recording.root / "transforms.json",
            "no frame has metric depth",
            field="frames[*].depth_file_path",
            remedy="replay a recording with depth (16-bit PNG, millimetres), or have it estimated: "
            "--depth-model",
        )


def _record(
    index: int, small: Frame, seen: Seen | None, captured: bool, stage_ms: dict[str, float]
) -> FrameRecord:
    rotation = small.camera.world_from_cam.rotation
    return FrameRecord(
        index=index,
        name=small.name,
        timestamp_s=small.timestamp_s,
        position_m=small.camera.position_m,
        forward=rotation[:, 2],
        up=-rotation[:, 1],
        captured=captured,
        nearest_distance_m=min(n.distance_m for n in seen.neighbours) if seen else None,
        peaked_share=seen.errors.peaked_share if seen else None,
        missing_share=seen.errors.missing_share if seen else None,
        mean_error=seen.errors.mean_error if seen else None,
        stage_ms=stage_ms,
    )


def replay(plan: ReplayPlan, out: Path, *, progress: Progress = iter) -> ReplaySummary:
    """Replay and write `overlay.mp4`, `frames.csv`, `summary.json`, `report.html`, `captured/`.

    Raises:
        RecordingError: The recording or one of its frames cannot be used.
        OutputError: `out` is taken, full or not writable; it is complete or absent.
        ToolMissing: There is no program to encode the video with.
    """
    with complete_or_absent(out) as folder:
        guided = _scanned(plan)
        records: list[FrameRecord] = []
        stills = StillPicker()
        size_px = (0, 0)
        with contextlib.ExitStack() as stack:
            video: tuple[OverlayVideo, VideoWriter] | None = None
            for step in walk(plan, guided=guided, progress=progress):
                panels = _panels(step, plan.overlay)
                size_px = step.frame.camera.pinhole.size_px
                if plan.with_video:
                    if video is None:
                        drawing = OverlayVideo(
                            size_px,
                            frames=plan.num_frames,
                            fps=plan.fps,
                            threshold_share=plan.threshold_share,
                        )
                        writer = VideoWriter(folder / "overlay.mp4", drawing.size_px, fps=plan.fps)
                        video = drawing, stack.enter_context(writer)
                    video[1].write(video[0].draw(panels, step.record))
                stills.offer(step.record, panels)
                records.append(step.record)
        settings = ReplaySettings(
            version=peaking.__version__,
            preset=plan.preset,
            options={
                **plan.options.as_dict(),
                "threshold_share": plan.threshold_share,
                "max_frames": plan.max_frames,
                "overlay": plan.overlay,
            },
            scene=plan.recording.root.resolve().name,
            size_px=size_px,
            fps=plan.fps,
            threshold_share=plan.threshold_share,
            guide=None
            if plan.guide is None or guided is None
            else {"kind": plan.guide.kind, **guided.as_dict()},
        )
        summary = summarize(settings, records)
        write_recording_subset(plan.recording, summary.captured_indices, folder / "captured")
        write_frames_csv(folder / "frames.csv", records)
        write_summary(folder / "summary.json", summary)
        write_report(
            folder / "report.html", summary=summary, records=records, stills=stills.stills()
        )
    return summary


def _scanned(plan: ReplayPlan) -> GuidedWalk | None:
    if plan.guide is None:
        return None
    return guided_walk(plan.recording, plan.guide, num_frames=plan.num_frames, options=plan.options)


def _panels(step: Step, overlay: Overlay) -> Panels:
    if step.seen is None:
        black = np.zeros_like(step.frame.rgb)
        return Panels(step.frame.rgb, black, black)
    seen, live = step.seen, step.frame.rgb
    third = draw(overlay, view=seen.view, errors=seen.errors, live=live)
    return Panels(live, mpi_over_black(seen.view), third)
