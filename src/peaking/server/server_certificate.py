"""The server's own certificate: short, for this machine's names, and renewed while it runs."""

from __future__ import annotations

import datetime
import os
import ssl
import tempfile
import time
from collections.abc import Callable, Sequence

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from peaking.server.certificates import (
    CLOCKS_DIFFER,
    DAY,
    Authority,
    authority_key_id,
    general_name,
    key_usage,
    lan_addresses,
    machine_names,
)

LASTS = 90 * DAY
"""Browsers accept 398 days at most."""
RENEWED_AFTER = 30 * DAY


class ServerCertificate:
    """What a server shows in handshakes, made anew in time and when addresses change."""

    def __init__(
        self,
        authority: Authority,
        hosts: Sequence[str] = (),
        *,
        addresses: Callable[[], Sequence[str]] = lan_addresses,
        clock: Callable[[], float] = time.time,
    ) -> None:
        """Make one for this machine's names and addresses, and for `hosts`."""
        self._authority = authority
        self._hosts = tuple(hosts)
        self._addresses = addresses
        self._clock = clock
        self._newest: ssl.SSLContext | None = None
        self._make(self._names())
        # A handshake takes whatever is the newest: what was begun with another goes on with it.
        self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self._load(self.context)
        self.context.sni_callback = self._choose

    @property
    def names(self) -> tuple[str, ...]:
        """Names and addresses that it is for."""
        return self._named

    def renew_when_due(self) -> bool:
        """Make it anew if it is old, or the machine has other addresses; return whether it was.

        It asks the system for addresses, which may take a while: not to be called on an event loop.
        """
        names = self._names()
        if names == self._named and self._time() < self._made + RENEWED_AFTER:
            return False
        self._make(names)
        newest = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self._load(newest)
        self._newest = newest
        return True

    def _time(self) -> datetime.datetime:
        return datetime.datetime.fromtimestamp(self._clock(), datetime.UTC)

    def _names(self) -> tuple[str, ...]:
        found = [*self._hosts, *self._addresses(), "localhost", "127.0.0.1", "::1"]
        found += machine_names()
        return tuple(name for name in dict.fromkeys(found) if self._authority.permits(name))

    def _make(self, names: tuple[str, ...]) -> None:
        now = self._time()
        key = ec.generate_private_key(ec.SECP256R1())
        signer = self._authority.certificate
        built = (
            x509.CertificateBuilder()
            .subject_name(x509.Name([x509.NameAttribute(NameOID.ORGANIZATION_NAME, "peaking")]))
            .issuer_name(signer.subject)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(max(now - CLOCKS_DIFFER, signer.not_valid_before_utc))
            .not_valid_after(min(now + LASTS, signer.not_valid_after_utc))
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(
                x509.SubjectAlternativeName([general_name(n) for n in names]), critical=False
            )
            .add_extension(key_usage(signs_certificates=False), critical=True)
            .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
            .add_extension(
                x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False
            )
            .add_extension(authority_key_id(self._authority), critical=False)
            .sign(self._authority.key, hashes.SHA256())
        )
        self._pem = key.private_bytes(
            Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()
        ) + built.public_bytes(Encoding.PEM)
        self.certificate = built
        self._named = names
        self._made = now

    def _load(self, context: ssl.SSLContext) -> None:
        """Hand it to OpenSSL, which takes it from a file only."""
        descriptor, path = tempfile.mkstemp(prefix="peaking-", suffix=".pem")  # mode 0600
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(self._pem)
            context.load_cert_chain(path)
        finally:
            os.unlink(path)  # noqa: PTH108  it is gone at once

    def _choose(self, connection: object, _name: str | None, _context: ssl.SSLContext) -> None:
        if self._newest is not None and isinstance(connection, ssl.SSLObject | ssl.SSLSocket):
            connection.context = self._newest
