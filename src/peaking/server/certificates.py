"""A private certificate authority, so that phones get the secure context that WebXR needs.

The authority is made once and kept, with its key, in the user's configuration folder; a phone that
installed it trusts this server from then on. The server's own certificate carries all addresses
of this machine and is made anew at every start.
"""

# trustme is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import ipaddress
import os
import socket
import ssl
from collections.abc import Sequence
from pathlib import Path

import trustme

AUTHORITY = "peaking-ca"


def config_folder() -> Path:
    """Return where the authority is kept."""
    base = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    return Path(base) / "peaking"


def authority(folder: Path) -> trustme.CA:
    """Return the authority of a folder, made when there is none."""
    certificate, key = folder / f"{AUTHORITY}.pem", folder / f"{AUTHORITY}.key"
    if certificate.is_file() and key.is_file():
        return trustme.CA.from_pem(certificate.read_bytes(), key.read_bytes())
    made = trustme.CA(organization_name="peaking", organization_unit_name=socket.gethostname())
    folder.mkdir(parents=True, exist_ok=True)
    _write_private(key, made.private_key_pem.bytes())
    certificate.write_bytes(made.cert_pem.bytes())
    return made


def server_context(ca: trustme.CA, names: Sequence[str]) -> ssl.SSLContext:
    """Return what a server at these names and addresses needs."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    ca.issue_cert(*names).configure_cert(context)
    return context


def lan_addresses() -> list[str]:
    """Return the addresses at which other devices may reach this machine, likeliest first."""
    found: list[str] = []
    for family, beyond in ((socket.AF_INET, "192.0.2.1"), (socket.AF_INET6, "2001:db8::1")):
        # Nothing is sent: connecting a datagram socket only chooses the interface.
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            try:
                probe.connect((beyond, 9))
                found.append(probe.getsockname()[0])
            except OSError:
                continue
    try:
        infos = socket.getaddrinfo(socket.gethostname(), None, type=socket.SOCK_STREAM)
        found += [str(info[4][0]) for info in infos]
    except OSError:
        pass
    unique = dict.fromkeys(address.split("%")[0] for address in found)
    return [address for address in unique if not ipaddress.ip_address(address).is_loopback]


def _write_private(path: Path, data: bytes) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
