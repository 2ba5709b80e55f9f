"""RealityScan's CSV and XMP, written after its paper on cameras and others' readers; not by it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bent_pictures import Bend, assert_straight, bent_picture
from peaking.datasets import Reading, open_recording
from peaking.errors import PeakingError, RecordingError
from peaking.geometry import Pinhole
from written_formats import OPENGL, Shot, assert_only_these_axes_fit, jpg, png, shots, with_depth

HEADER = "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2"
SQUARE = Pinhole(160, 120, 141.0, 141.0, 81.5, 58.0)
TALL = Pinhole(120, 160, 141.0, 141.0, 58.0, 81.5)
BROWN = {"k1": -0.12, "k2": 0.05, "k3": -0.01, "k4": 0.02, "t1": 0.03, "t2": -0.02}
POSE_TOLERANCE = 1e-9


def heading_pitch_roll(shot: Shot) -> tuple[float, float, float]:
    """Return degrees: Rz(-heading) Rx(pitch) Ry(roll) takes right, up, back to the world."""
    r = (shot.world_from_cam @ OPENGL)[:3, :3]
    pitch = np.arcsin(r[2, 1])
    heading = np.arctan2(r[0, 1], r[1, 1])
    roll = np.arctan2(-r[2, 0], r[2, 2])
    return float(np.rad2deg(heading)), float(np.rad2deg(pitch)), float(np.rad2deg(roll))


def film(k: Pinhole) -> tuple[float, float, float]:
    longer = max(k.size_px)
    away = (k.cx_px - k.width_px / 2) / longer, (k.cy_px - k.height_px / 2) / longer
    return 36 * k.fx_px / longer, *away


def write_csv(root: Path, taken: list[Shot], **bends: float) -> Path:
    lines = ["#cameras 4", HEADER]
    for i, shot in enumerate(taken):
        jpg(root / f"IMG {i}.jpg", shot.rgb)
        numbers = [*shot.world_from_cam[:3, 3], *heading_pitch_roll(shot)]
        numbers += film(shot.camera.pinhole)
        numbers += [bends.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "t1", "t2")]
        lines.append(",".join([f"IMG {i}.jpg", *(f"{number:.15g}" for number in numbers)]))
    (root / "cameras.csv").write_text("\r\n".join(lines) + "\r\n", encoding="utf-8-sig")
    return root


def write_xmp(root: Path, taken: list[Shot], model: str = "perspective", **bends: float) -> Path:
    for i, shot in enumerate(taken):
        jpg(root / f"images/IMG_{i}.jpg", shot.rgb)
        rotation = shot.world_from_cam[:3, :3].T.ravel()
        f, u, v = film(shot.camera.pinhole)
        coefficients = [bends.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "t1", "t2")]
        rows = [rotation, shot.world_from_cam[:3, 3], coefficients]
        turn, place, bent = (" ".join(f"{value:.15g}" for value in values) for values in rows)
        (root / f"images/IMG_{i}.xmp").write_text(
            '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
            'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description '
            'xcr:Version="4" xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#" '
            f'xcr:DistortionModel="{model}" xcr:FocalLength35mm="{f!r}" xcr:Skew="0" '
            f'xcr:AspectRatio="1" xcr:PrincipalPointU="{u!r}" xcr:PrincipalPointV="{v!r}" '
            f'xcr:PosePrior="initial"><xcr:Rotation>{turn}</xcr:Rotation>'
            f"<xcr:Position>{place}</xcr:Position>"
            f"<xcr:DistortionCoeficients>{bent}</xcr:DistortionCoeficients>"
            "</rdf:Description></rdf:RDF></x:xmpmeta>"
        )
    return root


Writer = Callable[[Path, list[Shot]], Path]
WRITERS: list[Writer] = [write_csv, write_xmp]


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("pinhole", [SQUARE, TALL])
def test_cameras_are_those_written(write: Writer, pinhole: Pinhole, tmp_path: Path) -> None:
    taken = shots(pinhole=pinhole)
    recording = open_recording(write(tmp_path / "a", taken))
    assert recording.format == "realityscan"
    assert len(recording) == 4
    for camera, shot in zip(recording.cameras, taken, strict=True):
        got, meant = camera.pinhole, shot.camera.pinhole
        for name in ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px"):
            assert getattr(got, name) == pytest.approx(getattr(meant, name), abs=1e-9)
        pose = camera.world_from_cam.matrix()
        np.testing.assert_allclose(pose, shot.world_from_cam, atol=POSE_TOLERANCE)


@pytest.mark.parametrize("write", WRITERS)
def test_a_neighbour_fits_with_the_axes_read_and_no_others(write: Writer, tmp_path: Path) -> None:
    taken = shots(2, pinhole=SQUARE)
    recording = open_recording(write(tmp_path / "a", taken))
    assert_only_these_axes_fit(with_depth(recording, taken, tmp_path / "out"))


def test_headings_are_clockwise_from_the_north_and_a_nose_goes_up(tmp_path: Path) -> None:
    """By hand, of an aircraft's camera, which looks down with its top to the nose."""
    root = write_csv(tmp_path, shots(3, pinhole=SQUARE))
    angles = ["0,0,0", "90,0,0", "0,90,0"]
    rows = [f"IMG {i}.jpg,1,2,3,{turn},30" for i, turn in enumerate(angles)]
    (root / "cameras.csv").write_text("\n".join([HEADER.split(",px")[0], *rows]))
    cameras = open_recording(root).cameras
    down, east, up_nose = (camera.world_from_cam.rotation for camera in cameras)
    np.testing.assert_allclose(down[:, 2], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(-down[:, 1], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(-east[:, 1], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(up_nose[:, 2], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(-up_nose[:, 1], [0, 0, 1], atol=1e-12)
    assert cameras[0].pinhole.cx_px == 80.0


def papers_bend(model: str, bends: dict[str, float]) -> Bend:
    """Return equations 47 to 50 of the paper, written out."""
    g = {name: bends.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "t1", "t2")}

    def bend(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r2 = x * x + y * y
        if model == "division":
            return x / (1 + g["k1"] * r2), y / (1 + g["k1"] * r2)
        radial = g["k1"] * r2 + g["k2"] * r2**2 + g["k3"] * r2**3 + g["k4"] * r2**4
        return (
            x + x * radial + g["t2"] * 2 * x * y + g["t1"] * (r2 + 2 * x * x),
            y + y * radial + g["t1"] * 2 * x * y + g["t2"] * (r2 + 2 * y * y),
        )

    return bend


@pytest.mark.parametrize("model", ["csv", "brown4t2", "division"])
def test_a_bent_picture_is_seen_straight(model: str, tmp_path: Path) -> None:
    taken = shots(1, pinhole=SQUARE)
    bends = {"k1": 0.2} if model == "division" else BROWN
    bend, camera = papers_bend(model, bends), taken[0].camera
    stored = bent_picture(camera, bend)
    if model == "csv":
        path = write_csv(tmp_path, taken, **bends) / "IMG 0.jpg"
        table = (tmp_path / "cameras.csv").read_text()
        (tmp_path / "cameras.csv").write_text(table.replace("IMG 0.jpg", "IMG 0.png"))
    else:
        path = write_xmp(tmp_path, taken, model, **bends) / "images/IMG_0.jpg"
    path.unlink()
    png(path.with_suffix(".png"), stored)
    assert_straight(open_recording(tmp_path).read(0).rgb, stored, camera, bend)


def test_pictures_elsewhere_and_lost(tmp_path: Path) -> None:
    root = write_csv(tmp_path / "a", shots())
    (root / "IMG 2.jpg").unlink()
    recording = open_recording(root / "cameras.csv", confined=True)
    assert recording.names == ("IMG_0", "IMG_1", "IMG_3")
    assert any(note.startswith("1 frame whose picture is not in") for note in recording.notes)
    (tmp_path / "table").mkdir()
    (root / "cameras.csv").rename(tmp_path / "table/cameras.csv")
    with pytest.raises(RecordingError, match="--images"):
        open_recording(tmp_path / "table")
    assert len(open_recording(tmp_path / "table", Reading(images=root))) == 3


def test_pictures_that_were_not_aligned_are_counted(tmp_path: Path) -> None:
    root = write_xmp(tmp_path, shots())
    path = root / "images/IMG_1.xmp"
    text = path.read_text()
    path.write_text(text.replace("xcr:Rotation", "xcr:Nothing"))
    recording = open_recording(root)
    assert recording.names == ("IMG_0", "IMG_2", "IMG_3")
    assert "1 frame without a pose left out" in recording.notes


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('Skew="0"', 'Skew="0.1"', "skewed"),
        ('AspectRatio="1"', 'AspectRatio="1.2"', "squares"),
        ('DistortionModel="brown3"', 'DistortionModel="fisheye"', "'fisheye' cannot"),
        ("xcr:Version", 'xcr:ProjectionModel="equirectangular" xcr:Version', "equirectangular"),
        ('FocalLength35mm="', 'FocalLength="', "focal lengths > 0"),
        ("<x:xmpmeta", "<!DOCTYPE x><x:xmpmeta", "document type"),
        ("<xcr:Position>", "<xcr:Position>1 ", "need 3 numbers"),
        ("<xcr:Rotation>", "<xcr:Rotation>1 ", "need 9 numbers"),
    ],
)
def test_what_is_not_read_is_named(old: str, new: str, problem: str, tmp_path: Path) -> None:
    root = write_xmp(tmp_path, shots(2, pinhole=SQUARE), "brown3", k1=0.01)
    path = root / "images/IMG_1.xmp"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(RecordingError, match=problem) as caught:
        open_recording(root)
    assert caught.value.path == path


@pytest.mark.parametrize("write", WRITERS)
def test_arbitrary_and_damaged_bytes_never_crash(write: Writer, tmp_path: Path) -> None:
    root = write(tmp_path, shots(2, pinhole=SQUARE))
    path = root / ("cameras.csv" if write is write_csv else "images/IMG_1.xmp")
    sound = path.read_bytes()
    junk = st.one_of(
        st.binary(min_size=1, max_size=8), st.sampled_from([b"nan", b"-1", b"1e999", b'"', b"\r"])
    )

    @settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(st.integers(0, len(sound) - 1), junk, st.booleans())
    def tried(at: int, junk: bytes, cut: bool) -> None:
        after = b"" if cut else sound[at + len(junk) :]
        path.write_bytes(sound[:at] + junk + after)
        with contextlib.suppress(PeakingError):
            open_recording(root, Reading(format="realityscan"))

    tried()
