"""Metashape's XML, written after its manual and other projects' readers; not by the app."""

from __future__ import annotations

import contextlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bent_pictures import Bend, assert_straight, bent_picture
from peaking.datasets import Reading, open_recording
from peaking.errors import PeakingError, RecordingError
from peaking.geometry import Pinhole
from written_formats import Shot, assert_only_these_axes_fit, jpg, png, shots, with_depth

TURN = np.asarray(cv2.Rodrigues(np.array([0.9, -0.4, 0.3]))[0], dtype=np.float64)
PLACE = np.array([-2499366.0, -4256836.0, 4029217.0])
SCALE = 12.5


def row(values: np.ndarray) -> str:
    return " ".join(f"{value:.15g}" for value in values.ravel())


def calibration(k: Pinhole, kind: str = "frame", **more: float) -> str:
    values = {
        "f": k.fy_px,
        "cx": k.cx_px - k.width_px / 2,
        "cy": k.cy_px - k.height_px / 2,
        "b1": k.fx_px - k.fy_px,
        **more,
    }
    inner = "".join(f"<{name}>{value:.15g}</{name}>" for name, value in values.items())
    size = f'<resolution width="{k.width_px}" height="{k.height_px}"/>'
    first = f'<calibration type="{kind}" class="initial">{size}<f>1</f></calibration>'
    return f'{first}<calibration type="{kind}" class="adjusted">{size}{inner}</calibration>'


def write_metashape(
    root: Path, taken: list[Shot], *, lens: str | None = None, scaled: bool = True
) -> Path:
    """Write pictures, and their cameras in a component that a similarity brings to the earth."""
    size = 'width="160" height="120"'
    cameras: list[str] = []
    for i, shot in enumerate(taken):
        jpg(root / f"images/IMG_{i}.jpg", shot.rgb)
        own = shot.world_from_cam.copy()
        if scaled:
            own[:3, :3] = TURN.T @ own[:3, :3]
            own[:3, 3] = TURN.T @ own[:3, 3] / SCALE
        cameras.append(
            f'<camera id="{i}" sensor_id="3" component_id="1" label="IMG_{i}">'
            f"<transform>{row(own)}</transform><orientation>1</orientation></camera>"
        )
    transform = (
        f'<transform><rotation locked="true">{row(TURN)}</rotation>'
        f"<translation>{row(PLACE)}</translation><scale>{SCALE}</scale></transform>"
    )
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<document version="2.0.0"><chunk label="Chunk 1">'
        f'<sensors><sensor id="3" type="frame"><resolution {size}/>'
        f"{lens or calibration(taken[0].camera.pinhole)}</sensor></sensors>"
        f'<components><component id="1">{transform if scaled else ""}</component></components>'
        f'<cameras><group id="0" label="a">{"".join(cameras[:2])}</group>{"".join(cameras[2:])}'
        '<camera id="90" sensor_id="3" component_id="1" label="lost"/>'
        '<camera id="91" sensor_id="3" component_id="1" label="off" enabled="false">'
        f"<transform>{row(np.eye(4))}</transform></camera>"
        "</cameras></chunk></document>"
    )
    (root / "cameras.xml").write_text(text)
    return root


def test_cameras_stand_on_the_earth_in_metres(tmp_path: Path) -> None:
    taken = shots()
    recording = open_recording(write_metashape(tmp_path / "a", taken))
    assert recording.format == "metashape"
    assert recording.names == tuple(f"IMG_{i}" for i in range(4))
    assert "2 frames not aligned, or disabled, left out" in recording.notes
    assert any("counted from (-2499366, -4256836, 4029217)" in note for note in recording.notes)
    for camera, shot in zip(recording.cameras, taken, strict=True):
        k, own = camera.pinhole, shot.camera.pinhole
        assert (k.fx_px, k.cx_px, k.cy_px) == pytest.approx((own.fx_px, own.cx_px, own.cy_px))
        expected = shot.world_from_cam
        np.testing.assert_allclose(camera.world_from_cam.rotation, expected[:3, :3], atol=1e-9)
        np.testing.assert_allclose(camera.world_from_cam.translation_m, expected[:3, 3], atol=1e-7)


def test_a_neighbour_fits_with_the_axes_read_and_no_others(tmp_path: Path) -> None:
    taken = shots(2)
    recording = open_recording(write_metashape(tmp_path / "a", taken))
    assert_only_these_axes_fit(with_depth(recording, taken, tmp_path / "out"))


def test_without_a_scale_it_is_said(tmp_path: Path) -> None:
    recording = open_recording(write_metashape(tmp_path / "a", shots(), scaled=False))
    assert any("was not scaled" in note for note in recording.notes)
    assert np.allclose(recording.cameras[3].world_from_cam.matrix(), shots()[3].world_from_cam)


def test_the_file_itself_and_pictures_elsewhere(tmp_path: Path) -> None:
    root = write_metashape(tmp_path / "a", shots())
    assert len(open_recording(root / "cameras.xml", confined=True)) == 4
    (root / "images").rename(tmp_path / "photos")
    with pytest.raises(RecordingError, match=r"names 'IMG_0'.*--images"):
        open_recording(root)
    (tmp_path / "photos/IMG_2.jpg").unlink()
    recording = open_recording(root, Reading(images=tmp_path / "photos"))
    assert recording.names == ("IMG_0", "IMG_1", "IMG_3")
    (root / "other.xml").write_text((root / "cameras.xml").read_text())
    with pytest.raises(RecordingError, match=r"cameras\.xml, other\.xml"):
        open_recording(root, Reading(images=tmp_path / "photos"))


def manuals_bend(kind: str, bends: dict[str, float]) -> Bend:
    """Return the formulas of the manual's appendix, written out."""
    g = {name: bends.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "p1", "p2")}

    def bend(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if kind == "fisheye":
            r0 = np.maximum(np.hypot(x, y), 1e-12)
            x, y = x * np.arctan(r0) / r0, y * np.arctan(r0) / r0
        r2 = x * x + y * y
        radial = 1 + g["k1"] * r2 + g["k2"] * r2**2 + g["k3"] * r2**3 + g["k4"] * r2**4
        return (
            x * radial + g["p1"] * (r2 + 2 * x * x) + 2 * g["p2"] * x * y,
            y * radial + g["p2"] * (r2 + 2 * y * y) + 2 * g["p1"] * x * y,
        )

    return bend


@pytest.mark.parametrize(
    ("kind", "bends"),
    [
        ("frame", {"k1": -0.12, "k2": 0.05, "k3": -0.01, "k4": 0.02, "p1": 0.03, "p2": -0.02}),
        ("fisheye", {"k1": 0.05, "k2": -0.02, "k4": 0.003}),
    ],
)
def test_a_bent_picture_is_seen_straight(
    kind: str, bends: dict[str, float], tmp_path: Path
) -> None:
    taken, bend = shots(1), manuals_bend(kind, bends)
    camera = taken[0].camera
    lens = calibration(camera.pinhole, kind, **bends)
    root = write_metashape(tmp_path / "a", taken, lens=lens)
    stored = bent_picture(camera, bend)
    png(root / "images/IMG_0.png", stored)
    (root / "images/IMG_0.jpg").unlink()
    assert_straight(open_recording(root).read(0).rgb, stored, camera, bend)


BAD = {
    "bomb": (
        '<!DOCTYPE d [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><document><chunk>&b;</chunk>'
        "</document>",
        "document type",
    ),
    "cut": ("<document><chunk><cameras>", "is not XML"),
    "deep": ("<document><chunk>" + "<a>" * 200, "nested more than"),
    "empty": ("<document><chunk/></document>", "no camera with a pose"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_file_of_cameras_is_named(case: str, tmp_path: Path) -> None:
    text, problem = BAD[case]
    (tmp_path / "cameras.xml").write_text(text)
    with pytest.raises(RecordingError, match=problem) as caught:
        open_recording(tmp_path)
    assert caught.value.path == tmp_path / "cameras.xml"


@pytest.mark.parametrize(
    ("lens", "problem"),
    [
        (calibration(Pinhole(160, 120, 140.0, 140.0, 80.0, 60.0), "spherical"), "spherical"),
        (calibration(Pinhole(160, 120, 140.0, 140.0, 80.0, 60.0), p3=0.1), "p3 0.1"),
        (calibration(Pinhole(160, 120, 140.0, 140.0, 80.0, 60.0), b2=9.0), "skewed"),
        (calibration(Pinhole(120, 160, 140.0, 140.0, 60.0, 80.0)), "is for 120x160"),
        ("<calibration><f>x</f></calibration>", "f: need 1 numbers"),
        ("", "no calibration"),
    ],
)
def test_lenses_that_are_not_read_are_named(lens: str, problem: str, tmp_path: Path) -> None:
    root = write_metashape(tmp_path, shots(2), lens=lens or "<!-- none -->")
    with pytest.raises(RecordingError, match=problem) as caught:
        open_recording(root)
    assert str(caught.value.field).startswith("sensor 3")


def test_arbitrary_and_damaged_bytes_never_crash(tmp_path: Path) -> None:
    root = write_metashape(tmp_path, shots(2))
    sound = (root / "cameras.xml").read_bytes()
    junk = st.one_of(st.binary(min_size=1, max_size=8), st.sampled_from([b"nan", b"-1", b"1e999"]))

    @settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(st.integers(0, len(sound) - 1), junk, st.booleans())
    def tried(at: int, junk: bytes, cut: bool) -> None:
        after = b"" if cut else sound[at + len(junk) :]
        (root / "cameras.xml").write_bytes(sound[:at] + junk + after)
        with contextlib.suppress(PeakingError):
            open_recording(root, Reading(format="metashape"))

    tried()
