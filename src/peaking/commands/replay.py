"""`peaking replay`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from peaking.commands.arguments import checked_arguments
from peaking.commands.options import MethodOptions
from peaking.commands.scenes import SceneOptions
from peaking.options import PAPER_PEAKED_SHARE, PolicyName
from peaking.terminal import say

STARTING = "starting (the first run compiles for a minute)"
COMPILED_AFTER = 2
"""The first frame is captured and the second compared with it: then all kernels are compiled."""


@dataclass(frozen=True)
class Replay:
    """Replay a recording frame by frame, capture the frames that a policy takes, write a report.

    The default policy is the paper's: it takes the first frame, then every frame whose peaked share
    exceeds the threshold. With --guide, the recording is first scanned for the nearest depth, and
    then the frames at the guide's targets are captured. Writes overlay.mp4, frames.csv,
    summary.json, report.html and captured/ (the captured views as a data set).

    Examples:
      peaking replay scenes/desk --out out/desk
      peaking replay scenes/desk --out out/paper --preset paper
      peaking replay ~/recordings/kitchen --out out/k --threshold 0.03 --overlay video
      peaking replay scenes/desk --out out/best12 --policy peaking --views 12
      peaking replay scenes/desk --out out/llff --guide plenoptic --near-m 0.03
    """

    scene: Annotated[Path, tyro.conf.Positional]
    """A recording of any format (docs/formats.md), or a zip of one."""
    out: Path
    """Folder to write; it must be empty or not exist."""
    policy: PolicyName = "threshold"
    """Which frames are captured: `threshold` is the paper's rule, `peaking` our own."""
    views: int | None = None
    """Number of views to choose; required by most policies. `peaking` keeps as many as are enough
    without it, `threshold` goes by --threshold, `plenoptic` by --spacing-m."""
    threshold: float = PAPER_PEAKED_SHARE
    """With --policy threshold: peaked share, 0…1, above which a frame is captured (the paper's)."""
    spacing_m: float | None = None
    """With --policy plenoptic and without --views: distance (m) between views."""
    seed: int = 0
    """With --policy random: seed of the random choice."""
    guide: Literal["plenoptic", "planes", "hemisphere"] | None = None
    """Capture at the targets of a guide (LLFF's grid or another) instead of by the peaked share."""
    area_m: float = 0.15
    """With --guide: side (m) of the square in which views are taken."""
    near_m: float | None = None
    """With --guide: distance (m) at which a target counts as reached (a quarter of the spacing)."""
    angle_deg: float = 10.0
    """With --guide: angle (degrees) to the target's viewing direction that is still accepted."""
    max_frames: int | None = None
    """Replay only the first frames, this many."""
    overlay: Literal["mpi", "video", "peaks"] = "peaks"
    """Third picture of the video: MPI over black, peaks on the video, or peaks on the MPI."""
    fps: float = 15.0
    """Frames per second of the video."""
    no_video: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write no overlay.mp4, which needs the program ffmpeg."""
    follow_links: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Copy into captured/ also files that links lead to from outside the recording."""
    keep_exif: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Keep the metadata of the pictures in captured/: EXIF with GPS, XMP, comments."""
    json: Path | None = None
    """Also write summary.json to this file."""
    reading: SceneOptions = field(default_factory=SceneOptions)
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Replay, and print where the report is."""
        from tqdm import tqdm

        from peaking.commands.serving import keep_private
        from peaking.output import write_atomically
        from peaking.replay.guided import GuideOptions
        from peaking.replay.run import ReplayOptions, replay
        from peaking.replay.video import find_h264_encoder
        from peaking.selection.registry import SelectionOptions

        keep_private()
        if not self.no_video:
            find_h264_encoder()
        recording = self.reading.open(self.scene)
        with checked_arguments(num_views="--views", threshold_share="--threshold"):
            guide = None
            if self.guide is not None:
                guide = GuideOptions(
                    kind=self.guide,
                    area_side_m=self.area_m,
                    near_m=self.near_m,
                    angle_deg=self.angle_deg,
                )
            options = ReplayOptions(
                recording=recording,
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
                guide=guide,
                follow_links=self.follow_links,
                keep_exif=self.keep_exif,
            )
        bar = tqdm(range(options.num_frames), desc=STARTING, unit="frame")

        def shown(_: Iterable[int]) -> Iterator[int]:
            for index in bar:
                if index == COMPILED_AFTER:
                    bar.set_description("replay")
                yield index

        with bar:
            summary = replay(options, self.out, progress=shown)
        if self.json is not None:
            write_atomically(self.json, (self.out / "summary.json").read_bytes())
        mean = summary.mean_peaked_share
        share = "" if mean is None else f"; on average {mean:.2%} of the pixels were red"
        say(f"captured {summary.captured} of {summary.frames} frames{share}")
        walk = summary.settings.guide
        if walk is not None:
            say(
                f"guide {walk['kind']}: nearest depth {walk['z_min_m']:.2f} m; the recorded path "
                f"reaches {walk['reached']} of {walk['targets']} targets"
            )
        say(f"captured views: {self.out / 'captured'}")
        say(f"report: {(self.out / 'report.html').resolve()}")
