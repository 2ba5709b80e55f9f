"""`peaking replay`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from peaking.commands.options import MethodFlags
from peaking.options import PAPER_PEAKED_SHARE

STARTING = "starting (the first run compiles for half a minute)"
PolicyName = Literal["peaking", "threshold", "uniform", "farthest", "plenoptic", "random", "all"]
COMPILED_AFTER = 2
"""The first frame is captured and the second one looked at: by then all kernels are there."""


@dataclass(frozen=True)
class Replay:
    """Walk a recording and capture the frames that a policy takes.

    By default the paper's: the first frame, then every frame whose peaked share exceeds the
    threshold. With --guide it scans the recording for the nearest depth first, and takes the frames
    at the guide's targets.
    Writes overlay.mp4, frames.csv, summary.json, report.html and captured/ (a data set of the
    chosen views).

    Examples:
      peaking replay scenes/desk --out out/desk
      peaking replay scenes/desk --out out/paper --preset paper
      peaking replay ~/recordings/kitchen --out out/k --threshold 0.03 --overlay video
      peaking replay scenes/desk --out out/best12 --policy peaking --views 12
      peaking replay scenes/desk --out out/llff --guide plenoptic --near 0.03
    """

    scene: Annotated[Path, tyro.conf.Positional]
    """A nerfstudio folder: transforms.json, pictures, depth in 16-bit millimetres."""
    out: Path
    """Folder to write; it must not exist, or be empty."""
    policy: PolicyName = "threshold"
    """Which frames are captured: `threshold` is the paper's rule, `peaking` our own."""
    views: int | None = None
    """How many views to choose; all policies but `threshold`, `plenoptic` and `all` need it."""
    threshold: float = PAPER_PEAKED_SHARE
    """Of `threshold`: peaked share, 0…1, above which a frame is captured (the paper's)."""
    spacing_m: float | None = None
    """Of `plenoptic` without --views: metres between views."""
    seed: int = 0
    """Of `random`."""
    guide: Literal["plenoptic", "planes", "hemisphere"] | None = None
    """Capture at the targets of a guide, LLFF's grid or another, instead of where it is red."""
    area: float = 0.15
    """Of the guide: side in metres of the square in which views are taken."""
    near: float | None = None
    """Of the guide: metres from a target that are near enough (a quarter of the spacing)."""
    angle: float = 10.0
    """Of the guide: degrees from a target's viewing direction that are near enough."""
    max_frames: int | None = None
    """Walk only so many frames."""
    overlay: Literal["mpi", "video", "peaks"] = "peaks"
    """Third picture of the video: MPI over black, peaks on the video, or peaks on the MPI."""
    fps: float = 15.0
    """Frames per second of the video."""
    no_video: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write no overlay.mp4 (which needs the program ffmpeg)."""
    method: MethodFlags = field(default_factory=MethodFlags)

    def run(self) -> None:
        """Replay, and say where the report is."""
        from tqdm import tqdm

        from peaking.datasets import open_recording
        from peaking.replay.guided import GuideChoice
        from peaking.replay.run import ReplayOptions, replay
        from peaking.replay.video import find_h264_encoder
        from peaking.selection.registry import SelectionOptions

        if not self.no_video:
            find_h264_encoder()
        how = ReplayOptions(
            recording=open_recording(self.scene),
            preset=self.method.preset,
            method=self.method.options(),
            selection=SelectionOptions(
                policy=self.policy,
                num_views=self.views,
                threshold_share=self.threshold,
                spacing_m=self.spacing_m,
                seed=self.seed,
            ),
            max_frames=self.max_frames,
            overlay=self.overlay,
            fps=self.fps,
            with_video=not self.no_video,
            guide=None
            if self.guide is None
            else GuideChoice(
                kind=self.guide, area_side_m=self.area, near_m=self.near, angle_deg=self.angle
            ),
        )
        bar = tqdm(range(how.num_frames), desc=STARTING, unit="frame")

        def shown(_: Iterable[int]) -> Iterator[int]:
            for index in bar:
                if index == COMPILED_AFTER:
                    bar.set_description("replay")
                yield index

        with bar:
            summary = replay(how, self.out, progress=shown)
        mean = summary.mean_peaked_share
        share = "" if mean is None else f", {mean:.2%} of the pixels red on average"
        print(f"captured {summary.captured} of {summary.frames} frames{share}")
        guide = summary.settings.guide
        if guide is not None:
            print(
                f"guide {guide['kind']}: nearest depth {guide['z_min_m']:.2f} m, "
                f"{guide['reached']} of {guide['targets']} targets are on the recorded path"
            )
        print(f"captured views: {self.out / 'captured'}")
        print(f"report: {(self.out / 'report.html').resolve()}")
