"""Write one of everything that peaking keeps on disk, small: what later versions have to open.

    PYTHONPATH=tests .venv/bin/python -m corpus.write tests/corpus/VERSION

Done once for every released version, with that version's code, and never again: what lies in
tests/corpus is frozen. README.md beside this file says what each folder holds.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from starlette.testclient import TestClient

import peaking
from capture_uploads import body_of, capture_id, header, new_session, points_m
from peaking.cli import main
from peaking.mpi_file import read_mpi
from peaking.options import DEFAULT
from peaking.output import encode_jpeg
from peaking.server.app import ServerOptions, create_app
from peaking.server.generation import GenerationQueue
from peaking.server.sessions import SessionStore
from peaking.server.study.app import StudyServerOptions, create_study_app
from peaking.server.study.erasure import erase_participant
from peaking.server.study.open_study import OpenStudy
from peaking.splat.ply import read_ply, write_ply
from peaking.study.analysis.matrix import matrices_of
from peaking.study.analysis.measure_analysis import analyse
from peaking.study.tables import read_study
from recordings import Room, lateral_cameras, write_recording

FINISHED = "5e551011-0000-4000-8000-0000000000f1"
HALF_WAY = "6a1f0000-0000-4000-8000-0000000000a2"
IN_STUDY = "57ad1000-0000-4000-8000-0000000000b3"
BATCH = "ba7c4000-0000-4000-8000-000000000001"
PHOTO_PX = (96, 128)
DEPTH_PX = (24, 32)
RECORDED_PX = (48, 64)
RECORDED_FRAMES = 10
PIXELS, PLANES = 48 * 64, 8
SMALL = ("--pixels", str(PIXELS), "--num-planes", str(PLANES))
KEPT_GAUSSIANS = 200
PROTOCOL = """
version = 1
title = "Two ways to photograph"
design = "within"
order = "ab-ba"
planned_participants = 2
seed = 7
consent = "I agree."
conditions = [
  { name = "peaking", label = "Red", overlay = "peaks" },
  { name = "llff", label = "Grid", overlay = "none", guide = "plenoptic", scan = true },
]
scenes = [{ name = "desk", label = "Desk" }]
[ask]
after_review = ["sus"]
"""


def write(folder: Path) -> None:
    """Write everything into a new folder."""
    folder.mkdir(parents=True)
    _sessions(folder / "sessions")
    recording = write_recording(
        folder / "recording", cameras=lateral_cameras(RECORDED_FRAMES, *RECORDED_PX)
    )
    _mpis(folder / "mpi", recording)
    main(["replay", str(recording), "--out", str(folder / "replay"), "--threshold", "0.02", *SMALL])
    evaluated = ["evaluate", str(recording), "--out", str(folder / "evaluation"), "--workers", "1"]
    main([*evaluated, "--strategies", "peaking", "uniform", "--views", "3", *SMALL])
    _splat(folder, recording)
    _simulated_study(folder / "study_simulated")
    _study(folder / "study")
    (folder / "about.json").write_text(json.dumps({"peaking": peaking.__version__}) + "\n")


def upload(number: int, *, with_depth: bool = True) -> bytes:
    """Return a capture of the room: its photo with depth, or with tracked points."""
    camera = lateral_cameras(8, *PHOTO_PX)[number]
    k, pose = camera.pinhole, camera.world_from_cam
    rgb, _ = Room().photographed(camera)
    _, depth_m = Room().photographed(camera.resized(*DEPTH_PX))
    photo = encode_jpeg(rgb, quality=80)
    fields = header(
        number,
        camera={
            "pinhole": {
                "width_px": k.width_px,
                "height_px": k.height_px,
                "fx_px": k.fx_px,
                "fy_px": k.fy_px,
                "cx_px": k.cx_px,
                "cy_px": k.cy_px,
            },
            "world_from_cam": pose.matrix()[:3].ravel().tolist(),
        },
        photo_bytes=len(photo),
        depth={"width_px": DEPTH_PX[0], "height_px": DEPTH_PX[1]} if with_depth else None,
        points=None if with_depth else len(points_m(number)),
    )
    depth = np.round(1000 * depth_m).astype("<u2").tobytes()
    return body_of(fields, photo + (depth if with_depth else points_m(number).tobytes()))


def _clock() -> Callable[[], float]:
    """Return a clock that goes on by a second whenever it is read, the same in every run."""
    seconds = count(1_764_000_000)
    return lambda: float(next(seconds))


def _capture_app(store: SessionStore, root: Path) -> Any:
    options = replace(DEFAULT, pixels=PIXELS, num_planes=PLANES)
    config = ServerOptions(devices=None, client_dir=root / "none", options=options)
    return create_app(store=store, config=config)


def _sessions(root: Path) -> None:
    """Two sessions: one finished; one half-way, as a server leaves it that is killed."""
    clock = _clock()
    store = SessionStore(root, clock=clock)
    with TestClient(_capture_app(store, root), base_url="http://localhost") as client:
        for session, name in ((FINISHED, "Kitchen"), (HALF_WAY, "Küche, 2. Versuch")):
            _begin(client, session, name)
            for number in (1, 2, 3):
                _send(client, session, number, upload(number))
            _wait(client, session)
            client.delete(f"/api/v1/sessions/{session}/captures/{capture_id(2)}")
            _thumbnails(client, session)
            _peaked(client, session)
        client.patch(f"/api/v1/sessions/{FINISHED}", json={"finished": True})
    # A capture with depth and one with tracked points are safe on the disk, and have no MPI yet.
    store = SessionStore(root, clock=clock)
    with (
        patch.object(GenerationQueue, "put"),
        TestClient(_capture_app(store, root), base_url="http://localhost") as client,
    ):
        _send(client, HALF_WAY, 4, upload(4))
        _send(client, HALF_WAY, 5, upload(5, with_depth=False))
    (half_way,) = root.glob(f"*_{HALF_WAY[:8]}")
    with (half_way / "log.jsonl").open("ab") as log:
        log.write(b'{"type":"CaptureStored","at_s":1764000')
    with (half_way / "peaked.jsonl").open("ab") as log:
        log.write(b'{"time_s":17')


def _begin(client: TestClient, session: str, name: str) -> None:
    body = new_session(name=name, device="a test")
    assert client.put(f"/api/v1/sessions/{session}", json=body).status_code == 201


def _send(client: TestClient, session: str, number: int, body: bytes) -> None:
    path = f"/api/v1/sessions/{session}/captures/{capture_id(number)}"
    assert client.put(path, content=body).status_code == 201


def _wait(client: TestClient, session: str) -> None:
    while True:
        captures = client.get(f"/api/v1/sessions/{session}").json()["captures"]
        if all(capture["state"] == "ready" for capture in captures):
            return
        time.sleep(0.05)


def _thumbnails(client: TestClient, session: str) -> None:
    for number in (1, 3):
        path = f"/api/v1/sessions/{session}/captures/{capture_id(number)}/thumbnail"
        assert client.get(path).is_success


def _peaked(client: TestClient, session: str) -> None:
    pose = [1.0, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0]
    samples = [
        {
            "time_s": 1_764_000_000.0 + second,
            "peaked_share": round(0.4 / second, 4),
            "wrong_share": round(0.3 / second, 4),
            "unseen_share": round(0.1 / second, 4),
            "unfixable_share": 0.0,
            "views": min(second, 3),
            "world_from_cam": pose,
        }
        for second in range(1, 9)
    ]
    batch = f"/api/v1/sessions/{session}/peaked/{BATCH}"
    assert client.put(batch, json={"samples": samples}).status_code == 204


def _mpis(folder: Path, recording: Path) -> None:
    folder.mkdir()
    for codec in ("lossless", "jpeg"):
        path = folder / f"{codec}.mpi"
        main(["generate", str(recording), "--out", str(path), "--codec", codec, *SMALL])
        (folder / f"{codec}.json").write_text(json.dumps(facts_of(path), indent=1) + "\n")


def facts_of(path: Path) -> dict[str, Any]:
    """Return what stands in an .mpi file: exactly, but for the texels, which JPEG may round."""
    mpi = read_mpi(path)
    k = mpi.camera.pinhole
    return {
        "size_px": [k.width_px, k.height_px],
        "focal_px": [k.fx_px, k.fy_px],
        "centre_px": [k.cx_px, k.cy_px],
        "world_from_cam": mpi.camera.world_from_cam.matrix().ravel().tolist(),
        "plane_depths_m": mpi.plane_depths_m.tolist(),
        "generator": mpi.generator,
        "tiles": len(mpi.texels),
        "tile_places_sha256": _digest(mpi.tile_places.astype("<i4")),
        "texels_sha256": _digest(mpi.texels),
        "mean_rgba": mpi.texels.reshape(-1, 4).mean(axis=0).tolist(),
    }


def _digest(array: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def _splat(folder: Path, recording: Path) -> None:
    """3D Gaussians as `peaking splat` writes them, of which only some are kept."""
    path = folder / "splat.ply"
    command = ["splat", str(recording), "--out", str(path), "--previews", "0"]
    main([*command, "--pixels", "256", "--iterations", "100"])
    trained = read_ply(path)
    some = slice(None, None, -(-len(trained) // KEPT_GAUSSIANS))
    fields = ("means_m", "log_scales", "quaternions", "opacity_logits", "sh")
    write_ply(path, replace(trained, **{name: getattr(trained, name)[some] for name in fields}))
    kept = read_ply(path)
    means = {name: np.mean(getattr(kept, name), axis=0).ravel().tolist() for name in fields}
    facts = {"gaussians": len(kept), "mean": means}
    (folder / "splat.json").write_text(json.dumps(facts, indent=1) + "\n")


def _simulated_study(folder: Path) -> None:
    main(["study", "simulate", "--participants", "4", "--out", str(folder)])
    facts = folder.with_name(f"{folder.name}.json")
    facts.write_text(json.dumps(means_of(folder), indent=1) + "\n")


def means_of(study: Path) -> dict[str, list[float | None]]:
    """Return the mean of every measure in each condition, as the analysis has it."""
    read = read_study(study)
    analysis = analyse(read.protocol, matrices_of(read))
    return {m.measure.name: [d.mean for d in m.described] for m in analysis.measures}


def _study(folder: Path) -> None:
    """A study: P01 did a trial, P02 has half-filled a form, P03 was erased."""
    folder.mkdir()
    (folder / "protocol.toml").write_text(PROTOCOL)
    sessions = SessionStore(folder / "sessions", clock=_clock())
    config = StudyServerOptions(
        devices=None,
        client_dir=folder / "none",
        phone_links=["http://localhost/participant?participant="],
    )
    app = create_study_app(
        study=OpenStudy(folder, sessions, clock=_clock()),
        capture=_capture_app(sessions, folder),
        config=config,
    )
    with TestClient(app, base_url="http://localhost") as client:
        for participant in ("P01", "P02"):
            client.put(f"/api/v1/study/console/participants/{participant.lower()}-of-corpus")
            _participant(client, participant)
        client.put("/api/v1/study/console/participants/p03-of-corpus")
    erase_participant(folder, "P03")
    (folder / ".serving").unlink(missing_ok=True)


def _participant(client: TestClient, name: str) -> None:
    """Agree and do the first trial; P01 hands the form in, P02 has only begun it."""
    own = f"/api/v1/study/participants/{name}"
    console = f"/api/v1/study/console/participants/{name}"
    assert client.put(f"{own}/consent", json={"agreed": True, "images": True}).is_success

    def do(step: str) -> None:
        for what in ("started", "finished"):
            assert client.put(f"{console}/steps/{step}/{what}").is_success

    if client.get(own).json()["step"]["key"] == "t1.scan":
        do("t1.scan")
    assert client.put(f"{console}/steps/t1.capture/started").is_success
    session = IN_STUDY.replace("b3", name[1:])
    linked = client.put(f"{own}/steps/t1.capture/session", json={"session": session})
    assert linked.is_success
    _begin(client, session, "Desk")
    _send(client, session, 1, upload(1))
    _wait(client, session)
    for number, (kind, second, more) in enumerate(
        (
            ("CaptureBegun", 10.0, {}),
            ("ViewTaken", 12.0, {"capture": capture_id(1)}),
            ("ViewJoined", 12.5, {"capture": capture_id(1), "generated_s": 12.4}),
            ("PeakedTold", 13.0, {"peaked_share": 0.25, "unseen_share": 0.125, "views": 1}),
            ("CaptureEnded", 40.0, {}),
        )
    ):
        event = {"kind": kind, "id": f"{name}-{kind}", "step": "t1.capture", "time_s": second}
        told = {"session": session, "events": [event | more]}
        assert client.put(f"{own}/told/{session[:-1]}{number}", json=told).status_code == 204
    assert client.put(f"{console}/steps/t1.capture/finished").is_success
    do("t1.review")
    form = f"{own}/steps/t1.ask.sus"
    if name == "P01":
        answers = {f"q{item}": 4 if item % 2 else 2 for item in range(1, 11)}
        handed_in = client.put(f"{form}/answers", json={"answers": answers})
        assert handed_in.is_success
    else:
        draft = client.patch(f"{form}/draft", json={"answers": {"q1": 3}})
        assert draft.is_success


if __name__ == "__main__":
    destination = Path(sys.argv[1])
    if destination.exists():
        raise SystemExit(f"{destination} exists; what is written there is frozen")
    try:
        write(destination)
    except BaseException:
        shutil.rmtree(destination, ignore_errors=True)
        raise
