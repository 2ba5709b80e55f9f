"""A private certificate authority, so that phones get the secure context that WebXR needs.

The authority is made once and kept, with its key, in the user's configuration folder; a phone that
installed it trusts this server from then on. It can vouch for private addresses, this machine's
names and what `--host` named, for five years, and for nothing else: whoever steals its key cannot
pass for a site of the internet. A name in it stands for all names that end in it, so a bare one
(`dev`, `app`) would be a whole domain of the internet: such a computer is served as `dev.local` and
by its addresses. The server's own certificate (`server_certificate.py`) is made anew
at every start.
"""

from __future__ import annotations

import contextlib
import datetime
import fcntl
import ipaddress
import os
import socket
import stat
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import NameOID

from peaking.errors import OutputError
from peaking.output import write_atomically

AUTHORITY = "peaking-ca"
YEARS = 5
DAY = datetime.timedelta(days=1)
AUTHORITY_LASTS = YEARS * 365 * DAY
RENEWED_BEFORE_END = 60 * DAY
"""An authority that ends sooner is replaced at the next start."""
CLOCKS_DIFFER = DAY
"""Certificates are valid from so long ago: a phone's clock may be late."""

PRIVATE_NETWORKS = (
    "10.0.0.0/8",
    "172.16.0.0/12",
    "192.168.0.0/16",
    "127.0.0.0/8",
    "169.254.0.0/16",
    "fc00::/7",
    "fe80::/10",
    "::1/128",
)
PRIVATE_NAMES = ("localhost", "local")
"""With all names that end in them: `kitchen.local` too."""

INSTALL_AGAIN = "install the new one on phones and computers that had it, and remove the old one"


def config_folder() -> Path:
    """Return where the authority is kept."""
    base = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    return Path(base) / "peaking"


@dataclass(frozen=True)
class Authority:
    """A certificate authority and its key.

    Attributes:
        certificate: What phones install.
        key: What signs.
        remarks: Sentences that its owner has to know: that it was replaced, or could be read.
    """

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey
    remarks: tuple[str, ...] = field(default=())

    def permits(self, name: str) -> bool:
        """Return whether it can vouch for a name or an address."""
        wanted = general_name(name)
        return any(_lies_in(wanted, permitted) for permitted in _permitted(self.certificate))


def open_authority(
    folder: Path, *, hosts: Sequence[str] = (), clock: Callable[[], float] = time.time
) -> Authority:
    """Return the authority of a folder, made when there is none that can be used.

    One that ends soon, vouches for more than is served, or cannot vouch for `hosts` is replaced,
    and its `remarks` say so. A key that others could read is made private.

    Args:
        folder: Where it is kept; made with mode 0700.
        hosts: Names or addresses that it has to vouch for, beside the private ones.
        clock: Seconds since 1970.

    Raises:
        ValueError: One of `hosts` is neither, or a name without a dot.
        OutputError: It cannot be stored.
    """
    for host in hosts:
        if is_bare(host):
            raise ValueError(
                f"need an address or a name with a dot ({host or 'this'}.local), got {host!r}: the "
                "authority would vouch for every name that ends in it"
            )
    now = datetime.datetime.fromtimestamp(clock(), datetime.UTC)
    certificate, key = folder / f"{AUTHORITY}.pem", folder / f"{AUTHORITY}.key"
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with _locked(folder / f".{AUTHORITY}.lock"):
            remarks = _made_private(key)
            found, problem = _read(certificate, key, hosts, now)
            if found is not None:
                return Authority(found.certificate, found.key, remarks)
            if problem is not None:
                remarks += (f"{certificate}: {problem}. It was replaced: {INSTALL_AGAIN}.",)
            made = _make([*hosts, *_already_permitted(certificate)], now)
            _write_private(key, _pem_of(made.key))
            write_atomically(certificate, made.certificate.public_bytes(Encoding.PEM))
            return Authority(made.certificate, made.key, remarks)
    except OSError as error:
        raise OutputError(
            f"{folder}: the certificate authority cannot be kept there ({error.strerror}); set "
            "XDG_CONFIG_HOME to a folder that you may write to"
        ) from error


def general_name(name: str) -> x509.DNSName | x509.IPAddress:
    """Return a name or an address as certificates have it.

    Raises:
        ValueError: It is neither.
    """
    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        pass
    try:
        return x509.DNSName(name.lower().encode("idna").decode("ascii"))
    except UnicodeError:
        raise ValueError(f"need a host name or an address, got {name!r}") from None


def is_bare(name: str) -> bool:
    """Return whether a name is without a dot, as top-level domains are, and not private."""
    found = general_name(name)
    if isinstance(found, x509.IPAddress) or found.value in PRIVATE_NAMES:
        return False
    return "." not in found.value.strip(".")


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


def machine_names() -> list[str]:
    """Return the names of this machine that certificates can hold, without bare ones."""
    own = socket.gethostname()
    names = [own, own if own.endswith(".local") else f"{own.split('.')[0]}.local"]
    kept: list[str] = []
    for name in names:
        with contextlib.suppress(ValueError):
            kept += [] if is_bare(name) else [name]
    return kept


def authority_key_id(authority: Authority) -> x509.AuthorityKeyIdentifier:
    """Return how certificates name the authority that signed them."""
    own = authority.certificate.extensions.get_extension_for_class(x509.SubjectKeyIdentifier)
    return x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(own.value)


def key_usage(*, signs_certificates: bool) -> x509.KeyUsage:
    """Return what a key is for: to sign certificates, or handshakes."""
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        encipher_only=False,
        decipher_only=False,
    )


def _make(names: Sequence[str], now: datetime.datetime) -> Authority:
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name(
        [
            x509.NameAttribute(NameOID.ORGANIZATION_NAME, "peaking"),
            x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, socket.gethostname()[:64]),
            x509.NameAttribute(NameOID.COMMON_NAME, f"peaking on {socket.gethostname()}"[:64]),
        ]
    )
    own = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
    certificate = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - CLOCKS_DIFFER)
        .not_valid_after(now + AUTHORITY_LASTS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(x509.NameConstraints(_constraints(names), None), critical=True)
        .add_extension(key_usage(signs_certificates=True), critical=True)
        .add_extension(own, critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(own), critical=False
        )
        .sign(key, hashes.SHA256())
    )
    return Authority(certificate, key)


def _constraints(names: Sequence[str]) -> list[x509.GeneralName]:
    """Return what an authority vouches for: what is private, this machine and `names`."""
    permitted: list[x509.GeneralName] = [
        *(x509.IPAddress(ipaddress.ip_network(network)) for network in PRIVATE_NETWORKS),
        *(x509.DNSName(name) for name in PRIVATE_NAMES),
    ]
    for name in [*machine_names(), *names]:
        found = general_name(name)
        if not any(_lies_in(found, one) for one in permitted):
            if isinstance(found, x509.IPAddress):
                found = x509.IPAddress(ipaddress.ip_network(found.value))
            permitted.append(found)
    return permitted


def _read(
    certificate: Path, key: Path, hosts: Sequence[str], now: datetime.datetime
) -> tuple[Authority | None, str | None]:
    """Return the authority of two files, or why it cannot be used; nothing where there is none."""
    if not certificate.exists():
        return None, None
    try:
        read = x509.load_pem_x509_certificate(certificate.read_bytes())
        signs = load_pem_private_key(key.read_bytes(), password=None)
    except (ValueError, TypeError, FileNotFoundError):
        return None, "the authority or its key is damaged"
    if not isinstance(signs, ec.EllipticCurvePrivateKey) or signs.public_key() != read.public_key():
        return None, "the authority and its key do not belong together"
    found = Authority(read, signs)
    if read.not_valid_after_utc > now + AUTHORITY_LASTS + DAY:
        return None, f"the authority was made to last longer than {YEARS} years"
    permitted = _permitted(read)
    if not permitted:
        return None, "the authority could vouch for every site of the internet"
    meant = _constraints([*hosts, *_hosts_of(read)])
    if wider := [str(one.value) for one in permitted if not any(_lies_in(one, m) for m in meant)]:
        return None, f"the authority could vouch for more than is served: {', '.join(wider)}"
    if not read.not_valid_before_utc <= now <= read.not_valid_after_utc - RENEWED_BEFORE_END:
        return None, "the authority ends soon"
    missing = [name for name in hosts if not found.permits(name)]
    if missing:
        return None, f"the authority cannot vouch for {', '.join(missing)}"
    return found, None


def _permitted(certificate: x509.Certificate) -> list[x509.GeneralName]:
    """Return what an authority is restricted to; nothing when it is not restricted."""
    try:
        extensions = certificate.extensions
        limits = extensions.get_extension_for_class(x509.NameConstraints)
        basic = extensions.get_extension_for_class(x509.BasicConstraints)
    except (ValueError, x509.ExtensionNotFound, x509.DuplicateExtension):
        return []
    permitted = list(limits.value.permitted_subtrees or ())
    both = {type(one) for one in permitted} >= {x509.DNSName, x509.IPAddress}
    return permitted if limits.critical and both and basic.value.path_length == 0 else []


def _already_permitted(certificate: Path) -> list[str]:
    """Return the single hosts that the authority before vouched for: they stay served."""
    try:
        return _hosts_of(x509.load_pem_x509_certificate(certificate.read_bytes()))
    except (ValueError, OSError):
        return []


def _hosts_of(certificate: x509.Certificate) -> list[str]:
    """Return the single hosts among what an authority vouches for."""
    names: list[str] = []
    for one in _permitted(certificate):
        if isinstance(one, x509.DNSName):
            with contextlib.suppress(ValueError):
                names += [] if is_bare(one.value) else [one.value]
        elif isinstance(one, x509.IPAddress):
            network = ipaddress.ip_network(str(one.value))
            names += [str(network.network_address)] if network.num_addresses == 1 else []
    return names


def _lies_in(name: x509.GeneralName, permitted: x509.GeneralName) -> bool:
    match name, permitted:
        case x509.DNSName(), x509.DNSName():
            inner, outer = name.value.lower(), permitted.value.lower()
            return inner == outer or inner.endswith("." + outer)
        case x509.IPAddress(), x509.IPAddress():
            inner, outer = (ipaddress.ip_network(str(one.value)) for one in (name, permitted))
            return inner.network_address in outer and inner.broadcast_address in outer
        case _:
            return False


def _made_private(key: Path) -> tuple[str, ...]:
    """Take from others what lets them read a key; return a remark when there was something."""
    try:
        mode = stat.S_IMODE(key.stat().st_mode)
    except FileNotFoundError:
        return ()
    if not mode & 0o077:
        return ()
    key.chmod(0o600)
    return (
        f"{key}: other users of this computer could read the key (mode {mode:04o}). It is private "
        "now; if you do not trust them, delete it, start again, and install the new authority.",
    )


def _pem_of(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def _write_private(path: Path, data: bytes) -> None:
    """Write a file that nobody else can read, from its first byte, in one step."""
    partial = path.with_name(f".{path.name}.partial")
    partial.unlink(missing_ok=True)
    descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(descriptor)
    partial.replace(path)


@contextlib.contextmanager
def _locked(path: Path) -> Generator[None, None, None]:
    """Let one process at a time make an authority."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
