"""The devices that may use this server, each by a credential of its own.

A credential is random, and the server keeps only its digest, in `.peaking/devices.json` in the
folder of sessions. It ends after a week; one that is used when it is older than a day is replaced
by its successor. A successor follows from the credential and a salt that the server keeps, so that
it is the same however often its answer is lost, and yet nobody can make it from the file.

Another process (`peaking devices`) may revoke devices while a server runs: every change is made
under a lock of the file, and `refresh`, called every second, looks whether there was one. What a
request asks (`known`, `listening`) takes no lock and touches no file: it looks at what was read
last, which is replaced as a whole.
"""

from __future__ import annotations

import base64
import contextlib
import fcntl
import hmac
import os
import secrets
import threading
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path

import msgspec

from peaking.errors import OutputError
from peaking.foreign_json import decode_json
from peaking.output import check_folder, write_atomically
from peaking.server.guessing import Guesses
from peaking.server.pairing_codes import DEVICE, Grant, PairingCodes, Role, digest

FILE_NAME = "devices.json"
VERSION = 1
DAY_S = 24 * 3600.0
LASTS_S = 7 * DAY_S
RENEWED_AFTER_S = DAY_S
OVERLAP_S = 600.0
"""So long a credential is good after its successor was used: requests may be under way."""
MAX_DEVICES = 500
"""More are not kept: the one that was not seen for longest has to pair again."""
MAX_CREDENTIALS = 4
"""Of one device: those that were replaced are still good for a while."""
MAX_NAME = 80
SEEN_KEPT_EVERY_S = 60.0


class Credential(msgspec.Struct):
    """What is kept of a credential."""

    sha256: str
    made_s: float
    until_s: float
    salt: str = ""
    """Of its successor; empty while it has none."""


class Device(msgspec.Struct):
    """A device that is paired.

    Attributes:
        id: By which it is named in lists.
        key: Digest of the id that it made for itself.
        name: What it calls itself.
        role: What it may do.
        participants: Of a study: whose parts it may do.
        paired_s: When it was paired last, seconds since 1970.
        seen_s: When it asked last.
        credentials: Oldest first.
    """

    id: str
    key: str
    name: str
    role: Role
    participants: list[str]
    paired_s: float
    seen_s: float
    credentials: list[Credential]


class _File(msgspec.Struct):
    version: int
    server: str
    devices: list[Device]


@dataclass(frozen=True)
class Known:
    """Who a request comes from.

    Attributes:
        device: The device.
        renewal_due: Its credential should be replaced.
    """

    device: Device
    renewal_due: bool


class Devices:
    """The paired devices of one server; may be asked from any thread."""

    def __init__(
        self,
        folder: Path,
        *,
        usual: Grant = DEVICE,
        fixed_secret: str | None = None,
        clock: Callable[[], float] = time.time,
        draw: Callable[[int], str] = secrets.token_hex,
    ) -> None:
        """Read them; none when there is no file yet.

        Args:
            folder: Of sessions; made when it is not there, and `.peaking` in it.
            usual: What devices are paired for that are not a participant's.
            fixed_secret: Pairs any number of devices for that, for clients without a camera.
            clock: Seconds since 1970.
            draw: Returns so many random bytes, as hexadecimal digits.

        Raises:
            OutputError: The file is damaged or cannot be written.
        """
        self._path = folder / ".peaking" / FILE_NAME
        self._damaged = self._path.with_name(f"{FILE_NAME}.damaged")
        self._clock = clock
        self._draw = draw
        self._secret = None if fixed_secret is None else digest(fixed_secret)
        self.usual = usual
        self._lock = threading.RLock()
        self._listeners: dict[str, set[Callable[[], None]]] = {}
        self._seen: dict[str, float] = {}
        self._used: set[str] = set()
        self._seen_kept_s = clock()
        self.problems: list[str] = []
        self.codes = PairingCodes(clock=clock)
        self.guesses = Guesses()
        check_folder(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._path.parent.mkdir(exist_ok=True, mode=0o700)
            with self._changing():
                pass  # makes the server's id, and drops devices that are over
        except OSError as error:
            raise OutputError(
                f"{self._path}: cannot be written ({error.strerror}); give a folder that you may "
                "write to"
            ) from error

    @property
    def cookie(self) -> str:
        """Name of the cookie: browsers send a cookie to every server of a machine."""
        return f"peaking_{self._file.server}"

    def list(self) -> list[Device]:
        """Return all devices that may use the server, the one seen last first."""
        found = [
            msgspec.structs.replace(d, seen_s=max(d.seen_s, self._seen.get(d.id, 0.0)))
            for d in self._file.devices
        ]
        return sorted(found, key=lambda device: -device.seen_s)

    def pair(self, secret: str, *, device: str, name: str) -> tuple[Device, str] | None:
        """Pair a device; on the disk when this returns.

        Args:
            secret: A code, or the fixed secret.
            device: The id that the device made for itself.
            name: What it calls itself.

        Returns:
            The device and its credential; None when the secret is wrong.

        Raises:
            CodeRefused: It is a code that is over.
            OutputError: The device could not be written down.
        """
        key = digest(device)
        if self._secret is not None and hmac.compare_digest(digest(secret), self._secret):
            grant, salt = self.usual, self._draw(16)
        else:
            redeemed = self.codes.redeem(secret, key)
            if redeemed is None:
                return None
            grant, salt = redeemed.grant, redeemed.salt
        credential = _successor(secret, salt)
        now_s = self._clock()
        with self._changing() as file:
            found = next((one for one in file.devices if one.key == key), None)
            if found is None:
                found = Device(self._draw(8), key, "", grant.role, [], now_s, now_s, credentials=[])
                file.devices.append(found)
            said = "".join(letter for letter in name if letter.isprintable()).strip()
            found.name = said[:MAX_NAME] or "a device without a name"
            if found.role != grant.role:
                found.participants = []
            found.role = grant.role
            if grant.participant is not None and grant.participant not in found.participants:
                found.participants.append(grant.participant)
            found.paired_s = found.seen_s = now_s
            _add(found, credential, now_s)
            while len(file.devices) > MAX_DEVICES:
                file.devices.remove(min(file.devices, key=lambda one: one.seen_s))
        return found, credential

    def known(self, credential: str) -> Known | None:
        """Return whose credential this is; None for nobody's."""
        sha256 = digest(credential)
        found = self._by_digest.get(sha256)
        now_s = self._clock()
        if found is None or now_s >= found[1].until_s:
            return None
        device, kept = found
        self._seen[device.id] = now_s
        self._used.add(sha256)
        return Known(device, now_s >= kept.made_s + RENEWED_AFTER_S)

    def renew(self, credential: str) -> str | None:
        """Return the successor of a credential; on the disk when this returns.

        Raises:
            OutputError: It could not be written down.
        """
        found = self._by_digest.get(digest(credential))
        if found is None:
            return None
        if found[1].salt:
            return _successor(credential, found[1].salt)
        now_s = self._clock()
        with self._changing() as file:
            for device in file.devices:
                for kept in device.credentials:
                    if kept.sha256 == digest(credential):
                        kept.salt = kept.salt or self._draw(16)
                        made = _successor(credential, kept.salt)
                        _add(device, made, now_s)
                        return made
        return None

    def revoke(self, device_id: str) -> bool:
        """Pair a device no more, and end its streams; return whether there was one."""
        with self._changing() as file:
            before = len(file.devices)
            file.devices = [device for device in file.devices if device.id != device_id]
            return len(file.devices) < before

    def forget(self, participant: str) -> None:
        """Let no phone do the part of a participant any more, and keep no trace of them."""
        self._damaged.unlink(missing_ok=True)
        with self._changing() as file:
            for device in file.devices:
                device.participants = [one for one in device.participants if one != participant]
            file.devices = [
                device
                for device in file.devices
                if device.role != "participant" or device.participants
            ]

    @contextlib.contextmanager
    def listening(self, device_id: str, ended: Callable[[], None]) -> Generator[None, None, None]:
        """Call `ended`, in any thread, when the device is revoked while the block runs.

        To be used in one thread only, the event loop's.
        """
        self._listeners.setdefault(device_id, set()).add(ended)
        try:
            if all(device.id != device_id for device in self._file.devices):
                ended()  # revoked a moment ago
            yield
        finally:
            own = self._listeners[device_id]
            own.discard(ended)
            if not own:
                del self._listeners[device_id]

    def refresh(self) -> None:
        """Take over what another process changed, and write down now and then who was seen."""
        now_s = self._clock()
        if self._stamp() != self._read_stamp or (
            self._seen and now_s >= self._seen_kept_s + SEEN_KEPT_EVERY_S
        ):
            with self._changing():
                pass

    def close(self) -> None:
        """Write down who was seen."""
        if self._seen:
            with self._changing():
                pass

    @contextlib.contextmanager
    def _changing(self) -> Generator[_File, None, None]:
        """Yield the file's content, to be changed; it is written when the block ends well."""
        with self._lock, self._locked():
            before = self._read()
            file = decode_json(before, _File) if before else self._new_file()
            now_s = self._clock()
            seen, self._seen = self._seen, {}
            used, self._used = self._used, set()
            for device in file.devices:
                device.seen_s = max(device.seen_s, seen.get(device.id, 0.0))
                _end_replaced(device, used, now_s + OVERLAP_S)
                device.credentials = [c for c in device.credentials if now_s < c.until_s]
            file.devices = [device for device in file.devices if device.credentials]
            yield file
            after = msgspec.json.format(msgspec.json.encode(file)) + b"\n"
            if after != before:
                write_atomically(self._path, after)
                self._path.chmod(0o600)
            self._take(file)
            self._seen_kept_s = now_s

    def _take(self, file: _File) -> None:
        self._file = file
        self._read_stamp = self._stamp()
        self._by_digest = {c.sha256: (d, c) for d in file.devices for c in d.credentials}
        there = {device.id for device in file.devices}
        for device_id, listeners in list(self._listeners.items()):
            if device_id not in there:
                for ended in list(listeners):
                    ended()

    def _new_file(self) -> _File:
        return _File(VERSION, self._draw(4), [])

    def _read(self) -> bytes:
        try:
            data = self._path.read_bytes()
        except FileNotFoundError:
            return b""
        try:
            file = decode_json(data, _File)
        except ValueError:
            file = None
        if file is None or file.version != VERSION:
            # What cannot be read lets nobody in.
            self.problems.append(
                f"{self._path}: is damaged and was set aside; all devices have to pair again"
            )
            with contextlib.suppress(FileNotFoundError):
                self._path.replace(self._damaged)
            return b""
        return data

    def _stamp(self) -> tuple[int, int] | None:
        try:
            found = self._path.stat()
        except OSError:
            return None
        return found.st_ino, found.st_mtime_ns

    @contextlib.contextmanager
    def _locked(self) -> Generator[None, None, None]:
        descriptor = os.open(self._path.with_suffix(".lock"), os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield
        finally:
            os.close(descriptor)


def _add(device: Device, credential: str, now_s: float) -> None:
    """Give a device one more credential; the oldest ones end."""
    sha256 = digest(credential)
    device.credentials = [c for c in device.credentials if c.sha256 != sha256]
    device.credentials.append(Credential(sha256, now_s, now_s + LASTS_S))
    del device.credentials[:-MAX_CREDENTIALS]


def _end_replaced(device: Device, used: set[str], until_s: float) -> None:
    """End those credentials soon whose successor was used."""
    newest = max((i for i, c in enumerate(device.credentials) if c.sha256 in used), default=0)
    for older in device.credentials[:newest]:
        older.until_s = min(older.until_s, until_s)


def _successor(secret: str, salt: str) -> str:
    """Return the credential that follows from a code or from the credential before it."""
    made = hmac.digest(secret.encode(), salt.encode(), "sha256")
    return base64.urlsafe_b64encode(made).decode().rstrip("=")


def has_devices(folder: Path) -> bool:
    """Return whether a folder of sessions was served to devices."""
    return (folder / ".peaking" / FILE_NAME).is_file()
