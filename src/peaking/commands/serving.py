"""What the commands that serve have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING

from peaking.commands.arguments import ArgumentError
from peaking.terminal import say

if TYPE_CHECKING:
    import ssl

EVERY_ADDRESS = ("0.0.0.0", "::")
MAX_PORT = 65535


def check_port(port: int) -> None:
    """Refuse a number that is no port.

    Raises:
        ArgumentError: It is not in 0..65535.
    """
    if not 0 <= port <= MAX_PORT:
        raise ArgumentError(f"need --port of 0..{MAX_PORT}, got {port}")


def https_origins(host: str, port: int) -> tuple[list[str], ssl.SSLContext]:
    """Return the addresses at which the local network reaches this machine, and their certificate.

    Raises:
        OutputError: The certificate authority cannot be stored.
    """
    import socket

    from peaking.server.certificates import authority, config_folder, lan_addresses, server_context

    addresses = lan_addresses() if host in EVERY_ADDRESS else [host]
    names = [*addresses, "localhost", "127.0.0.1", socket.gethostname()]
    context = server_context(authority(config_folder()), list(dict.fromkeys(names)))
    hosts = [f"[{a}]" if ":" in a else a for a in addresses] or ["localhost"]
    return [f"https://{name}:{port}" for name in hosts], context


def keep_private() -> None:
    """Let nobody but the owner read what this process writes from now on."""
    import os

    os.umask(0o077)


def say_skipped(problem: str) -> None:
    """Report a session that cannot be opened."""
    say(f"skipped: {problem}", problem=True)
