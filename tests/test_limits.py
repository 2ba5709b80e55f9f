"""The limits in the documents are those of the program."""

from __future__ import annotations

from pathlib import Path

import pytest

from peaking import limits
from peaking.datasets.point_cloud import MAX_POINTS
from peaking.server import wire
from peaking.server.app import ServerOptions

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    "number",
    [
        *(limits.MAX_PIXELS, limits.MAX_PICTURE_BYTES, limits.MAX_SCANS, limits.MAX_SCAN_PIXELS),
        *(limits.MAX_SEGMENTS, limits.MAX_CHUNKS, limits.MAX_POINTS_BYTES),
        *(limits.MAX_ASCII_POINTS_BYTES, limits.MAX_TRANSFORMS_VALUES),
        *(limits.MAX_TEXT_BYTES, limits.MAX_XML_BYTES, limits.MAX_MODEL_BYTES),
        *(limits.MAX_TRANSFORMS_BYTES, limits.MAX_CHECKPOINT_BYTES, wire.MAX_POINTS, MAX_POINTS),
        *(limits.MAX_TRACE_UNPACKED_BYTES, wire.MAX_TRACE_BYTES),
        ServerOptions(devices=None, client_dir=ROOT).max_upload_bytes,
    ],
)
def test_the_protocol_tells_the_limits(number: int) -> None:
    table = (ROOT / "docs/protocol.md").read_text().split("## Limits")[1].split("\n## ")[0]
    assert f"{number:,}" in table


def test_the_format_and_the_browser_have_the_same_limits() -> None:
    text = (ROOT / "docs/mpi-format.md").read_text()
    script = (ROOT / "web/src/mpi/mpi_file.ts").read_text()
    assert limits.MAX_MPI_PIXELS == 2**24
    assert limits.MAX_PLACES == 2**25
    assert limits.MAX_MPI_BYTES == 256 * 2**20
    for said in ("2²⁴ pixels", "2²⁵ bits", "256 MiB", f"1…{limits.MAX_MPI_SIDE_PX}"):
        assert said in text
    for said in ("MAX_PIXELS = 2 ** 24", "MAX_PLACES = 2 ** 25", "MAX_FILE_BYTES = 256 * 2 ** 20"):
        assert said in script
    for said in (limits.MAX_MPI_SIDE_PX, limits.MAX_PLANES, limits.MAX_TILES):
        assert str(said) in script
        assert str(said) in text
