"""The fixtures that the tests in TypeScript read are those of the code in Python."""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

import numpy as np
import pytest

import web_fixtures
from peaking.mpi_file import decode

SAME = 1e-9
"""0 on the machine that wrote them; another processor may round the last digit differently."""


PICTURES = ("rendered", "depth_0_1_mm", "live")
ANSWERS = ("live_from_cam", "move_sd_m", "turn_sd_rad", "agreeing")
SAME_SEARCH = 1e-6
"""Of a search, whose steps add up what is rounded; 0 on the machine that wrote them."""


@pytest.mark.parametrize("name", ["view_weights.json", "exposure.json", "guidance.json"])
def test_the_answers_are_those_of_the_code(name: str) -> None:
    of_code = {
        "view_weights.json": web_fixtures.view_weight_cases,
        "exposure.json": web_fixtures.exposure_cases,
        "guidance.json": web_fixtures.guidance_cases,
    }[name]()
    stored = json.loads((web_fixtures.FOLDER / name).read_text())
    np.testing.assert_allclose(numbers(stored), numbers(of_code), rtol=SAME, atol=1e-12)


def unpacked(text: str) -> bytes:
    return zlib.decompress(base64.b64decode(text))


def test_the_answers_of_the_alignment_are_those_of_the_code() -> None:
    of_code = web_fixtures.align_cases()
    stored = json.loads((web_fixtures.FOLDER / "align.json").read_text())
    assert stored["constants"] == of_code["constants"]
    for before, now in zip(stored["cases"], of_code["cases"], strict=True):
        assert [before[k] for k in ("failure", "num_pixels")] == [
            now[k] for k in ("failure", "num_pixels")
        ]
        for name in PICTURES:
            assert unpacked(before[name]) == unpacked(now[name])
        np.testing.assert_allclose(
            *(np.concatenate([np.ravel(case[k]) for k in ANSWERS]) for case in (before, now)),
            rtol=SAME_SEARCH,
            atol=1e-9,
        )


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
