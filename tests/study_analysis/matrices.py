"""Small studies as matrices, for the tests of the analysis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from peaking.study.analysis.matrix import Matrix
from peaking.study.measure_catalogue import Measure
from peaking.study.measures import catalogue_of
from peaking.study.protocol import Protocol, parse_protocol

THREE = """
version = 1
title = "Three ways <b>& more</b>"
design = "within"
order = "williams"
planned_participants = 18
seed = 3
conditions = [
  { name = "llff", label = "LLFF <guidance>", overlay = "none", guide = "plenoptic", scan = true },
  { name = "peaking", label = "Error peaking", overlay = "peaks" },
  { name = "free", label = "No guidance", overlay = "none" },
]
scenes = [{ name = "office", label = "Office" }]
[ask]
after_capture = ["paper_before"]
[[families]]
name = "task"
measures = ["tct_s", "captures", "s_conf"]
"""
TWO = "\n".join(line for line in THREE.splitlines() if '"free"' not in line)


def protocol(text: str = TWO, **fields: str) -> Protocol:
    """Return a protocol; `design="between"` and the like replace or add a line."""
    lines = [line for line in text.strip().splitlines() if line.split(" = ")[0] not in fields]
    added = [f'{name} = "{value}"' for name, value in fields.items()]
    return parse_protocol("\n".join([lines[0], *added, *lines[1:]]), Path("protocol.toml"))


def measure(name: str) -> Measure:
    return next(m for m in catalogue_of(protocol(THREE)) if m.name == name)


def matrix(of: Protocol, name: str, rows: Sequence[Sequence[float]]) -> Matrix:
    """Return the numbers of a measure; every second participant does them the other way round."""
    values = np.array(rows, dtype=np.float64)
    count = values.shape[1]
    places = np.array([np.roll(np.arange(count), row) for row in range(len(values))])
    return Matrix(
        measure=measure(name),
        participants=tuple(f"P{row + 1:02d}" for row in range(len(values))),
        conditions=tuple(condition.name for condition in of.conditions),
        values=values,
        places=places,
    )


def normal_rows(seed: int, means: Sequence[float], *, count: int = 18) -> list[list[float]]:
    """Return numbers whose conditions have the same spread."""
    rng = np.random.default_rng(seed)
    person = rng.normal(0, 3, (count, 1))
    return (np.array(means) + person + rng.normal(0, 2, (count, len(means)))).round(2).tolist()
