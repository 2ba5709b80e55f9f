"""Who is connected, for how long, and who has to go when there is no room for more.

A connection is a stranger's until one of its requests has shown that it is paired. Strangers have a
room of their own and little time, so that a phone that is paired is served however many of them
there are. Nothing here reads or writes: `http_connection` does.
"""

from __future__ import annotations

import logging
import resource
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Literal

FILES = 256
"""Files that the server may need at once, besides its connections."""

MOST_FILES = 16_384
MOST_CONNECTIONS = 4_096
MOST_STRANGERS = 512

_log = logging.getLogger("peaking.server")

Phase = Literal["handshake", "head", "body", "answer", "idle", "closing"]
"""What a connection is waiting for: TLS, the end of a request's headers, the end of its body, the
end of our answer, the next request, or its own end."""


@dataclass(frozen=True)
class ConnectionLimits:
    """How many connections there may be, and how long they may wait.

    Attributes:
        strangers: Connections that are not paired.
        paired: Connections that are.
        opening_s: For TLS, and again for the first request's headers.
        request_s: For a stranger's whole request.
        stranger_idle_s: Until a stranger's next request begins.
        paired_idle_s: Until the next request of a paired connection begins.
        body_grace_s: A body may be slower than `body_bytes_per_s` for so long.
        body_bytes_per_s: After that it must have been so fast in the mean.
        unread_s: An answer of which so long nothing is taken is given up.
        closing_s: To take what was still to be sent when a connection is closed.
    """

    strangers: int = MOST_STRANGERS
    paired: int = MOST_CONNECTIONS - MOST_STRANGERS
    opening_s: float = 5.0
    request_s: float = 30.0
    stranger_idle_s: float = 5.0
    paired_idle_s: float = 75.0
    body_grace_s: float = 20.0
    body_bytes_per_s: float = 4_000.0
    unread_s: float = 30.0
    closing_s: float = 5.0


def limits_of_this_process() -> ConnectionLimits:
    """Let this process open as many files as it may, and return what has room in that."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, MOST_FILES)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        soft = wanted
    return limits_of_files(wanted if soft == resource.RLIM_INFINITY else soft)


def limits_of_files(files: int) -> ConnectionLimits:
    """Return the limits of a process that may open so many files."""
    total = min(MOST_CONNECTIONS, max(files - FILES, files // 2))
    strangers = min(MOST_STRANGERS, total // 4)
    return ConnectionLimits(strangers=strangers, paired=total - strangers)


@dataclass(eq=False)
class Connection:
    """One connection.

    Attributes:
        address: Where it comes from.
        end: Ends it; called with what it waited for too long, or None when others need the room.
        since_s: When its phase began, on the loop's clock.
        phase: What it waits for.
        paired: One of its requests was allowed what it asked for.
        holder: Who it belongs to: the address, or the device that was paired.
        body_bytes: Of the request's body, so far.
        body_waits: We do not read at the moment, so the sender cannot be at fault.
        unread_since_s: Since when nothing more can be sent.
    """

    address: str
    end: Callable[[Phase | None], None]
    since_s: float
    phase: Phase = "handshake"
    paired: bool = False
    holder: str = field(init=False)
    body_bytes: int = 0
    body_waits: Callable[[], bool] = lambda: False
    unread_since_s: float | None = None

    def __post_init__(self) -> None:
        """Belong to the address."""
        self.holder = self.address

    def enter(self, phase: Phase, now_s: float) -> None:
        """Begin to wait for something else."""
        self.phase, self.since_s = phase, now_s


class Connections:
    """All connections of a server. For the thread of the event loop only."""

    def __init__(self, limits: ConnectionLimits) -> None:
        """Begin without any."""
        self.limits = limits
        self._of_strangers: dict[str, dict[Connection, None]] = {}
        self._of_paired: dict[str, dict[Connection, None]] = {}
        self.strangers = 0
        self.paired = 0
        self._last_sweep_s: float | None = None

    def __iter__(self) -> Iterator[Connection]:
        """Go through all of them."""
        for holders in (self._of_strangers, self._of_paired):
            for held in list(holders.values()):
                yield from list(held)

    def admit(self, connection: Connection) -> None:
        """Take a new one; when there is no room, the one that is missed least goes."""
        self._of_strangers.setdefault(connection.address, {})[connection] = None
        self.strangers += 1
        if self.strangers > self.limits.strangers:
            self.make_room()

    def make_room(self) -> None:
        """End a connection of a stranger."""
        if self.strangers:
            self._end_for_room(_missed_least(self._of_strangers))

    def pair(self, connection: Connection, device: str | None) -> None:
        """Remember that a connection is paired, from now on."""
        if connection.paired or connection not in self._of_strangers.get(connection.holder, {}):
            return
        self.remove(connection)
        connection.paired = True
        connection.holder = device or connection.address
        self._of_paired.setdefault(connection.holder, {})[connection] = None
        self.paired += 1
        if self.paired > self.limits.paired:
            self._end_for_room(_missed_least(self._of_paired))

    def remove(self, connection: Connection) -> None:
        """Forget one that has ended; again does nothing."""
        holders = self._of_paired if connection.paired else self._of_strangers
        held = holders.get(connection.holder, {})
        if connection not in held:
            return
        del held[connection]
        if not held:
            del holders[connection.holder]
        if connection.paired:
            self.paired -= 1
        else:
            self.strangers -= 1

    def sweep(self, now_s: float) -> None:
        """End all whose time is over."""
        passed_s = 0.0 if self._last_sweep_s is None else now_s - self._last_sweep_s
        self._last_sweep_s = now_s
        for connection in self:
            if connection.phase == "body" and connection.body_waits():
                connection.since_s += passed_s
            if now_s > min(self._until_s(connection), self._unread_until_s(connection)):
                self._end(connection, connection.phase)

    def _unread_until_s(self, connection: Connection) -> float:
        """Return until when something must be taken of an answer, whatever else is waited for."""
        since_s = connection.unread_since_s
        return float("inf") if since_s is None else since_s + self.limits.unread_s

    def _until_s(self, connection: Connection) -> float:
        limits, since_s = self.limits, connection.since_s
        match connection.phase:
            case "handshake" | "head":
                return since_s + limits.opening_s
            case "body":
                enough_s = limits.body_grace_s + connection.body_bytes / limits.body_bytes_per_s
                return since_s + (
                    enough_s if connection.paired else min(enough_s, limits.request_s)
                )
            case "idle":
                idle_s = limits.paired_idle_s if connection.paired else limits.stranger_idle_s
                return since_s + idle_s
            case "closing":
                return since_s + limits.closing_s
            case "answer":
                return float("inf")

    def _end_for_room(self, connection: Connection) -> None:
        self.remove(connection)
        self._end(connection, None)

    def _end(self, connection: Connection, waited_for: Phase | None) -> None:
        """End one; whatever that raises, the others have their limits."""
        try:
            connection.end(waited_for)
        except Exception:
            _log.exception("a connection could not be ended; it is forgotten")
            self.remove(connection)


def _missed_least(holders: dict[str, dict[Connection, None]]) -> Connection:
    """Return the oldest of whoever has most; one that is being answered only if all are."""
    held = max(holders.values(), key=len)
    waiting = (c for c in held if c.phase != "answer")
    return next(waiting, next(iter(held)))
