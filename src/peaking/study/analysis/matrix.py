"""One measure as participants × conditions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int

from peaking.study.measure_catalogue import Measure
from peaking.study.measures import catalogue_of
from peaking.study.tables import Measurement, Study, measurements


@dataclass(frozen=True)
class Matrix:
    """The numbers of one measure; NaN where one is missing or was not to be measured."""

    measure: Measure
    participants: tuple[str, ...]
    conditions: tuple[str, ...]
    values: Float64[np.ndarray, "participants conditions"]
    """Mean over the scenes of a condition; missing if one of them is."""
    places: Int[np.ndarray, "participants conditions"]
    """0 for the condition done first, 1 for the second …; -1 where it was not to be done."""


def matrices_of(study: Study) -> list[Matrix]:
    """Return every measure of a study, for the participants who count, in the order of tables."""
    return build_matrices(
        measurements(study),
        catalogue_of(study.protocol),
        tuple(condition.name for condition in study.protocol.conditions),
    )


def build_matrices(
    numbers: Sequence[Measurement], catalogue: Sequence[Measure], conditions: tuple[str, ...]
) -> list[Matrix]:
    """Arrange numbers by measure, participant and condition."""
    participants = tuple(dict.fromkeys(n.participant for n in numbers))
    row = {name: index for index, name in enumerate(participants)}
    column = {name: index for index, name in enumerate(conditions)}
    cells: dict[str, dict[tuple[int, int], list[float]]] = defaultdict(lambda: defaultdict(list))
    first = np.full((len(participants), len(conditions)), np.inf)
    for number in numbers:
        cell = row[number.participant], column[number.condition]
        cells[number.measure][cell].append(np.nan if number.value is None else number.value)
        first[cell] = min(first[cell], number.position)
    places = np.argsort(np.argsort(first, axis=1, kind="stable"), axis=1, kind="stable")
    places[~np.isfinite(first)] = -1
    found: list[Matrix] = []
    for measure in catalogue:
        values = np.full(first.shape, np.nan)
        for cell, several in cells[measure.name].items():
            values[cell] = float(np.mean(several))
        found.append(Matrix(measure, participants, conditions, values, places))
    return found
