"""`peaking study analyse`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from peaking.terminal import say


@dataclass(frozen=True)
class Analyse:
    """Test every measure of a study as its protocol declares, and write a report.

    Writes report.html, results.txt (sentences for a paper), results.csv, the data (long.csv,
    wide.csv, codebook.csv) and figures/ as SVG and PNG. Needs: pip install 'peaking[study]'

    Examples:
      peaking study analyse study --out results
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the study: protocol.toml and participants/."""
    out: Path
    """Folder to write; it must be empty or not exist."""
    json: Path | None = None
    """Also write every test of results.csv to this file, as JSON."""

    def run(self) -> None:
        """Analyse, and say where the report is."""
        from importlib.metadata import version

        from peaking.commands.results import write_results
        from peaking.commands.serving import keep_private
        from peaking.errors import ToolMissing

        try:
            from peaking.study.analysis.csv_files import result_records
            from peaking.study.analysis.run import analyse_folder
        except ModuleNotFoundError as error:
            package = (error.name or "").partition(".")[0]
            if package not in ("matplotlib", "scipy", "statsmodels"):
                raise
            raise ToolMissing(
                f"study analyse needs {package}: pip install 'peaking[study]'"
            ) from error
        keep_private()
        analysis = analyse_folder(self.folder, self.out, version=version("peaking"))
        alpha = analysis.protocol.alpha
        declared = [m for m in analysis.measures if m.families and m.result is not None]
        found = [m for m in declared if (m.p_decisive or 0.0) < alpha]
        write_results(
            self,
            {
                "participants": len(analysis.participants),
                "alpha": alpha,
                "hypotheses": len(declared),
                "significant": len(found),
                "tests": result_records(analysis),
            },
        )
        say(
            f"{len(analysis.participants)} participants; {len(found)} of {len(declared)} declared "
            f"hypotheses are significant at {alpha:g} after Holm's correction"
        )
        say(f"report: {(self.out / 'report.html').resolve()}")
