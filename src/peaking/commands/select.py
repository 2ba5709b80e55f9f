"""`peaking select`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.commands.options import MethodOptions
from peaking.commands.scenes import SceneOptions, residuals_of
from peaking.terminal import say

STARTING = "starting (the first run compiles for a minute)"
COMPILED_AFTER = 2


@dataclass(frozen=True)
class Select:
    """Choose the best frames of a recording and write them as a data set.

    Every frame is tried as a view, and the one that is missed least is dropped, again and again:
    the one without which the others show all frames least worse. Blurred frames, other exposures
    and near-duplicates go first. Without depth, frames are chosen by poses and sharpness alone.

    Beside the data set lie selection.csv (every frame: kept or not, why, sharpness, worth) and
    report.html (what more views would bring, the path, what was left out).

    Examples:
      peaking select scenes/desk --views 12 --out out/best12
      peaking select ~/captures/garden --views auto --out garden_best
    """

    scene: Annotated[Path, tyro.conf.Positional]
    """A recording of any format (docs/formats.md), or a zip of one; with or without depth."""
    out: Path
    """Folder to write; it must be empty or not exist."""
    views: int | Literal["auto"] = "auto"
    """How many frames; auto: as many until twice as many would bring less than 1 dB."""
    follow_links: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Copy also files that links lead to from outside the recording."""
    keep_exif: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Keep the metadata of the pictures: EXIF with GPS, XMP, comments."""
    json: Path | None = None
    """Also write the choice and the seconds to this file, as JSON."""
    reading: SceneOptions = field(default_factory=SceneOptions)
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Choose and write, and print where the report is."""
        from tqdm import tqdm

        from peaking.best_frames import choose_best
        from peaking.best_frames.files import write_best_frames
        from peaking.commands.results import write_results
        from peaking.commands.serving import keep_private
        from peaking.output import complete_or_absent

        keep_private()
        recording = self.reading.open(self.scene)
        recording.check_subset(
            range(len(recording)), follow_links=self.follow_links, keep_exif=self.keep_exif
        )
        num_views = None if self.views == "auto" else self.views
        if num_views is not None and num_views < 1:
            raise ArgumentError(f"need --views of at least 1, or auto, got {num_views}")

        def shown(numbers: Sequence[int]) -> Iterable[int]:
            bar = tqdm(numbers, desc=STARTING, unit="frame")

            def described() -> Iterator[int]:
                for place, number in enumerate(bar):
                    if place == COMPILED_AFTER:
                        bar.set_description("looking")
                    yield number

            return described()

        with complete_or_absent(self.out) as folder:
            with checked_arguments(num_views="--views"):
                options = self.method.options()
                best = choose_best(recording, num_views, options=options, progress=shown)
            write_best_frames(
                recording, best, folder, follow_links=self.follow_links, keep_exif=self.keep_exif
            )
        if num_views is not None and len(best.kept) < num_views:
            say(f"only {len(best.kept)} frames were taken from different places")
        if not best.by_pictures:
            say(
                "no frame has depth: chosen by poses and sharpness alone; what a model would get "
                "wrong is not known"
            )
        seconds = {stage: round(spent_s, 2) for stage, spent_s in best.seconds.items()}
        say(f"kept {len(best.kept)} of {len(best.frames)} frames: {self.out}")
        say(
            f"choosing {seconds['choosing']:.0f} s "
            f"({len(best.frames) / max(seconds['choosing'], 1e-3):.0f} frames per second), reading "
            f"{seconds['reading']:.0f} s, generating MPIs {seconds['generating']:.0f} s"
        )
        say(f"report: {(self.out / 'report.html').resolve()}")
        write_results(
            self,
            {
                "kept": best.kept,
                "by_pictures": best.by_pictures,
                "curve": [list(vars(point).values()) for point in best.curve],
                "seconds": seconds,
                **residuals_of(recording),
            },
        )
