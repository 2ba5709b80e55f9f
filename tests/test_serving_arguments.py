"""Fixed tokens, and the Python that serves."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

import pytest

from peaking.commands.arguments import ArgumentError
from peaking.commands.python_version import NEEDED, say_when_outdated
from peaking.commands.serving import fixed_token


@pytest.fixture(autouse=True)
def _no_token(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PEAKING_TOKEN", raising=False)


def kept(tmp_path: Path, token: str, mode: int = 0o600) -> Path:
    file = tmp_path / "token"
    file.write_text(token)
    file.chmod(mode)
    return file


def test_a_token_comes_from_a_file_or_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert fixed_token(None) is None
    for token in [secrets.token_urlsafe(24) for _ in range(200)]:
        assert fixed_token(kept(tmp_path, token + "\n")) == token
    monkeypatch.setenv("PEAKING_TOKEN", "Wq3vZ81-kTb5xNcE7r")
    assert fixed_token(None) == "Wq3vZ81-kTb5xNcE7r"
    assert "PEAKING_TOKEN" not in os.environ  # programs that are started from here do not get it
    monkeypatch.setenv("PEAKING_TOKEN", "weak")
    with pytest.raises(ArgumentError, match="PEAKING_TOKEN: need a token"):
        fixed_token(None)


@pytest.mark.parametrize(
    "token",
    [
        "", "short", "a" * 40, "abababababababababab", "abcdefghijklmnop", "0123456789abcdef",
        "zyxwvutsrqponmlkjihg", "password-for-my-lab-1", "Peaking-Wq3vZ81-kTb5", "x" * 201,
        "Wq3vZ81k Tb5xNcE7rLm", "Wq3vZ81kTb5xNcE7r\nWq3vZ81kTb5xNcE7r", "Wq3v5xNcWq3v5xNcWq3v5xNc",
        "1234512345123451", "äöüßéèêçñøåæœþðÿ",
    ],
)  # fmt: skip
def test_weak_tokens_are_refused(tmp_path: Path, token: str) -> None:
    with pytest.raises(ArgumentError, match="need a token"):
        fixed_token(kept(tmp_path, token))


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o666])
def test_a_token_that_others_can_read_is_refused(tmp_path: Path, mode: int) -> None:
    with pytest.raises(ArgumentError, match="chmod 600"):
        fixed_token(kept(tmp_path, secrets.token_urlsafe(24), mode))


def test_a_python_without_a_fix_is_warned_of(capsys: pytest.CaptureFixture[str]) -> None:
    for (major, minor), (patch, _) in NEEDED.items():
        say_when_outdated((major, minor, patch))
        assert capsys.readouterr().err == ""
        say_when_outdated((major, minor, patch - 1))
        assert f"Python {major}.{minor}.{patch - 1} lacks" in capsys.readouterr().err
    say_when_outdated((3, 99, 0))
    assert capsys.readouterr().err == ""
