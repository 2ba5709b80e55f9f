"""A study's folder read for analysis: one line per participant, trial and measure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from peaking.study.measures import measures_of
from peaking.study.protocol import Protocol, load_protocol
from peaking.study.records import ParticipantRecord, read_participants


@dataclass(frozen=True)
class Study:
    """A protocol and all that was recorded under it."""

    folder: Path
    protocol: Protocol
    participants: Sequence[ParticipantRecord]
    """All of them; those who do not count say why in `excluded`."""

    @property
    def counting(self) -> list[ParticipantRecord]:
        """Those who count."""
        return [p for p in self.participants if p.excluded is None]


@dataclass(frozen=True)
class Measurement:
    """One number."""

    participant: str
    condition: str
    scene: str
    position: int
    """Place of the trial in the participant's order, from 1."""
    measure: str
    """A name of `measures.catalogue_of`."""
    value: float | None
    """None: missing."""


def read_study(folder: Path) -> Study:
    """Read a study's folder.

    Raises:
        StudyError: protocol.toml or a participant's log cannot be used.
    """
    return Study(folder, load_protocol(folder), read_participants(folder))


def measurements(study: Study) -> list[Measurement]:
    """Return all numbers of those who count, of trials done or not, in the order of the trials."""
    found: list[Measurement] = []
    for participant in study.counting:
        for record in participant.trials:
            trial = record.trial
            found += [
                Measurement(
                    participant.pseudonym, trial.condition, trial.scene, trial.position, name, value
                )
                for name, value in measures_of(record, study.protocol).items()
            ]
    return found
