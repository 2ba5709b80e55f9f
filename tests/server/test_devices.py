"""Devices are paired once by a code, and let in by a credential of their own."""

from __future__ import annotations

import asyncio
import os
import re
import stat
import threading
import time
from pathlib import Path
from typing import Any
from uuid import uuid4

import msgspec
import pytest
from starlette.testclient import TestClient

from clocks import Clock
from patience import PATIENCE_S
from peaking.cli import main
from peaking.errors import PeakingError
from peaking.server import devices as module
from peaking.server.app import ServerOptions, create_app
from peaking.server.auth import RENEWED
from peaking.server.device_routes import pairing_link
from peaking.server.devices import DAY_S, LASTS_S, Devices
from peaking.server.guessing import FREE_FAILURES, MAX_ADDRESSES, Guesses, TooManyGuesses
from peaking.server.pairing_codes import (
    ANSWERED_AGAIN_S,
    CODE_LASTS_S,
    DEVICE,
    CodeRefused,
    Grant,
    PairingCodes,
)
from peaking.server.sessions import SessionStore
from peaking.server.wire import PROTOCOL

PHONE = "0f0f0f0f-0000-4000-8000-000000000001"
OTHER = "0f0f0f0f-0000-4000-8000-000000000002"


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def devices(tmp_path: Path, clock: Clock) -> Devices:
    return Devices(tmp_path / "sessions", clock=clock)


def paired(devices: Devices, device: str = PHONE) -> str:
    found = devices.pair(devices.codes.give(DEVICE), device=device, name="Pixel")
    assert found
    return found[1]


def server(tmp_path: Path, devices: Devices, scheme: str = "http") -> TestClient:
    config = ServerOptions(devices=devices, client_dir=tmp_path, pages=["http://localhost/"])
    app = create_app(store=SessionStore(tmp_path / "sessions"), config=config)
    return TestClient(app, base_url=f"{scheme}://localhost")


def ask_to_pair(client: TestClient, code: str, device: str = PHONE, **more: Any) -> Any:
    asked = {"protocol": PROTOCOL, "code": code, "device": device, "name": "Pixel", **more}
    return client.post("/api/v1/pair", json=asked)


# Codes


def test_a_code_pairs_one_device_and_its_answer_may_be_lost(devices: Devices, clock: Clock) -> None:
    code = devices.codes.give(DEVICE)
    first = devices.pair(code, device=PHONE, name="Pixel")
    assert first
    clock.now_s += ANSWERED_AGAIN_S - 1
    again = devices.pair(code, device=PHONE, name="Pixel")
    assert again
    assert (again[0].id, again[1]) == (first[0].id, first[1])
    with pytest.raises(CodeRefused, match="used before"):
        devices.pair(code, device=OTHER, name="Pixel")
    clock.now_s += 2
    with pytest.raises(CodeRefused, match="used before"):
        devices.pair(code, device=PHONE, name="Pixel")
    assert devices.known(first[1])


def test_a_code_expires(clock: Clock) -> None:
    over: list[str] = []
    codes = PairingCodes(clock=clock)
    code = codes.give(DEVICE, after=lambda: over.append("shown anew"))
    clock.now_s += CODE_LASTS_S
    for _ in range(2):
        with pytest.raises(CodeRefused):
            codes.redeem(code, "device")
    assert over == ["shown anew"]  # not once for every try
    assert codes.redeem("another", "device") is None


def test_two_who_come_at_once_with_one_code_are_not_both_paired(devices: Devices) -> None:
    for _ in range(20):
        code = devices.codes.give(DEVICE)
        results: list[object] = []

        def come(code: str = code, results: list[object] = results) -> None:
            try:
                results.append(devices.pair(code, device=str(uuid4()), name=""))
            except CodeRefused:
                results.append(None)

        threads = [threading.Thread(target=come) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert sum(result is not None for result in results) == 1


def test_codes_do_not_grow_without_end(clock: Clock) -> None:
    codes = PairingCodes(clock=clock)
    first = codes.give(DEVICE)
    for _ in range(1000):
        codes.give(DEVICE)
    assert codes.redeem(first, "device") is None


# Credentials


def test_the_file_lets_nobody_in(devices: Devices, tmp_path: Path) -> None:
    credential = paired(devices)
    path = tmp_path / "sessions" / ".peaking" / "devices.json"
    text = path.read_text()
    assert credential not in text
    assert PHONE not in text
    for word in re.findall(r"[0-9A-Za-z_-]{8,}", text):
        assert devices.known(word) is None
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


def test_a_device_stays_paired_over_a_restart(
    devices: Devices, tmp_path: Path, clock: Clock
) -> None:
    credential = paired(devices)
    again = Devices(tmp_path / "sessions", clock=clock)
    assert again.known(credential)
    assert again.cookie == devices.cookie
    other = Devices(tmp_path / "other", clock=clock)
    assert other.known(credential) is None
    assert other.cookie != devices.cookie


def test_a_credential_is_renewed_by_use_and_an_answer_that_is_lost_harms_nobody(
    devices: Devices, tmp_path: Path, clock: Clock
) -> None:
    first = paired(devices)
    known = devices.known(first)
    assert known
    assert not known.renewal_due
    clock.now_s += DAY_S + 1
    known = devices.known(first)
    assert known
    assert known.renewal_due
    second = devices.renew(first)
    assert second
    assert devices.renew(first) == second  # the answer was lost
    restarted = Devices(tmp_path / "sessions", clock=clock)
    assert restarted.renew(first) == second
    clock.now_s += 5 * DAY_S
    assert restarted.known(first)  # nobody used the second yet
    assert restarted.known(second)
    restarted.close()
    clock.now_s += module.OVERLAP_S
    assert restarted.known(first) is None
    assert restarted.known(second)
    clock.now_s += LASTS_S
    assert restarted.known(second) is None
    assert Devices(tmp_path / "sessions", clock=clock).list() == []


def test_what_is_asked_at_every_request_touches_no_file(
    devices: Devices, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    credential = paired(devices)
    blocked = threading.Event()

    def stuck(*_: object) -> None:
        blocked.wait(PATIENCE_S)

    monkeypatch.setattr(os, "fsync", stuck)
    writing = threading.Thread(target=paired, args=[devices, OTHER])
    writing.start()
    try:
        time.sleep(0.05)
        assert devices.known(credential)  # while the disk keeps another one waiting
        assert writing.is_alive()
    finally:
        blocked.set()
        writing.join()


def test_devices_are_bounded(
    devices: Devices, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MAX_DEVICES", 3)
    credentials: list[str] = []
    for _ in range(5):
        clock.now_s += 1
        credentials.append(paired(devices, str(uuid4())))
    assert [devices.known(c) is not None for c in credentials] == [False, False, True, True, True]
    for _ in range(10):
        paired(devices, PHONE)
    assert max(len(device.credentials) for device in devices.list()) <= module.MAX_CREDENTIALS


@pytest.mark.parametrize("damage", [b"", b"{", b"\x00" * 300, b'{"version":1}', b"[]"])
def test_a_damaged_file_lets_nobody_in_and_is_set_aside(tmp_path: Path, damage: bytes) -> None:
    credential = paired(Devices(tmp_path))
    path = tmp_path / ".peaking" / "devices.json"
    path.write_bytes(damage)
    again = Devices(tmp_path)
    assert again.known(credential) is None
    assert again.list() == []
    if damage:
        assert "has to pair again" in again.problems[0] or "have to pair again" in again.problems[0]
    assert again.known(paired(again))


def test_names_control_nothing(devices: Devices) -> None:
    code = devices.codes.give(DEVICE)
    devices.pair(code, device=PHONE, name="\x1b]0;owned\x07\nPixel\u202e" + "x" * 500)
    (found,) = devices.list()
    assert found.name.isprintable()
    assert len(found.name) <= module.MAX_NAME


def test_another_process_may_revoke(
    devices: Devices, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "study" / "sessions"
    running = Devices(folder)
    first, second = paired(running), paired(running, OTHER)
    ended: list[str] = []
    number = running.list()[0].id
    device = running.known(first)
    assert device
    with running.listening(device.device.id, lambda: ended.append("stream")):
        main(["devices", str(tmp_path / "study"), "--revoke", device.device.id])
        running.refresh()
    assert ended == ["stream"]
    assert running.known(first) is None
    assert running.known(second)
    assert "Pixel" in capsys.readouterr().out
    main(["devices", str(folder), "--revoke", "all"])
    running.refresh()
    assert running.known(second) is None
    assert number
    with pytest.raises(SystemExit):
        main(["devices", str(tmp_path / "nowhere")])


# Over HTTP


def test_a_browser_gets_a_cookie_that_no_script_can_read(tmp_path: Path, devices: Devices) -> None:
    with server(tmp_path, devices) as client:
        answer = ask_to_pair(client, devices.codes.give(DEVICE), cookie=True)
        assert answer.json() == {"device": devices.list()[0].id, "role": "device",
                                 "credential": None}  # fmt: skip
        cookie = answer.headers["set-cookie"]
        assert cookie.startswith(f"{devices.cookie}=")
        for part in ("HttpOnly", "SameSite=Strict", "Path=/", f"Max-Age={LASTS_S:.0f}"):
            assert part in cookie
        assert "Secure" not in cookie
        assert client.get("/api/v1/sessions").status_code == 200
        client.cookies.clear()
        client.cookies.set("peaking_token", cookie.split("=")[1].split(";")[0])
        assert client.get("/api/v1/sessions").status_code == 401  # of another server


def test_over_https_the_cookie_is_bound_to_this_host(tmp_path: Path, devices: Devices) -> None:
    with server(tmp_path, devices, "https") as client:
        cookie = ask_to_pair(client, devices.codes.give(DEVICE), cookie=True).headers["set-cookie"]
        assert cookie.startswith(f"__Host-{devices.cookie}=")
        assert "; Secure" in cookie
        assert client.get("/api/v1/sessions").status_code == 200


def test_a_credential_is_renewed_over_http(tmp_path: Path, devices: Devices, clock: Clock) -> None:
    with server(tmp_path, devices) as client:
        ask_to_pair(client, devices.codes.give(DEVICE), cookie=True)
        bearer = ask_to_pair(client, devices.codes.give(DEVICE), OTHER).json()["credential"]
        headers = {"Authorization": f"Bearer {bearer}"}
        assert "set-cookie" not in client.get("/api/v1/server").headers
        clock.now_s += DAY_S + 1
        answer = client.get("/api/v1/server")
        assert answer.headers["set-cookie"].startswith(f"{devices.cookie}=")
        assert "set-cookie" not in client.get("/api/v1/server").headers
        client.cookies.clear()
        renewed = client.get("/api/v1/server", headers=headers).headers[RENEWED]
        assert client.get("/api/v1/server", headers=headers).headers[RENEWED] == renewed
        answer = client.get("/api/v1/server", headers={"Authorization": f"Bearer {renewed}"})
        assert (answer.status_code, RENEWED in answer.headers) == (200, False)


@pytest.mark.parametrize(
    ("asked", "status"),
    [
        ({"code": "x" * 201}, 422),
        ({"code": ""}, 422),
        ({"device": "no id"}, 422),
        ({"protocol": 2}, 400),
        ({"admin": True}, 422),
        ({"code": "wrong"}, 401),
        ({"name": "x" * 5000}, 413),
    ],
)
def test_what_pairs_nobody(
    tmp_path: Path, devices: Devices, asked: dict[str, object], status: int
) -> None:
    with server(tmp_path, devices) as client:
        whole = {"protocol": PROTOCOL, "code": devices.codes.give(DEVICE), "device": PHONE, **asked}
        answer = client.post("/api/v1/pair", json=whole)
        assert answer.status_code == status
        assert "set-cookie" not in answer.headers
        assert devices.list() == []


def test_a_page_of_another_origin_pairs_nobody(tmp_path: Path, devices: Devices) -> None:
    with server(tmp_path, devices) as client:
        code = devices.codes.give(DEVICE)
        client.headers["origin"] = "https://evil.example"
        assert ask_to_pair(client, code, cookie=True).status_code == 403


def test_a_used_link_is_refused_with_a_sentence(tmp_path: Path, devices: Devices) -> None:
    shown: list[str] = []
    link = pairing_link(devices, ["http://a/"], DEVICE, after=lambda: shown.append("next"))
    code = link.links[0].partition("#code=")[2]
    with server(tmp_path, devices) as client:
        assert ask_to_pair(client, code).status_code == 200
        refused = ask_to_pair(client, code, OTHER)
        assert refused.status_code == 401
        assert "was used before" in refused.json()["detail"]
        assert shown == ["next"]


def test_devices_are_listed_and_revoked(tmp_path: Path, devices: Devices) -> None:
    with server(tmp_path, devices) as client:
        ask_to_pair(client, devices.codes.give(DEVICE), cookie=True)
        link = client.post("/api/v1/devices/codes").json()
        assert link["links"][0].startswith("http://localhost/#code=")
        assert link["qr_svg"].startswith("<svg")
        second = ask_to_pair(client, link["links"][0].partition("#code=")[2], OTHER).json()
        listed = client.get("/api/v1/devices").json()
        assert listed["open"] is False
        assert {(d["id"], d["this"]) for d in listed["devices"]} >= {(second["device"], False)}
        assert sum(d["this"] for d in listed["devices"]) == 1
        theirs = {"Authorization": f"Bearer {second['credential']}", "Cookie": ""}
        alone = TestClient(client.app, base_url="http://localhost", headers=theirs)
        assert alone.get("/api/v1/server").status_code == 200
        for _ in range(2):
            assert client.delete(f"/api/v1/devices/{second['device']}").status_code == 204
        assert alone.get("/api/v1/server").status_code == 401


def test_a_fixed_secret_pairs_any_number_and_lets_nobody_in_by_itself(tmp_path: Path) -> None:
    secret = "Wq3vZ81-kTb5xNcE7r"
    devices = Devices(tmp_path / "sessions", fixed_secret=secret)
    with server(tmp_path, devices) as client:
        credentials = {
            ask_to_pair(client, secret, device).json()["credential"]
            for device in (PHONE, OTHER, OTHER)
        }
        assert len(devices.list()) == 2
        assert secret not in credentials
        headers = {"Authorization": f"Bearer {secret}"}
        assert client.get("/api/v1/server", headers=headers).status_code == 401
    assert secret not in (tmp_path / "sessions" / ".peaking" / "devices.json").read_text()


def test_the_streams_of_a_revoked_device_end(tmp_path: Path, devices: Devices) -> None:
    config = ServerOptions(devices=devices, client_dir=tmp_path)
    app = create_app(store=SessionStore(tmp_path / "sessions"), config=config)
    credential = paired(devices)

    async def listen() -> list[dict[str, Any]]:
        sent: list[dict[str, Any]] = []
        begun = asyncio.Event()
        scope = {
            "type": "http", "method": "GET", "path": "/api/v1/events", "raw_path": b"",
            "query_string": b"", "root_path": "", "scheme": "http", "http_version": "1.1",
            "headers": [(b"host", b"x"), (b"authorization", f"Bearer {credential}".encode())],
            "client": ("192.0.2.1", 5), "server": ("x", 80),
        }  # fmt: skip

        async def receive() -> dict[str, Any]:
            await asyncio.Event().wait()  # nothing more is asked
            raise AssertionError

        async def send(message: Any) -> None:
            sent.append(message)
            if message.get("body"):
                begun.set()

        answer = asyncio.ensure_future(app(scope, receive, send))  # type: ignore[arg-type]
        await asyncio.wait_for(begun.wait(), PATIENCE_S)
        known = devices.known(credential)
        assert known
        await asyncio.to_thread(devices.revoke, known.device.id)
        await asyncio.wait_for(answer, PATIENCE_S)
        return sent

    sent = asyncio.run(listen())
    assert sent[0]["status"] == 200
    assert sent[-1] == {"type": "http.response.body", "body": b"", "more_body": False}


# Guessing


def guesses_with_a_clock() -> tuple[Guesses, Clock, list[float]]:
    clock, slept = Clock(), list[float]()

    async def sleep(delay_s: float) -> None:
        slept.append(delay_s)
        clock.now_s += delay_s

    return Guesses(clock=clock, sleep=sleep), clock, slept  # type: ignore[arg-type]


def test_who_is_wrong_often_waits_longer_and_nobody_else_does() -> None:
    guesses, clock, slept = guesses_with_a_clock()

    async def guess(times: int, address: str) -> None:
        for _ in range(times):
            await guesses.before(address)
            await guesses.failed(address)

    asyncio.run(guess(FREE_FAILURES, "10.0.0.7"))
    assert slept == []
    asyncio.run(guess(6, "10.0.0.7"))
    assert slept == sorted(slept) or max(slept) >= 8.0
    before_s = clock.now_s
    asyncio.run(guesses.before("10.0.0.8"))
    assert clock.now_s == before_s
    for number in range(20):  # one machine has as many IPv6 addresses as it likes
        asyncio.run(guess(1, f"2a02::{number:x}"))
    assert clock.now_s > before_s + 8


@pytest.mark.parametrize("network", ["fe80::", "fd12:3456:789a:1::", "::ffff:10.0.0.", "10.0.0."])
def test_a_neighbour_who_guesses_slows_nobody_else(network: str) -> None:
    async def for_ever(_: float) -> None:
        await asyncio.Event().wait()

    async def guess() -> None:
        guesses = Guesses(sleep=for_ever)  # type: ignore[arg-type]
        for _ in range(FREE_FAILURES):
            await guesses.failed(f"{network}66")
        waiting = [asyncio.ensure_future(guesses.before(f"{network}66")) for _ in range(2)]
        await asyncio.sleep(0)
        async with asyncio.timeout(PATIENCE_S):
            await guesses.before(f"{network}7")
            await guesses.failed(f"{network}7")
        assert not any(one.done() for one in waiting)
        for one in waiting:
            one.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)

    asyncio.run(guess())


def test_who_waits_is_bounded_and_so_is_what_is_remembered() -> None:
    async def flood() -> tuple[int, int]:
        guesses = Guesses()
        for number in range(3 * MAX_ADDRESSES):
            await guesses.failed(f"10.{number // 65536}.{number // 256 % 256}.{number % 256}")
        for _ in range(FREE_FAILURES):
            await guesses.failed("192.168.0.1")
        tries = [asyncio.ensure_future(guesses.before("192.168.0.1")) for _ in range(100)]
        refused = await asyncio.gather(*tries, return_exceptions=True)
        return (
            sum(isinstance(r, TooManyGuesses) for r in refused),
            len(guesses._failures),
        )

    refused, remembered = asyncio.run(flood())
    assert refused >= 98
    assert remembered <= MAX_ADDRESSES


def test_guessing_at_the_door_ends_in_429_and_paired_devices_do_not_notice(
    tmp_path: Path, devices: Devices, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(Guesses):
        async def _wait(self, who: Any, delay_s: float) -> None:
            raise TooManyGuesses(delay_s)

    devices.guesses = Full()
    credential = paired(devices)
    with server(tmp_path, devices) as client:
        good = devices.codes.give(DEVICE)
        statuses = [ask_to_pair(client, f"wrong-{n}").status_code for n in range(8)]
        assert statuses == [401] * FREE_FAILURES + [429] * (8 - FREE_FAILURES)
        refused = ask_to_pair(client, good, OTHER)  # not even the right one is heard
        assert refused.status_code == 429
        assert int(refused.headers["retry-after"]) >= 1
        wrong = {"Authorization": "Bearer wrong"}
        assert client.get("/api/v1/server", headers=wrong).status_code == 429
        assert client.get("/api/v1/server").status_code == 401
        right = {"Authorization": f"Bearer {credential}"}
        assert client.get("/api/v1/server", headers=right).status_code == 200


def test_what_is_kept_of_a_device_is_small(devices: Devices, tmp_path: Path) -> None:
    paired(devices)
    file = msgspec.json.decode((tmp_path / "sessions/.peaking/devices.json").read_bytes())
    assert set(file) == {"version", "server", "devices"}
    assert len(file["server"]) == 8


def test_a_participant_who_is_erased_leaves_no_trace(devices: Devices) -> None:
    both, one = str(uuid4()), str(uuid4())
    credentials: list[str] = []
    for device, who in ((both, "P01"), (both, "P02"), (one, "P01")):
        found = devices.pair(
            devices.codes.give(Grant("participant", who)), device=device, name="phone"
        )
        assert found
        credentials.append(found[1])
    devices.forget("P01")
    assert [device.participants for device in devices.list()] == [["P02"]]
    assert [devices.known(c) is not None for c in credentials] == [True, True, False]


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(PeakingError, match="lies below something that is a file"):
        Devices(tmp_path / "file" / "sessions")
