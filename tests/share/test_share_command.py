"""`peaking share` as people run it."""

from __future__ import annotations

import json
import re
import stat
from pathlib import Path

import msgspec
import numpy as np
import pytest

import peaking.server.serving
from peaking.cli import main
from peaking.commands.generate import Generate
from peaking.commands.splat import Splat
from peaking.mpi_file import read_mpi
from peaking.server.session_log import FILE_NAME, NamedSession, SessionBegun, SessionLog
from peaking.server.training import NOTHING
from peaking.share import writing
from peaking.splat.gaussians import Gaussians
from peaking.splat.ply import write_ply
from recordings import write_recording
from stub_client import write_client

FLAGS = ["--pixels", "19200"]


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms") / "room"
    return write_recording(folder, num_frames=6, width_px=160, height_px=120)


@pytest.fixture(autouse=True)
def client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = write_client(tmp_path / "client")
    monkeypatch.setattr(peaking.server.serving, "CLIENT_DIR", folder)
    return folder


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command that must end with code 2 and one line; return the line."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    return said.strip().splitlines()[-1]


def test_a_folder_for_any_web_server(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "shared"
    main(["share", str(room), "--out", str(out), "--title", "A <room>", *FLAGS])
    place = json.loads((out / "place.json").read_text())
    assert place["title"] == "A <room>"
    assert "<title>A &lt;room&gt;</title>" in (out / "index.html").read_text()
    for view in place["views"]:
        mpi = read_mpi(out / view["mpi"])
        told = np.array(view["camera"]["world_from_cam"]).reshape(3, 4)
        np.testing.assert_allclose(mpi.camera.world_from_cam.matrix()[:3], told, atol=1e-9)
    names = {path.name for path in (out / "assets").iterdir()}
    assert {"view-abc.js", "dom-def.js", "decode_worker-678.js", "base-012.css"} <= names
    assert not {"index-cde.js", "splats-9ab.js"} & names
    said = capsys.readouterr().out
    assert re.search(r"shared: \d+\.\d MB", said)
    assert "light field: 6 of 6 views\n" in said
    assert "http.server" in said
    assert stat.S_IMODE(out.stat().st_mode) == stat.S_IMODE((out / "mpis").stat().st_mode)


def test_one_file_and_its_figures(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, figures = tmp_path / "room.html", tmp_path / "room.json"
    arguments = ["share", str(room), "--out", str(out), "--views", "3", *FLAGS]
    main([*arguments, "--json", str(figures), "--address", "https://example.org/room.html"])
    told = json.loads(figures.read_text())
    assert told["bytes"] == out.stat().st_size
    assert (told["views"], told["of_views"]) == (3, 6)
    page = out.read_text()
    assert page.count('data-file="mpis/') == 3
    assert 'data-file="qr.svg"' in page
    said = capsys.readouterr().out
    assert f"{told['light_field_loss_db']:.2f} dB below the whole's" in said
    assert out.as_uri() in said
    assert "█" in said


def test_an_earlier_share_is_replaced_and_nothing_else(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "shared"
    share = ["share", str(room), "--out", str(out), *FLAGS]
    main([*share, "--views", "3"])
    main([*share, "--views", "2"])
    assert len(list((out / "mpis").iterdir())) == 2
    assert {path.name for path in tmp_path.iterdir()} == {"client", "shared"}
    (out / "CNAME").write_text("example.org")
    assert "holds other things than an earlier share" in fails(share, capsys)
    assert (out / "CNAME").read_text() == "example.org"


@pytest.mark.parametrize("name", ["shared", "shared.html"])
def test_an_interruption_leaves_nothing(
    name: str, room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(writing, "_write_all", interrupted)
    monkeypatch.setattr(writing, "write_atomically", interrupted)
    with pytest.raises(SystemExit) as ended:
        main(["share", str(room), "--out", str(tmp_path / name), "--views", "2", *FLAGS])
    assert ended.value.code == 130
    assert [path.name for path in tmp_path.iterdir()] == ["client"]


def test_an_mpi_file(room: Path, tmp_path: Path) -> None:
    Generate(room, tmp_path / "view.mpi").run()
    main(["share", str(tmp_path / "view.mpi"), "--out", str(tmp_path / "shared")])
    shared = tmp_path / "shared/mpis/view.mpi"
    assert shared.read_bytes() == (tmp_path / "view.mpi").read_bytes()


def test_what_only_recordings_have_is_refused_of_files(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Generate(room, tmp_path / "view.mpi").run()
    share = ["share", str(tmp_path / "view.mpi"), "--out", str(tmp_path / "shared")]
    for wrong in (["--views", "3"], ["--as", "both"]):
        assert "are for recordings, not " in fails([*share, *wrong], capsys)


def test_an_mpi_file_that_does_not_fit_is_a_sentence(
    room: Path, client: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Generate(room, tmp_path / "view.mpi").run()
    (client / "assets/view-abc.js").write_bytes(bytes(1_000_000))
    share = ["share", str(tmp_path / "view.mpi"), "--out", str(tmp_path / "shared")]
    assert "does not fit; allow more by --max-mb" in fails([*share, "--max-mb", "1"], capsys)


def test_gaussians_alone_and_pruned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(0)
    count = 60_000
    many = Gaussians(
        rng.normal(size=(count, 3)).astype(np.float32),
        rng.normal(-4, 0.5, (count, 3)).astype(np.float32),
        rng.normal(size=(count, 4)).astype(np.float32),
        rng.normal(size=count).astype(np.float32),
        rng.normal(size=(count, 4, 3)).astype(np.float32),
    )
    path = tmp_path / "many.ply"
    write_ply(path, many)
    main(["share", str(path), "--out", str(tmp_path / "all.html"), "--max-mb", "20"])
    assert "splat: 60000 of 60000 Gaussians" in capsys.readouterr().out
    main(["share", str(path), "--out", str(tmp_path / "some"), "--max-mb", "1"])
    size = sum(p.stat().st_size for p in (tmp_path / "some").rglob("*") if p.is_file())
    assert 0.8e6 < size <= 1e6
    kept = re.search(r"splat: (\d+) of 60000 Gaussians", capsys.readouterr().out)
    assert kept is not None
    assert 10_000 < int(kept[1]) < 60_000


def test_gaussians_of_a_recording(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Splat(room, tmp_path / "room.ply", iterations=60, previews=0).run()
    arguments = ["share", str(room), "--splat", str(tmp_path / "room.ply"), *FLAGS]
    main([*arguments, "--as", "splat", "--out", str(tmp_path / "splat")])
    place = json.loads((tmp_path / "splat/place.json").read_text())
    assert place["shown"] == "splat"
    assert (tmp_path / "splat" / place["splat"]).is_file()
    assert (tmp_path / "splat" / place["views"][0]["photo"]).is_file()
    assert place["loss_db"] < 0.5
    assert (tmp_path / "splat/assets/splats-9ab.js").is_file()
    main([*arguments, "--as", "both", "--out", str(tmp_path / "both.html")])
    page = (tmp_path / "both.html").read_text()
    assert "showAll" in page
    assert 'data-file="splat.' in page
    assert page.count('data-file="mpis/') == 6
    both = json.loads(page.partition('id="place">')[2].partition("</script>")[0])
    assert (both["shown"], both["loss_db"]) == ("light-field", None)  # all of it is kept
    assert 0 <= both["splat_loss_db"] < 0.5
    assert "Gaussians; PSNR of the pictures is 0." in capsys.readouterr().out


def test_gaussians_that_were_trained_in_a_session_are_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    room = write_recording(tmp_path / "room", num_frames=4, width_px=160, height_px=120)
    splat = Splat(room, tmp_path / "room.ply", iterations=40, previews=0, up="none")
    splat.run()
    named = NamedSession("5e551011-0000-4000-8000-0000000000f1", 1, "Kitchen", "virtual")
    SessionLog(room / FILE_NAME).append(SessionBegun(0.0, 1, named))
    (room / "training").mkdir()
    splat.out.rename(room / "training/splat-7.ply")
    done = msgspec.structs.replace(NOTHING, state="done", splat_version=7, splat_format="ply")
    (room / "training/status.json").write_bytes(msgspec.json.encode({"training": done}))
    main(["share", str(room), "--as", "splat", "--out", str(tmp_path / "shared"), *FLAGS])
    assert "trained in the session (splat-7.ply)" in capsys.readouterr().out
    place = json.loads((tmp_path / "shared/place.json").read_text())
    assert (place["title"], place["shown"]) == ("Kitchen", "splat")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--max-mb", "0.5"], "need --max-mb of 1 … 1000000, got 0.5"),
        (["--views", "0"], "need --views of at least 1, got 0"),
        (["--views", "3", "--as", "splat"], "--views is for light fields"),
        (["--splat", "a.ply"], "--splat needs --as splat or --as both"),
        (["--address", "example.org"], "need an --address that begins with https://"),
        (["--address", "https://a.org/" + 500 * "a"], "at most 500 characters"),
        (["--pixels", "3"], "need --pixels >= 256, got 3"),
        (["--as", "splat", "--splat", "none.ply"], "none.ply: cannot be read"),
    ],
)
def test_wrong_arguments_are_named(
    room: Path,
    tmp_path: Path,
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "shared"
    assert message in fails(["share", str(room), "--out", str(out), *arguments], capsys)
    assert not out.exists()


def test_what_is_no_scene_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(tmp_path / "shared")]
    for name in ("broken.mpi", "broken.ply", "broken.glb", "broken.zip"):
        (tmp_path / name).write_bytes(b"nothing of that kind")
        assert name in fails(["share", str(tmp_path / name), *out], capsys)
    assert "none" in fails(["share", str(tmp_path / "none"), *out], capsys)


def test_links_that_leave_the_recording_are_followed_when_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    room = write_recording(tmp_path / "room", num_frames=3)
    inside, outside = room / "images/frame_00001.png", tmp_path / "secret.png"
    inside.rename(outside)
    inside.symlink_to(outside)
    share = ["share", str(room), "--out", str(tmp_path / "shared"), *FLAGS]
    assert "link" in fails(share, capsys)
    assert not (tmp_path / "shared").exists()
    main([*share, "--follow-links"])
    assert (tmp_path / "shared/mpis/00001.mpi").is_file()


def test_without_depth_there_is_no_light_field(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flat = write_recording(tmp_path / "flat", num_frames=3, with_depth=False)
    said = fails(["share", str(flat), "--out", str(tmp_path / "shared")], capsys)
    assert "has no depth, which a light field needs; take --as splat" in said


def test_a_client_that_is_not_built_is_a_sentence(
    room: Path, client: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (client / "view.html").unlink()
    said = fails(["share", str(room), "--out", str(tmp_path / "shared"), *FLAGS], capsys)
    assert "run: make client" in said
