"""`peaking serve` and `peaking demo` as they are run."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import re
import socket
import ssl
import stat
import subprocess
import sys
from pathlib import Path
from uuid import uuid4

import pytest

from capture_uploads import SESSION_ID, new_session, upload
from patience import PATIENCE_S
from peaking.server.serving import bind
from peaking.server.wire import PROTOCOL

PEAKING = "from peaking.cli import main; main()"


def run(arguments: list[str], home: Path, until: str) -> tuple[subprocess.Popen[str], str]:
    process = subprocess.Popen(
        [sys.executable, "-c", PEAKING, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"XDG_CONFIG_HOME": str(home), "PYTHONUNBUFFERED": "1"},
    )
    assert process.stdout is not None
    said = ""
    for line in process.stdout:
        said += line
        if until in line:
            break
    return process, said


def end(process: subprocess.Popen[str]) -> None:
    process.send_signal(2)
    process.wait(PATIENCE_S)
    assert process.stdout is not None
    process.stdout.close()


def test_serve_prints_a_link_that_works_over_https(tmp_path: Path) -> None:
    arguments = ["serve", str(tmp_path / "s"), "--port", "0"]
    process, said = run(arguments, tmp_path, "Ctrl-C")
    try:
        assert "▀" in said or "█" in said  # the code to scan
        found = re.search(r"https://(\S+):(\d+)/#code=(\S{20,})", said)
        assert found, said
        address = f"https://{found[1]}:{found[2]}/"
        assert re.search(rf"Capture page: +{re.escape(address)} ", said)
        assert re.search(rf"List of sessions: +{re.escape(address)}sessions\n", said)
        plain = http.client.HTTPConnection("localhost", int(found[2]))
        plain.request("GET", "/sessions?a=b")
        sent_on = plain.getresponse()
        https = f"https://localhost:{found[2]}/sessions?a=b"
        assert (sent_on.status, sent_on.headers["location"]) == (307, https)
        plain.close()
        trusts = ssl.create_default_context(cafile=str(tmp_path / "peaking" / "peaking-ca.pem"))
        connection = http.client.HTTPSConnection("localhost", int(found[2]), context=trusts)
        connection.request("GET", "/api/v1/server")
        refused = connection.getresponse()
        assert (refused.status, b"protocol" in refused.read()) == (401, False)
        asked = {"protocol": PROTOCOL, "code": found[3], "device": str(uuid4())}
        connection.request("POST", "/api/v1/pair", json.dumps(asked))
        credential = json.loads(connection.getresponse().read())["credential"]
        headers = {"Authorization": f"Bearer {credential}"}
        connection.request("GET", "/api/v1/server", headers=headers)
        answer = connection.getresponse()
        assert (answer.status, b'"protocol":3' in answer.read()) == (200, True)
        connection.close()
        assert process.stdout is not None
        for line in process.stdout:  # the link for the next phone
            if "/#code=" in line:
                assert found[3] not in line
                break
    finally:
        end(process)


def test_serve_for_a_phone_on_a_cable(tmp_path: Path) -> None:
    process, said = run(["serve", str(tmp_path / "s"), "--adb", "--port", "0"], tmp_path, "Ctrl-C")
    end(process)
    port = re.search(r"http://localhost:(\d+)/#code=\S{20,}", said)
    assert port
    assert f"adb reverse tcp:{port[1]} tcp:{port[1]}" in said
    assert not (tmp_path / "peaking").exists()


@pytest.mark.parametrize("stream", ["/api/v1/events", "/api/v1/study/console/events"])
def test_ctrl_c_does_not_wait_for_those_who_listen(tmp_path: Path, stream: str) -> None:
    arguments = ["demo", "--no-open", "--port", "0", "--sessions", str(tmp_path / "s")]
    if "study" in stream:
        assert subprocess.run(
            [sys.executable, "-c", PEAKING, "study", "init", str(tmp_path / "study")], check=False
        ).returncode == 0  # fmt: skip
        arguments = ["study", "serve", str(tmp_path / "study"), "--local", "--port", "0"]
    process, said = run(arguments, tmp_path, "Ctrl-C")
    port = re.search(r"http://localhost:(\d+)", said)
    assert port, said
    connection = http.client.HTTPConnection("localhost", int(port[1]), timeout=PATIENCE_S)
    connection.request("GET", stream)
    events = connection.getresponse()
    assert events.readline().startswith(b"data:")
    process.send_signal(2)
    events.read()  # raises when it is cut off, which is done to those who are waited for
    end(process)
    connection.close()


def test_the_demo_refuses_to_be_seen_by_others(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PEAKING, "demo", "--no-open", "--host", "0.0.0.0"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 2
    assert "peaking serve" in done.stderr


def test_a_taken_port_is_passed_over(tmp_path: Path) -> None:
    demo = ["demo", "--no-open", "--sessions"]
    one, said_one = run([*demo, str(tmp_path / "1"), "--port", "0"], tmp_path, "Capture page")
    port = re.search(r"localhost:(\d+)", said_one)
    assert port
    two, said_two = run([*demo, str(tmp_path / "2"), "--port", port[1]], tmp_path, "Capture page")
    end(one)
    end(two)
    other = re.search(r"localhost:(\d+)", said_two)
    assert other
    assert int(other[1]) > int(port[1])


def test_a_folder_is_served_once_and_is_private(tmp_path: Path) -> None:
    folder = tmp_path / "sessions"
    demo = ["demo", "--no-open", "--port", "0", "--sessions", str(folder)]
    one, said = run(demo, tmp_path, "Ctrl-C")
    try:
        port = re.search(r"localhost:(\d+)", said)
        assert port
        connection = http.client.HTTPConnection("localhost", int(port[1]))
        connection.request("PUT", f"/api/v1/sessions/{SESSION_ID}", json.dumps(new_session()))
        assert connection.getresponse().read()
        connection.request("PUT", f"/api/v1/sessions/{SESSION_ID}/captures/{SESSION_ID}", upload(1))
        assert connection.getresponse().status == 201
        connection.close()
        two, refused = run(demo, tmp_path, "another process")
        assert two.stdout is not None
        two.stdout.close()
        assert two.wait(PATIENCE_S) == 2
        assert f"another process ('peaking demo', number {one.pid}" in refused
        assert "Traceback" not in refused
    finally:
        end(one)
    paths = [folder, *folder.rglob("*")]
    modes = {str(p): oct(stat.S_IMODE(p.stat().st_mode)) for p in paths}
    open_to_others = {p: mode for p, mode in modes.items() if not mode.endswith("00")}
    assert len(modes) > 10
    assert open_to_others == {}


def test_answers_are_sent_at_once() -> None:
    """Without TCP_NODELAY the body of an answer waits until its head is acknowledged, 40 ms."""
    told: list[int] = []

    async def talk() -> None:
        def accepted(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            connection = writer.get_extra_info("socket")
            told.append(connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()

        with bind("127.0.0.1", 0) as listener:
            port = listener.getsockname()[1]
            async with await asyncio.start_server(accepted, sock=listener):
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                await reader.read()
                writer.close()
                await writer.wait_closed()

    asyncio.run(talk())
    assert [option != 0 for option in told] == [True]


@pytest.mark.parametrize("command", ["serve", "demo"])
def test_help_has_examples(command: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PEAKING, command, "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert f"peaking {command}" in done.stdout
