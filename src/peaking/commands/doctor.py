"""`peaking doctor`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from peaking.commands.scenes import SceneOptions
from peaking.terminal import say

MOST_NAMES = 8


@dataclass(frozen=True)
class Doctor:
    """Find the bad pictures of a recording, with or without depth, and say what is wrong.

    Looked for are blur, too dark and over-exposed pictures, jumps of exposure, poses that do not
    fit, swapped pictures, what moved (with depth), pictures taken twice, and, of all pictures,
    intrinsics and axes that do not fit. Writes report.html and doctor.csv, and lists what to take
    again. Nothing is changed.

    Examples:
      peaking doctor scenes/desk --out out/doctor
      peaking doctor ~/colmap/garden --images ~/photos/garden --out garden_doctor
    """

    path: Annotated[Path, tyro.conf.Positional]
    """A recording of any format (docs/formats.md), or a zip of one."""
    out: Path
    """Folder to write; it must be empty or not exist."""
    json: Path | None = None
    """Also write what was found to this file, as JSON."""
    reading: SceneOptions = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Look, write, and print what is wrong."""
        from tqdm import tqdm

        from peaking.audit.examination import examine
        from peaking.audit.report import HEADINGS, again, findings_csv, report_page
        from peaking.commands.results import write_results
        from peaking.commands.serving import keep_private
        from peaking.output import check_new, complete_or_absent

        keep_private()
        check_new(self.out)
        recording = self.reading.open(self.path)

        def shown(numbers: Sequence[int], what: str) -> Iterable[int]:
            return tqdm(numbers, desc=what, leave=False)

        with complete_or_absent(self.out) as folder:
            found = examine(recording, progress=shown)
            (folder / "doctor.csv").write_text(findings_csv(recording, found), encoding="utf-8")
            (folder / "report.html").write_text(report_page(recording, found), encoding="utf-8")
        if found.whole is not None:
            say(
                f"all pictures: {found.whole.words} (points are {found.whole.error_px:.1f} px off, "
                f"and would be {found.whole.mended_px:.1f} px)"
            )
        for note in found.not_checked:
            say(f"not checked: {note}")
        counts = Counter(finding.kind for finding in found.findings)
        for kind, heading in HEADINGS.items():
            if counts[kind]:
                frames = [f.frame for f in found.findings if f.kind == kind]
                say(f"{heading.lower()} ({counts[kind]}): {_named(recording.names, frames)}")
        spoilt = len({finding.frame for finding in found.findings})
        say(f"{spoilt} of {len(recording)} pictures have something to look at")
        if again(found):
            say(f"to take again: {_named(recording.names, again(found))}")
        say(f"report: {(self.out / 'report.html').resolve()}")
        whole = None if found.whole is None else asdict(found.whole)
        findings = [{"name": recording.names[f.frame], **asdict(f)} for f in found.findings]
        write_results(
            self, {"whole": whole, "not_checked": list(found.not_checked), "findings": findings}
        )


def _named(names: Sequence[str], frames: Sequence[int]) -> str:
    shown = ", ".join(names[i] for i in frames[:MOST_NAMES])
    return shown + (", …" if len(frames) > MOST_NAMES else "")
