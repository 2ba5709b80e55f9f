"""What requests carry: cookies by hand, and whose body may be how long."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from test_app import SESSION, client_of

from peaking.server import requests
from peaking.server.requests import MAX_STRANGER_BYTES, cookie_of, mark_paired


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        (b"peaking_token=abc", "abc"),
        (b"a=1; peaking_token=abc; b=2", "abc"),
        (b"a=1;peaking_token=one;peaking_token=two", "one"),
        (b" peaking_token = abc ", "abc"),
        (b"not_peaking_token=abc", None),
        (b"peaking_token", ""),
        (b"peaking_token=a=b", "a=b"),
        (b'a="peaking_token=no', None),
        (b"\xff=\xfe; peaking_token=\xe9", "\xe9"),
        (b"", None),
    ],
)
def test_a_cookie_is_found(header: bytes, expected: str | None) -> None:
    scope = {"type": "http", "headers": [(b"host", b"x"), (b"cookie", header)]}
    assert cookie_of(scope, "peaking_token") == expected


def test_the_standard_library_reads_no_cookie_of_a_stranger(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It needs 23 s for `a="` and 48 kB of backslashes."""

    def forbidden(*_: object, **__: object) -> Iterator[None]:
        raise AssertionError("http.cookies was asked")

    monkeypatch.setattr("http.cookies.BaseCookie.load", forbidden)
    monkeypatch.setattr("starlette.requests.cookie_parser", forbidden)
    with client_of(tmp_path) as client:
        del client.headers["Authorization"]
        for cookie in ('a="' + "\\" * 10_000, "peaking_token=" + '"' * 10_000, ";" * 10_000):
            answer = client.get("/api/v1/server", headers={"Cookie": cookie})
            assert answer.status_code == 401


def test_a_connection_is_told_that_it_is_paired(tmp_path: Path) -> None:
    told: list[str | None] = []
    scope = {"type": "http", "extensions": {requests.PAIRED: told.append}}
    mark_paired(scope, "device 7")
    assert told == ["device 7"]
    assert scope[requests.DEVICE] == "device 7"


def _nothing(*_: object) -> None:
    pass


def test_strangers_bodies_are_short(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with client_of(tmp_path) as client:
        monkeypatch.setattr("peaking.server.auth.mark_paired", _nothing)
        body = b'{"protocol": 2, "name": "' + b"x" * MAX_STRANGER_BYTES + b'"}'
        answer = client.put(SESSION, content=body)
    assert answer.status_code == 413
    assert f"{MAX_STRANGER_BYTES:,}" in answer.json()["detail"]
