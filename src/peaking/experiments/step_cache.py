"""What steps have found, one file each, so that a run that was stopped goes on."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import peaking
from peaking.experiments.plan import EvaluationStep, key_of
from peaking.experiments.steps import Found
from peaking.output import write_atomically

LOG = logging.getLogger(__name__)


class StepCache:
    """A folder of results by the keys of their steps."""

    def __init__(self, folder: Path) -> None:
        """Use a folder; it is made when something is kept."""
        self._folder = folder
        self._held = len(list(folder.glob("*Step-*.json")))
        self._used = 0

    def get(self, step: EvaluationStep) -> Found | None:
        """Return what a step found, or None; a damaged file counts as none, and is said."""
        path = self._path(step)
        try:
            found: Found | None = json.loads(path.read_bytes())
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            LOG.warning("%s: damaged (%s); this step is done again", path, error)
            return None
        if not isinstance(found, dict):
            return None
        self._used += 1
        return found

    def tell_if_none_fits(self) -> None:
        """Say, once, that an earlier run was of something else, so that all of it is done again."""
        if self._held and not self._used:
            LOG.warning(
                "%s: none of the %d steps that are kept here is of these recordings, these options "
                "and peaking %s; all steps are done again",
                self._folder,
                self._held,
                peaking.__version__,
            )
            self._held = 0

    def keep(self, step: EvaluationStep, found: Found) -> None:
        """Keep what a step found.

        Raises:
            OutputError: The folder is not writable, or the disk is full.
        """
        write_atomically(self._path(step), json.dumps(found).encode())

    def _path(self, step: EvaluationStep) -> Path:
        return self._folder / f"{type(step).__name__}-{key_of(step)}.json"
