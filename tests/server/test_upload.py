from __future__ import annotations

import contextlib
import json
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from capture_uploads import (
    body_of,
    depth_mm,
    header,
    photo,
    points_m,
    upload,
    upload_without_depth,
)
from peaking.server.upload import BadUpload, parse_upload


def camera(**pinhole: Any) -> dict[str, Any]:
    good = header()["camera"]
    return {**good, "pinhole": good["pinhole"] | pinhole}


def test_a_good_upload_comes_apart() -> None:
    parsed = parse_upload(upload(3))
    assert parsed.photo == photo(3)
    assert parsed.depth_mm is not None
    np.testing.assert_array_equal(parsed.depth_mm, depth_mm(3))
    assert parsed.header.camera.world_from_cam[3] == pytest.approx(0.15)


def test_a_corrected_pose_stands_beside_the_devices_own() -> None:
    corrected = [1.0, 0, 0, 0.156, 0, 1, 0, 0, 0, 0, 1, 0]
    fields = header(3, corrected_world_from_cam=corrected, depth=None)
    parsed = parse_upload(body_of(fields, photo(3)))
    assert parsed.header.corrected_world_from_cam == corrected
    assert parsed.header.camera.world_from_cam[3] == pytest.approx(0.15)
    assert parse_upload(upload(3)).header.corrected_world_from_cam is None


def test_a_corrected_pose_must_be_rigid() -> None:
    bent = [2.0, 0, 0, 0.156, 0, 1, 0, 0, 0, 0, 1, 0]
    fields = header(3, corrected_world_from_cam=bent, depth=None)
    with pytest.raises(BadUpload, match="corrected_world_from_cam: need a rotation"):
        parse_upload(body_of(fields, photo(3)))


def test_depth_may_be_missing() -> None:
    parsed = parse_upload(body_of(header(depth=None), photo()))
    assert parsed.depth_mm is None
    assert parsed.points_m is None


@pytest.mark.parametrize("value", [0, 65535])
def test_depth_without_any_depth_is_none(value: int) -> None:
    depth = depth_mm()
    depth[:2] = value
    parsed = parse_upload(body_of(header(), photo() + depth.tobytes()))
    assert parsed.depth_mm is not None
    assert not parsed.depth_mm[:2].any()
    depth[:] = value
    assert parse_upload(body_of(header(), photo() + depth.tobytes())).depth_mm is None


def test_tracked_points_come_after_depth_or_in_its_place() -> None:
    parsed = parse_upload(upload_without_depth(3))
    assert parsed.depth_mm is None
    np.testing.assert_array_equal(np.asarray(parsed.points_m), points_m(3))
    rest = photo(3) + depth_mm(3).tobytes() + points_m(3).tobytes()
    parsed = parse_upload(body_of(header(3, points=40), rest))
    np.testing.assert_array_equal(np.asarray(parsed.depth_mm), depth_mm(3))
    np.testing.assert_array_equal(np.asarray(parsed.points_m), points_m(3))


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 2e5])
def test_points_that_are_no_places_are_named(wrong: float) -> None:
    points = points_m()
    points[7, 1] = wrong
    fields = header(depth=None, points=40)
    with pytest.raises(BadUpload, match=r"Point 7 is \(.*Points are in metres"):
        parse_upload(body_of(fields, photo() + points.tobytes()))


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        (header(protocol=1), "version 3"),
        (header(time_s=-1), "time_s"),
        (header(photo_bytes=0), "photo_bytes"),
        (header(photo_bytes=10_000_000), "cut off"),
        (header(camera=None), "camera"),
        (header(camera="front"), "camera"),
        (header() | {"colour": "red"}, "colour"),
        (header(depth={"width_px": 15, "height_px": 31}), "bytes of depth"),
        (header(depth={"width_px": 32, "height_px": 15}), "aspect"),
        (header(depth={"width_px": 0, "height_px": 0}), "width_px"),
        (header(points=1), "12"),
        (header(points=-1), "points"),
        (header(points=20_001), "points"),
        (header(points=1.5), "points"),
        (header(points=[[0, 0, 1]]), "points"),
        (header(camera=camera(fx_px=0.0)), "fx_px"),
        (header(camera=camera(fx_px=1e9)), "fx_px"),
        (header(camera=camera(width_px=61)), "61x128"),
        (header(camera=camera(cx_px=900.0)), "cx_px"),
        (header(camera={**header()["camera"], "world_from_cam": [2.0] * 12}), "rotation"),
        (header(camera={**header()["camera"], "world_from_cam": [0.0] * 11}), "length"),
    ],
)
def test_what_is_wrong_is_said(fields: dict[str, Any], says: str) -> None:
    with pytest.raises(BadUpload, match=says):
        parse_upload(body_of(fields, photo() + depth_mm().tobytes()))


@pytest.mark.parametrize(
    ("length", "says"),
    [
        (500, "the header claims 500 bytes, but the upload has only 304"),
        (301, "the header claims 301 bytes, but the upload has only 304"),
        (1, "A header has 2 to 20,000 bytes, not 1."),
    ],
)
def test_a_header_of_an_impossible_length(length: int, says: str) -> None:
    with pytest.raises(BadUpload, match=says):
        parse_upload(struct.pack("<I", length) + b" " * 300)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999"])
def test_poses_that_are_no_numbers(number: str) -> None:
    text = json.dumps(header()).replace("[1, 0, 0, 0.0,", f"[{number}, 0, 0, 0.0,").encode()
    assert number.encode() in text
    with pytest.raises(BadUpload):
        parse_upload(struct.pack("<I", len(text)) + text + photo() + depth_mm().tobytes())


def test_a_picture_that_claims_to_be_huge_is_not_decoded() -> None:
    data = bytearray(photo())
    at = data.index(b"\xff\xc0")
    data[at + 5 : at + 9] = struct.pack(">HH", 60000, 60000)
    huge = header(camera=camera(width_px=8192, height_px=8192), depth=None)
    with pytest.raises(BadUpload, match="60000x60000"):
        parse_upload(body_of(huge, bytes(data)))


def test_a_png_is_no_jpeg() -> None:
    fields = header(photo_bytes=8, depth=None)
    with pytest.raises(BadUpload, match="not a readable JPEG"):
        parse_upload(body_of(fields, b"\x89PNG\r\n\x1a\n"))


@given(st.binary(max_size=300))
def test_any_bytes_are_a_sentence(body: bytes) -> None:
    with pytest.raises(BadUpload):
        parse_upload(body)


@given(st.booleans(), st.integers(0, 20_000), st.binary(min_size=1, max_size=8))
def test_any_damage_is_an_upload_or_a_sentence(with_depth: bool, at: int, damage: bytes) -> None:
    good = upload() if with_depth else upload_without_depth()
    body = bytearray(good)
    at = at % len(good)
    body[at : at + len(damage)] = damage
    with contextlib.suppress(BadUpload):  # anything else is a fault
        parse_upload(bytes(body))
