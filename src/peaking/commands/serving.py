"""What the commands that serve have in common."""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import stat
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.terminal import say

if TYPE_CHECKING:
    import ssl
    from collections.abc import Callable, Sequence

    from peaking.server.devices import Devices
    from peaking.server.server_certificate import ServerCertificate

EVERY_ADDRESS = ("0.0.0.0", "::")
MAX_PORT = 65535
RENEWAL_LOOKED_AT_EVERY_S = 60.0
TOKEN_VARIABLE = "PEAKING_TOKEN"
MIN_TOKEN_CHARS = 16
MIN_VARIETY = 8
"""Of a token: different characters, and different steps from one to the next."""
COMMON_WORDS = ("password", "passwort", "peaking", "secret", "token", "qwert", "12345", "letmein")
MAKE_ONE = "make one with: python3 -c 'import secrets; print(secrets.token_urlsafe(24))'"


def check_port(port: int) -> None:
    """Refuse a number that is no port.

    Raises:
        ArgumentError: It is not in 0..65535.
    """
    if not 0 <= port <= MAX_PORT:
        raise ArgumentError(f"need --port of 0..{MAX_PORT}, got {port}")


def check_training_steps(steps: int) -> None:
    """Refuse a training without steps.

    Raises:
        ArgumentError: It has none.
    """
    if steps < 1:
        raise ArgumentError(f"need --training-steps of at least 1, got {steps}")


def https_origins(host: str, port: int) -> tuple[list[str], ssl.SSLContext]:
    """Return the addresses at which the local network reaches this machine, and their certificate.

    The certificate is renewed while the program runs.

    Raises:
        OutputError: The certificate authority cannot be stored.
    """
    from peaking.server.certificates import config_folder, lan_addresses, open_authority
    from peaking.server.server_certificate import ServerCertificate

    every = host in EVERY_ADDRESS
    hosts = [] if every else [host]
    with checked_arguments():
        authority = open_authority(config_folder(), hosts=hosts)
    for remark in authority.remarks:
        say(f"Note: {remark}", problem=True)
    certificate = ServerCertificate(authority, hosts)
    addresses = lan_addresses() if every else hosts
    for address in addresses:
        if not authority.permits(address):
            say(
                f"Note: {address} is not a private address; to serve there, give --host {address}",
                problem=True,
            )
    threading.Thread(target=_renew, args=[certificate], daemon=True).start()
    served = [a for a in addresses if authority.permits(a)] or ["localhost"]
    return [f"https://{f'[{a}]' if ':' in a else a}:{port}" for a in served], certificate.context


def _renew(certificate: ServerCertificate) -> None:
    while True:
        time.sleep(RENEWAL_LOOKED_AT_EVERY_S)
        with contextlib.suppress(OSError):  # the disk was full: tried again
            certificate.renew_when_due()


def keep_private() -> None:
    """Let nobody but the owner read what this process writes from now on."""
    os.umask(0o077)


def say_skipped(problem: str) -> None:
    """Report a session that cannot be opened."""
    say(f"skipped: {problem}", problem=True)


def preparation_said(reachable: threading.Event) -> Callable[[float], None]:
    """Return what says how far a first start is, tenth by tenth; of others it says nothing.

    Args:
        reachable: Set when it has been said how to reach the server: that comes first.
    """
    next_tenth = 0

    def say_share(share: float) -> None:
        nonlocal next_tenth
        if not reachable.is_set():
            return
        if share == 1.0 and next_tenth > 0:
            say("Ready: views can be taken.")
        elif share < 1.0 and int(10 * share) >= next_tenth:
            next_tenth = int(10 * share) + 1
            say(f"Compiling, on the first start only: {10 * int(10 * share)} %")

    return say_share


def fixed_token(file: Path | None) -> str | None:
    """Return the fixed secret of a file or of the environment; None when there is none.

    It is taken out of the environment, so that programs that are started from here do not get it.

    Raises:
        ArgumentError: It cannot be read, others can read it, or it is easy to guess.
    """
    said = os.environ.pop(TOKEN_VARIABLE, None)
    source = TOKEN_VARIABLE
    if file is not None:
        source = f"--token-file {file}"
        try:
            with file.open("rb") as opened:
                found = os.fstat(opened.fileno())
                if stat.S_ISREG(found.st_mode) and found.st_mode & 0o077:
                    raise ArgumentError(f"{source}: other users can read it; run: chmod 600 {file}")
                said = opened.read(10_000).decode("ascii").strip()
        except OSError as error:
            raise ArgumentError(f"{source}: cannot be read ({error.strerror})") from error
        except UnicodeDecodeError:
            said = ""
    if said is not None and not _hard_to_guess(said):
        raise ArgumentError(
            f"{source}: need a token of {MIN_TOKEN_CHARS} … 200 random letters and digits, in one "
            f"line; {MAKE_ONE}"
        )
    return said


def _hard_to_guess(token: str) -> bool:
    """Return whether a token looks random: long, varied, no row and nothing repeated."""
    steps = {ord(b) - ord(a) for a, b in itertools.pairwise(token)}
    plain = token.lower()
    return (
        MIN_TOKEN_CHARS <= len(token) <= 200
        and token.isascii()
        and token.isprintable()
        and " " not in token
        and min(len(set(token)), len(steps)) >= MIN_VARIETY
        and (token + token).find(token, 1) == len(token)
        and not any(word in plain for word in COMMON_WORDS)
    )


class Invitation:
    """A link in the terminal that pairs one device; when it is over, the next one is shown."""

    def __init__(
        self, devices: Devices, pages: Sequence[str], *, what: str, qr: bool = True
    ) -> None:
        """Show nothing yet.

        Args:
            devices: Knows the codes.
            pages: What a device opens, the best address first.
            what: What the next device is called.
            qr: Show a QR code too.
        """
        self._devices = devices
        self._pages = pages
        self._what = what
        self._qr = qr

    def show(self) -> None:
        """Show all links and the QR code."""
        links = self._links()
        self._show_code(links[0])
        for link in links:
            say(f"  {link}")

    def _show_next(self) -> None:
        links = self._links()
        self._show_code(links[0])
        say(f"For another {self._what} (the link before is used up):  {links[0]}")

    def _links(self) -> list[str]:
        from peaking.server.device_routes import pairing_link

        usual = self._devices.usual
        return pairing_link(self._devices, self._pages, usual, after=self._show_next).links

    def _show_code(self, link: str) -> None:
        import segno

        if self._qr:
            code = io.StringIO()
            segno.make(link, error="m").terminal(code, compact=True)
            sys.stdout.write(code.getvalue())  # in one piece, whoever else says something
