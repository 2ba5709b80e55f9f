from __future__ import annotations

import re
from urllib.parse import unquote

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.responses import Response

from peaking.server.responses import attachment

FORM = re.compile(
    r"attachment; filename=\"([A-Za-z0-9 ._()-]*)\"; filename\*=UTF-8''([A-Za-z0-9._~%-]*)"
)


@pytest.mark.parametrize(
    ("name", "plain"),
    [
        ("2026-11-30_101112_c0ffee00.zip", "2026-11-30_101112_c0ffee00.zip"),
        ("台所.zip", "__.zip"),
        ('a"; filename="b.exe', "a__ filename__b.exe"),
        ("a\r\nSet-Cookie: x=1", "a__Set-Cookie_ x_1"),
        ("../etc/passwd", ".._etc_passwd"),
    ],
)
def test_a_name(name: str, plain: str) -> None:
    found = FORM.fullmatch(attachment(name)["Content-Disposition"])
    assert found is not None
    assert found[1] == plain
    assert unquote(found[2]) == name


@given(st.text() | st.just("bad\udcff.zip"))
def test_any_name_is_a_header(name: str) -> None:
    headers = attachment(name)
    assert FORM.fullmatch(headers["Content-Disposition"])
    Response(b"", headers=headers)
