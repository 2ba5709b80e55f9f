"""Codes that pair: each once, for ten minutes, and known to this process alone."""

from __future__ import annotations

import hashlib
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

CODE_LASTS_S = 600.0
ANSWERED_AGAIN_S = 60.0
"""So long the device that used a code gets the same answer again: the first may have been lost."""
MAX_CODES = 200
"""Codes that may be open at once; the oldest ends."""

Role = Literal["device", "participant", "console"]
"""What a device may do: take photos and see all; one participant's part; run the study."""


@dataclass(frozen=True)
class Grant:
    """What a code pairs a device for."""

    role: Role
    participant: str | None = None


DEVICE = Grant("device")
CONSOLE = Grant("console")


@dataclass
class _Open:
    grant: Grant
    salt: str
    until_s: float
    after: Callable[[], None]
    used_by: str | None = None


@dataclass(frozen=True)
class Redeemed:
    """A code that was right: what it grants, and the salt of the credential that follows from it.

    The same code of the same device is the same salt, so that the same answer follows.
    """

    grant: Grant
    salt: str


class CodeRefused(Exception):
    """A code pairs no device; the message says why, as far as whoever knows it may know."""


class PairingCodes:
    """The codes that were given out and are not over."""

    def __init__(
        self,
        *,
        clock: Callable[[], float] = time.time,
        draw: Callable[[int], str] = secrets.token_urlsafe,
    ) -> None:
        """Begin without codes."""
        self._clock = clock
        self._draw = draw
        self._lock = threading.Lock()
        self._open: dict[str, _Open] = {}

    def give(self, grant: Grant, *, after: Callable[[], None] = lambda: None) -> str:
        """Return a new code.

        Args:
            grant: What it pairs for.
            after: Called, in any thread, once somebody came with it: it is over, and whoever shows
                it has to show another.
        """
        code = self._draw(18)
        with self._lock:
            while len(self._open) >= MAX_CODES:
                self._open.pop(next(iter(self._open)))
            until_s = self._clock() + CODE_LASTS_S
            self._open[digest(code)] = _Open(grant, self._draw(16), until_s, after)
        return code

    def redeem(self, code: str, device: str) -> Redeemed | None:
        """Use a code up; None when it is none.

        Args:
            code: As it was shown.
            device: Digest of the id that the device made for itself.

        Raises:
            CodeRefused: It was used by another device, or is too old.
        """
        now_s = self._clock()
        with self._lock:
            found = self._open.get(digest(code))
            if found is None:
                return None
            if found.used_by is not None:
                if found.used_by == device and now_s < found.until_s:
                    return Redeemed(found.grant, found.salt)
                raise CodeRefused(
                    "This link was used before; each pairs one device. Scan the newest code that "
                    "the server or a paired device shows."
                )
            over = now_s >= found.until_s
            found.used_by = device
            found.until_s = 0.0 if over else now_s + ANSWERED_AGAIN_S
        found.after()
        if over:
            raise CodeRefused(
                "This link has expired: it is good for ten minutes. Scan the newest code that the "
                "server or a paired device shows."
            )
        return Redeemed(found.grant, found.salt)


def digest(secret: str) -> str:
    """Return what is kept of a secret. All of them are random and long, so no salt is needed."""
    return hashlib.sha256(secret.encode()).hexdigest()
