"""Pictures from strangers: refused before they are decoded, and rid of metadata, not of pixels."""

from __future__ import annotations

import contextlib
import functools
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import simplejpeg
from hypothesis import given, settings
from hypothesis import strategies as st

from foreign_pictures import (
    GPS,
    claiming_png,
    claiming_webp,
    exif,
    jpeg,
    png_of_zeros,
    segment,
    telling_jpeg,
    telling_png,
    with_frame,
    with_scans,
    with_size,
)
from patience import PATIENCE_S
from peaking.datasets.depth_files import depth_size_px, read_depth
from peaking.datasets.stored_images import picture_size_px, read_picture
from peaking.errors import RecordingError
from peaking.limits import MAX_PIXELS, MAX_SCANS
from peaking.output import encode_png
from peaking.pictures import decoding
from peaking.pictures.decoding import decode_stored
from peaking.pictures.jpeg import check_jpeg, segments
from peaking.pictures.metadata import has_metadata, without_metadata

# --- limits --------------------------------------------------------------------------------------

COSTLY = {
    "jpeg of many scans": (with_scans(jpeg(progressive=True), 2000), "scans"),
    "jpeg of scans with junk between": (
        with_scans(jpeg(progressive=True), 300).replace(b"\xff\xda", b"\0junk\xff\xff\xff\xda"),
        "scans",
    ),
    "large jpeg of some scans": (with_size(with_scans(jpeg(progressive=True), 60), 8192, 8192), ""),
    "jpeg of 4 gigapixels": (with_size(jpeg(), 65000, 65000), "65000x65000"),
    "progressive of 4 gigapixels": (with_size(jpeg(progressive=True), 65000, 65000), "65000x65000"),
    "jpeg without height": (with_size(jpeg(), 64, 0), "no picture"),
    **{
        f"jpeg {marker:#x}": (with_frame(jpeg(), marker), "arithmetic")
        for marker in (0xC3, 0xC5, 0xC6, 0xC7, 0xC9, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF)
    },
    "jpeg of a million segments": (
        jpeg()[:2] + 10**5 * segment(0xFE, b"") + jpeg()[2:],
        "segments",
    ),
    "jpeg of two frames": (jpeg()[:-2] + jpeg()[2:], ""),
    "jpeg all fill": (jpeg()[:2] + b"\xff" * 2_000_000, ""),
    "webp": (claiming_webp(16384, 16384, b"VP8L"), "16384x16384"),
    "lossy webp": (claiming_webp(16383, 16383, b"VP8 "), "16383x16383"),
    "webp in a small frame": (claiming_webp(16384, 16384, b"VP8L", frame_px=64), "16384x16384"),
    "moving webp": (claiming_webp(64, 48, b"VP8L", frame_px=64, moves=True), "moving"),
    "webp of nothing": (claiming_webp(64, 48, b"none"), "no picture"),
    "png 16-bit RGBA": (claiming_png(30000, 30000), "30000x30000"),
    "png of 2 to the 62": (claiming_png(2**31 - 1, 2**31 - 1), "pixels"),
    "png grey": (claiming_png(100_000, 100_000, bits=1, color=0), "pixels"),
    "png of no kind": (claiming_png(64, 48, bits=7), "header"),
    "png without size": (claiming_png(0, 48), "header"),
    "png of empty chunks": (
        png_of_zeros(64, 48)[:33]
        + (2**17 + 9) * bytes.fromhex("00000000494441543 5af061e".replace(" ", "")),
        "chunks",
    ),
}


@pytest.fixture
def nothing_is_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> Any:
        raise AssertionError("it was decoded")

    monkeypatch.setattr(simplejpeg, "decode_jpeg", fail)
    monkeypatch.setattr(cv2, "imdecode", fail)
    monkeypatch.setattr(subprocess, "run", fail)


@pytest.mark.usefixtures("nothing_is_decoded")
@pytest.mark.parametrize("case", COSTLY)
def test_what_costs_too_much_is_not_decoded(tmp_path: Path, case: str) -> None:
    data, says = COSTLY[case]
    path = tmp_path / "a.jpg"
    path.write_bytes(data)
    with pytest.raises(RecordingError) as caught:
        read_picture(path)
    assert caught.value.path == path
    assert says in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.usefixtures("nothing_is_decoded")
@pytest.mark.parametrize("case", [name for name in COSTLY if "giga" in name or "2 to" in name])
def test_what_is_too_large_is_found_when_a_recording_is_opened(tmp_path: Path, case: str) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(COSTLY[case][0])
    with pytest.raises(RecordingError, match="pixels"):
        picture_size_px(path)


def test_depth_maps_are_bounded_too(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(claiming_png(60000, 60000, bits=16, color=0))
    for look in (depth_size_px, functools.partial(read_depth, unit_m=0.001)):
        with pytest.raises(RecordingError, match="60000x60000"):
            look(path)
    array = tmp_path / "a.npy"
    np.lib.format.open_memmap(array, "w+", np.uint8, (60000, 60000)).flush()  # full of holes
    for look in (depth_size_px, functools.partial(read_depth, unit_m=0.001)):
        with pytest.raises(RecordingError, match="60000x60000"):
            look(array)


def test_a_depth_map_that_became_colour_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(encode_png(np.ones((4, 4, 3), np.uint8)))
    with pytest.raises(RecordingError, match="shape"):
        read_depth(path, 0.001)


@pytest.mark.parametrize(
    "data",
    [
        jpeg(),
        jpeg(progressive=True),
        jpeg(grey=True),
        with_scans(jpeg(progressive=True), 0),
        telling_jpeg(jpeg()),
        telling_jpeg(jpeg(progressive=True)),
    ],
)
def test_ordinary_jpegs_are_read(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.jpg").write_bytes(data)
    assert check_jpeg(data) == picture_size_px(tmp_path / "a.jpg") == (64, 48)
    assert read_picture(tmp_path / "a.jpg").shape == (48, 64, 3)


def odd_jpegs() -> dict[str, bytes]:
    plain = jpeg()
    scan = plain.rindex(b"\xff\xda")
    limits = scan + 2 + int.from_bytes(plain[scan + 2 : scan + 4], "big") - 3
    return {
        "junk": plain[:2] + b"junk" + plain[2:scan] + b"\0\0\0" + plain[scan:],
        "Se is 0": plain[:limits] + b"\0\0\0" + plain[limits + 3 :],
        "zeros before the end": plain[:-2] + bytes(7) + plain[-2:],
        "junk before the end": plain[:-2] + b"junk" * 5 + plain[-2:],
        "fill": plain[:scan] + b"\xff\xff" + plain[scan:-2] + b"\xff\xff" + plain[-2:],
    }


@pytest.mark.parametrize("case", odd_jpegs())
def test_jpegs_that_everybody_reads_are_read(tmp_path: Path, case: str) -> None:
    (tmp_path / "a.jpg").write_bytes(odd_jpegs()[case])
    np.testing.assert_array_equal(
        read_picture(tmp_path / "a.jpg"), simplejpeg.decode_jpeg(jpeg(), "RGB")
    )


def test_what_cameras_make_is_within_the_limits() -> None:
    """A photo of 50 megapixels, progressive: 10 scans."""
    data = with_size(jpeg(progressive=True), 8160, 6144)
    assert sum(s.marker == 0xDA for s in segments(data)) == 10
    assert check_jpeg(data) == (8160, 6144)
    assert MAX_PIXELS > 10_000 * 13_000
    assert MAX_SCANS >= 64


@pytest.mark.parametrize(("bits", "color"), [(1, 0), (2, 3), (8, 2), (16, 2), (8, 4), (16, 6)])
def test_ordinary_pngs_are_read(tmp_path: Path, bits: int, color: int) -> None:
    (tmp_path / "a.png").write_bytes(png_of_zeros(64, 48, bits=bits, color=color))
    rgb = read_picture(tmp_path / "a.png")
    assert rgb.shape == (48, 64, 3)
    assert rgb.max() == (255 if color in (4, 6) else 0)


def test_large_pictures_are_converted_in_bands(tmp_path: Path) -> None:
    rgba = np.random.default_rng(1).integers(0, 65536, (600, 7, 4)).astype(np.uint16)
    (tmp_path / "a.png").write_bytes(cv2.imencode(".png", rgba)[1].tobytes())
    levels = np.round(rgba / 257.0).astype(np.uint8)
    alpha = levels[..., 3:].astype(np.float32) / 255
    expected = np.round(levels[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)[..., ::-1]
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png"), expected)


def test_other_kinds_are_decoded_in_a_process_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rgb = np.random.default_rng(1).integers(0, 256, (48, 64, 3)).astype(np.uint8)
    tiff = cv2.imencode(".tiff", rgb)[1].tobytes()
    np.testing.assert_array_equal(decode_stored(tiff), rgb)
    monkeypatch.setattr(decoding, "DECODER_SECONDS", 0.001)
    (tmp_path / "a.tiff").write_bytes(tiff)
    with pytest.raises(RecordingError, match="too long"):
        read_picture(tmp_path / "a.tiff")


def test_other_kinds_that_claim_too_much(tmp_path: Path) -> None:
    bmp = bytearray(cv2.imencode(".bmp", np.zeros((8, 8, 3), np.uint8))[1].tobytes())
    bmp[18:26] = (50_000).to_bytes(4, "little") * 2
    (tmp_path / "a.bmp").write_bytes(bytes(bmp))
    with pytest.raises(RecordingError, match="not a picture"):
        read_picture(tmp_path / "a.bmp")


def test_no_bomb_takes_much_memory(tmp_path: Path) -> None:
    """All of them, in a process that may have 2 GB with all its libraries."""
    for number, (data, _) in enumerate(COSTLY.values()):
        (tmp_path / f"{number:02d}.jpg").write_bytes(data)
    code = """
        import resource, sys
        from pathlib import Path
        from peaking.datasets.stored_images import read_picture
        from peaking.errors import RecordingError
        resource.setrlimit(resource.RLIMIT_AS, (2 * 2**30, 2 * 2**30))
        for path in sorted(Path(sys.argv[1]).iterdir()):
            try:
                read_picture(path)
            except RecordingError as error:
                print(error.problem)
    """
    command = [sys.executable, "-c", textwrap.dedent(code), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    said = done.stdout.splitlines()
    assert len(said) == len(COSTLY)
    assert not [line for line in said if "memory" in line]


# --- metadata ------------------------------------------------------------------------------------


@pytest.mark.parametrize("plain", [jpeg(), jpeg(progressive=True), jpeg(grey=True)])
def test_a_jpeg_loses_what_it_tells_and_no_pixel(plain: bytes) -> None:
    telling = telling_jpeg(plain)
    bare = without_metadata(telling)
    assert telling.count(GPS) > 10
    assert GPS not in bare
    assert b"Exif" not in bare
    assert b"ICC_PROFILE" in bare
    assert b"JFIF" in bare
    np.testing.assert_array_equal(simplejpeg.decode_jpeg(bare), simplejpeg.decode_jpeg(plain))
    assert without_metadata(bare) == bare
    assert without_metadata(plain) == plain
    assert [has_metadata(picture) for picture in (telling, bare, plain)] == [True, False, False]
    profile = segment(0xE2, b"ICC_PROFILE\0\x01\x01profile")
    assert bare.replace(profile, b"") == plain


def test_a_thumbnail_in_the_first_segment_goes() -> None:
    plain = jpeg()
    with_thumbnail = plain.replace(
        plain[2:20], segment(0xE0, plain[6:18] + b"\x02\x02" + b"pixelspixels"), 1
    )
    assert b"pixels" in with_thumbnail
    assert without_metadata(with_thumbnail) == plain


def test_adobe_marker_stays() -> None:
    """It says how colours are coded."""
    plain = jpeg()
    adobe = segment(0xEE, b"Adobe\0\x64\0\0\0\0\x00")
    told = plain[:2] + segment(0xEE, b"Adobe\0\x64\0\0\0\0\x00" + GPS) + plain[20:]
    assert without_metadata(told) == plain[:2] + adobe + plain[20:]


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_turn_is_ignored_before_and_after(tmp_path: Path, orientation: int) -> None:
    plain = jpeg()
    turned = plain[:2] + segment(0xE1, exif(orientation)) + plain[2:]
    for name, data in (("turned", turned), ("bare", without_metadata(turned))):
        (tmp_path / name).write_bytes(data)
    np.testing.assert_array_equal(
        read_picture(tmp_path / "turned"), read_picture(tmp_path / "bare")
    )
    assert picture_size_px(tmp_path / "bare") == (64, 48)


def test_a_png_loses_what_it_tells_and_no_pixel() -> None:
    rgb = np.random.default_rng(1).integers(0, 256, (48, 64, 3)).astype(np.uint8)
    plain = encode_png(rgb)
    telling = telling_png(plain)
    assert telling.count(GPS) > 5
    assert without_metadata(telling) == plain
    np.testing.assert_array_equal(decode_stored(telling), decode_stored(plain))


@pytest.mark.parametrize("quality", [80, 101])
@pytest.mark.parametrize("channels", [3, 4])
def test_the_size_of_a_webp_is_found(tmp_path: Path, quality: int, channels: int) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (47, 65, channels)).astype(np.uint8)
    data = cv2.imencode(".webp", pixels, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes()
    (tmp_path / "a.webp").write_bytes(data)
    assert picture_size_px(tmp_path / "a.webp") == (65, 47)
    assert read_picture(tmp_path / "a.webp").shape == (47, 65, 3)


@pytest.mark.parametrize("quality", [80, 101])
def test_a_webp_loses_what_it_tells_and_no_pixel(quality: int) -> None:
    rgba = np.random.default_rng(1).integers(0, 256, (48, 64, 4)).astype(np.uint8)
    plain = cv2.imencode(".webp", rgba, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes()
    told = b"".join(kind + (35).to_bytes(4, "little") + GPS + b"\0" for kind in (b"EXIF", b"XMP "))
    telling = plain[:4] + (len(plain) - 8 + len(told)).to_bytes(4, "little") + plain[8:] + told
    assert len(GPS) == 35
    bare = without_metadata(telling + GPS)
    assert GPS not in bare
    np.testing.assert_array_equal(decode_stored(bare), decode_stored(plain))


@pytest.mark.parametrize("kind", [".tiff", ".avif", ".hdr", ".bmp", ".ppm", ".pgm", ".pbm"])
def test_other_kinds_are_refused(kind: str) -> None:
    shape = (8, 8) if kind in (".pgm", ".pbm") else (8, 8, 3)
    pixels = np.zeros(shape, np.float32 if kind == ".hdr" else np.uint8)
    data = cv2.imencode(kind, pixels)[1].tobytes()
    with pytest.raises(ValueError, match="metadata cannot be removed"):
        without_metadata(data)


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 10_000), st.binary(min_size=1, max_size=6), st.booleans())
def test_damage_is_a_sentence(at: int, damage: bytes, is_png: bool) -> None:
    data = bytearray(telling_png(png_of_zeros(64, 48)) if is_png else telling_jpeg(jpeg()))
    at %= len(data)
    data[at : at + len(damage)] = damage
    for look in (without_metadata, check_jpeg, decoding.decode_jpeg):
        with contextlib.suppress(ValueError):  # anything else is a fault
            look(bytes(data))
