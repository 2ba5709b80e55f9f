"""`peaking study analyse`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Analyse:
    """Test every measure of a study as its protocol declares, and write a report.

    Writes report.html, results.txt (text to paste), results.csv, the data (long.csv, wide.csv,
    codebook.csv) and figures/ as SVG and PNG. Needs: pip install 'peaking[study]'

    Examples:
      peaking study analyse study --out results
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the study: protocol.toml and participants/."""
    out: Path
    """Folder to write; it must not exist, or be empty."""

    def run(self) -> None:
        """Analyse, and say where the report is."""
        from importlib.metadata import version

        from peaking.errors import ToolMissing

        try:
            from peaking.study.analysis.run import analyse_folder
        except ModuleNotFoundError as error:
            package = (error.name or "").partition(".")[0]
            if package not in ("matplotlib", "scipy", "statsmodels"):
                raise
            raise ToolMissing(
                f"study analyse needs {package}: pip install 'peaking[study]'"
            ) from error
        analysis = analyse_folder(self.folder, self.out, version=version("peaking"))
        alpha = analysis.protocol.alpha
        declared = [m for m in analysis.measures if m.families and m.result is not None]
        found = [m for m in declared if (m.p_decisive or 0.0) < alpha]
        print(
            f"{len(analysis.participants)} participants; {len(found)} of {len(declared)} declared "
            f"hypotheses significant at {alpha:g} after Holm's correction"
        )
        print(f"report: {(self.out / 'report.html').resolve()}")
