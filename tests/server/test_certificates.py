"""The private authority and the server's certificate, as OpenSSL and Python judge them."""

from __future__ import annotations

import datetime
import ipaddress
import os
import shutil
import socket
import ssl
import stat
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from patience import PATIENCE_S
from peaking.errors import OutputError
from peaking.server import certificates
from peaking.server.certificates import (
    DAY,
    Authority,
    authority_key_id,
    general_name,
    lan_addresses,
    open_authority,
)
from peaking.server.server_certificate import ServerCertificate

NOW = datetime.datetime.now(datetime.UTC)


def signed_by(authority: Authority, names: Sequence[x509.GeneralName]) -> Any:
    """Return what a thief of the key would sign."""
    key = ec.generate_private_key(ec.SECP256R1())
    return (
        x509.CertificateBuilder()
        .subject_name(x509.Name([x509.NameAttribute(NameOID.ORGANIZATION_NAME, "thief")]))
        .issuer_name(authority.certificate.subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(NOW - DAY)
        .not_valid_after(NOW + DAY)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(authority_key_id(authority), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(authority.key, hashes.SHA256())
    )


def verifies(folder: Path, certificate: Any) -> bool:
    """Ask the openssl program whether the authority of a folder vouches for a certificate."""
    openssl = shutil.which("openssl")
    assert openssl
    shown = folder / "shown.pem"
    shown.write_bytes(certificate.public_bytes(Encoding.PEM))
    asked = [openssl, "verify", "-x509_strict", "-purpose", "sslserver"]
    asked += ["-CAfile", str(folder / "peaking-ca.pem"), str(shown)]
    done = subprocess.run(asked, capture_output=True, text=True, check=False)
    return done.returncode == 0


@pytest.mark.parametrize(
    ("name", "good"),
    [
        ("192.168.1.7", True),
        ("10.1.2.3", True),
        ("172.31.0.1", True),
        ("172.32.0.1", False),
        ("169.254.3.4", True),
        ("127.0.0.1", True),
        ("::1", True),
        ("fd12::1", True),
        ("fe80::1", True),
        ("8.8.8.8", False),
        ("2001:db8::1", False),
        ("localhost", True),
        ("kitchen.local", True),
        ("bank.example", False),
        ("notlocalhost", False),
        ("mylocal", False),
        ("local.example", False),
    ],
)
def test_the_authority_vouches_for_what_is_served_and_nothing_else(
    tmp_path: Path, name: str, good: bool
) -> None:
    authority = open_authority(tmp_path)
    assert authority.permits(name) == good
    assert verifies(tmp_path, signed_by(authority, [general_name(name)])) == good


def test_a_stolen_key_makes_no_authorities(tmp_path: Path) -> None:
    authority = open_authority(tmp_path)
    limits = authority.certificate.extensions.get_extension_for_class(x509.BasicConstraints)
    assert (limits.critical, limits.value.ca, limits.value.path_length) == (True, True, 0)
    usage = authority.certificate.extensions.get_extension_for_class(x509.KeyUsage).value
    assert (usage.key_cert_sign, usage.digital_signature) == (True, False)
    lasts = authority.certificate.not_valid_after_utc - NOW
    assert lasts < datetime.timedelta(days=5 * 366)


def test_the_servers_certificate_is_short_and_for_servers_only(tmp_path: Path) -> None:
    authority = open_authority(tmp_path)
    made = ServerCertificate(authority, addresses=lambda: ["192.168.1.7", "2001:db8::1"])
    leaf = made.certificate
    assert verifies(tmp_path, leaf)
    assert leaf.not_valid_after_utc - leaf.not_valid_before_utc <= datetime.timedelta(days=398)
    extensions = leaf.extensions
    uses = extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(uses) == [ExtendedKeyUsageOID.SERVER_AUTH]
    names = extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    addresses = {str(a) for a in names.get_values_for_type(x509.IPAddress)}
    assert addresses == {"192.168.1.7", "127.0.0.1", "::1"}  # the public one is not promised
    assert "localhost" in names.get_values_for_type(x509.DNSName)
    own = extensions.get_extension_for_class(x509.AuthorityKeyIdentifier).value
    its = authority.certificate.extensions.get_extension_for_class(x509.SubjectKeyIdentifier)
    assert own.key_identifier == its.value.digest


def test_the_authority_is_kept_and_its_key_is_private_from_its_first_byte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "peaking"
    modes: list[int] = []
    real_open = os.open

    def watched(path: Any, flags: int, mode: int = 0o777, **more: Any) -> int:
        descriptor = real_open(path, flags, mode, **more)
        if ".key" in str(path):
            modes.append(stat.S_IMODE(os.fstat(descriptor).st_mode))
        return descriptor

    before = os.umask(0)
    monkeypatch.setattr(os, "open", watched)
    try:
        first = open_authority(folder)
    finally:
        os.umask(before)
    assert modes == [0o600]
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    again = open_authority(folder)
    assert (again.certificate, again.remarks) == (first.certificate, ())
    key = folder / "peaking-ca.key"
    key.chmod(0o644)
    mended = open_authority(folder)
    assert mended.certificate == first.certificate
    assert "could read the key" in mended.remarks[0]
    assert stat.S_IMODE(key.stat().st_mode) == 0o600


@pytest.mark.parametrize("damage", ["old kind", "garbled", "no key", "another key", "nearly over"])
def test_what_cannot_be_used_is_replaced_and_it_is_said(tmp_path: Path, damage: str) -> None:
    certificate, key = tmp_path / "peaking-ca.pem", tmp_path / "peaking-ca.key"
    first = open_authority(tmp_path)
    now = NOW
    match damage:
        case "old kind":
            certificate.write_bytes(old_authority(first.key))
        case "garbled":
            certificate.write_bytes(b"-----BEGIN CERTIFICATE-----\n\x00")
        case "no key":
            key.unlink()
        case "another key":
            open_authority(tmp_path / "other")
            key.write_bytes((tmp_path / "other" / "peaking-ca.key").read_bytes())
        case _:
            now = NOW + datetime.timedelta(days=5 * 365 - 10)
    made = open_authority(tmp_path, clock=now.timestamp)
    assert made.certificate != first.certificate
    assert "install the new one" in made.remarks[-1]
    assert open_authority(tmp_path, clock=now.timestamp).remarks == ()


def old_authority(key: ec.EllipticCurvePrivateKey) -> bytes:
    """Return an authority without limits, valid until 3000, as earlier versions made it."""
    name = x509.Name([x509.NameAttribute(NameOID.ORGANIZATION_NAME, "peaking")])
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(datetime.datetime(2000, 1, 1))
        .not_valid_after(datetime.datetime(3000, 1, 1))
        .add_extension(x509.BasicConstraints(ca=True, path_length=9), critical=True)
        .sign(key, hashes.SHA256())
    )
    return made.public_bytes(Encoding.PEM)


@pytest.mark.parametrize("name", ["dev", "app", "zip", "Box", "cloud."])
def test_a_computers_bare_name_is_no_domain_of_the_internet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(socket, "gethostname", lambda: name)
    authority = open_authority(tmp_path)
    domain = name.strip(".").lower()
    for site in (f"web.{domain}", domain):
        assert not authority.permits(site)
        assert not verifies(tmp_path, signed_by(authority, [general_name(site)]))
    served = ServerCertificate(authority)
    assert f"{name.split('.')[0]}.local" in served.names
    assert verifies(tmp_path, served.certificate)
    assert open_authority(tmp_path).remarks == ()


@pytest.mark.parametrize("name", ["dev", "com", "com.", ""])
def test_a_bare_name_is_no_host(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match="need an address or a name with a dot"):
        open_authority(tmp_path, hosts=[name])
    open_authority(tmp_path, hosts=["localhost", "127.0.0.1", "fe80::1", "dev.local"])


@pytest.mark.parametrize(
    "wider",
    [
        x509.IPAddress(ipaddress.ip_network("0.0.0.0/0")),
        x509.IPAddress(ipaddress.ip_network("::/0")),
        x509.IPAddress(ipaddress.ip_network("8.8.8.0/31")),
        x509.IPAddress(ipaddress.ip_network("192.0.0.0/8")),
        *map(x509.DNSName, ["com", "", ".com", "com.", "DEV"]),
        x509.RFC822Name("example.com"),
    ],
    ids=lambda one: str(one.value),
)
def test_an_authority_that_vouches_for_more_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wider: x509.GeneralName
) -> None:
    meant = certificates._constraints

    def wide_constraints(names: Sequence[str]) -> list[x509.GeneralName]:
        return [*meant(names), wider]

    with monkeypatch.context() as patch:
        patch.setattr(certificates, "_constraints", wide_constraints)
        wide = open_authority(tmp_path)
    made = open_authority(tmp_path)
    assert made.certificate != wide.certificate
    assert "more than is served" in made.remarks[0]
    assert wider not in certificates._permitted(made.certificate)
    assert open_authority(tmp_path).remarks == ()


def test_another_name_of_the_computer_needs_no_new_authority(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("desk.lab.example", "lab.example", "desk", "desk.local", "desk.lab.example"):
        monkeypatch.setattr(socket, "gethostname", lambda: name)  # noqa: B023
        assert open_authority(tmp_path).remarks == ()


def test_what_host_names_is_vouched_for_and_stays(tmp_path: Path) -> None:
    first = open_authority(tmp_path)
    assert not first.permits("8.8.8.8")
    named = open_authority(tmp_path, hosts=["8.8.8.8", "studio.example"])
    assert "cannot vouch for 8.8.8.8, studio.example" in named.remarks[0]
    assert named.permits("8.8.8.8")
    assert not named.permits("8.8.8.9")
    assert named.permits("studio.example")
    other = open_authority(tmp_path, hosts=["9.9.9.9"])
    assert other.permits("8.8.8.8")  # going back and forth needs no new authority
    assert open_authority(tmp_path, hosts=["8.8.8.8"]).remarks == ()
    assert verifies(tmp_path, ServerCertificate(other, ["9.9.9.9"]).certificate)


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be kept there"):
        open_authority(tmp_path / "file" / "peaking")


def handshake(context: ssl.SSLContext, trusts: ssl.SSLContext, name: str) -> bytes:
    """Return the certificate that a server shows to a client that checks it."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            with listener.accept()[0] as raw, context.wrap_socket(raw, server_side=True) as own:
                own.recv(1)

        server = threading.Thread(target=serve)
        server.start()
        with (
            socket.create_connection(listener.getsockname()) as raw,
            trusts.wrap_socket(raw, server_hostname=name) as own,
        ):
            shown = own.getpeercert(binary_form=True)
            own.send(b".")
        server.join(PATIENCE_S)
    assert shown
    return shown


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1"])  # with an address there is no SNI
def test_a_running_server_renews_its_certificate(tmp_path: Path, name: str) -> None:
    authority = open_authority(tmp_path)
    trusts = ssl.create_default_context(cafile=str(tmp_path / "peaking-ca.pem"))
    clock, addresses = [NOW], ["192.168.1.7"]
    own = ServerCertificate(
        authority, addresses=lambda: list(addresses), clock=lambda: clock[0].timestamp()
    )
    first = handshake(own.context, trusts, name)
    assert not own.renew_when_due()
    assert handshake(own.context, trusts, name) == first
    addresses.append("192.168.1.8")
    assert own.renew_when_due()
    second = handshake(own.context, trusts, name)
    assert second != first
    assert "192.168.1.8" in own.names
    clock[0] += datetime.timedelta(days=31)
    assert own.renew_when_due()
    assert own.certificate.not_valid_after_utc > NOW + datetime.timedelta(days=120)
    assert not own.renew_when_due()


def test_lan_addresses_are_no_loopback() -> None:
    assert not any(a.startswith("127.") or a == "::1" for a in lan_addresses())
