"""What the commands that serve have in common."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from typing import TYPE_CHECKING

from peaking.commands.arguments import ArgumentError, checked_arguments

if TYPE_CHECKING:
    import ssl

    from peaking.server.server_certificate import ServerCertificate

EVERY_ADDRESS = ("0.0.0.0", "::")
MAX_PORT = 65535
RENEWAL_LOOKED_AT_EVERY_S = 60.0


def check_port(port: int) -> None:
    """Refuse a number that is no port.

    Raises:
        ArgumentError: It is not in 0..65535.
    """
    if not 0 <= port <= MAX_PORT:
        raise ArgumentError(f"need --port of 0..{MAX_PORT}, got {port}")


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
        print(f"Note: {remark}", file=sys.stderr)
    certificate = ServerCertificate(authority, hosts)
    addresses = lan_addresses() if every else hosts
    for address in addresses:
        if not authority.permits(address):
            print(
                f"Note: {address} is not a private address; to serve there, give --host {address}",
                file=sys.stderr,
            )
    threading.Thread(target=_renew, args=[certificate], daemon=True).start()
    served = [a for a in addresses if authority.permits(a)] or ["localhost"]
    return [f"https://{f'[{a}]' if ':' in a else a}:{port}" for a in served], certificate.context


def _renew(certificate: ServerCertificate) -> None:
    while True:
        time.sleep(RENEWAL_LOOKED_AT_EVERY_S)
        with contextlib.suppress(OSError):  # the disk was full: tried again
            certificate.renew_when_due()


def say_skipped(problem: str) -> None:
    """Report a session that cannot be opened."""
    print(f"skipped: {problem}", file=sys.stderr)
