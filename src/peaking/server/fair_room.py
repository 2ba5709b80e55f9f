"""Room that devices share: whoever has much is refused before whoever has little."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter
from dataclasses import dataclass, field

from peaking.errors import PeakingError

SPREAD_S = 8
"""Those who are refused are asked to come back within so long, each at another second."""

SESSION_MOST = 64
SESSION_PART = 8
"""A session has at most so many places, and one in so many of those its device may still take."""


class Busy(PeakingError):
    """There is no room now; `retry_after_s` says when to ask again."""

    def __init__(self, retry_after_s: int) -> None:
        """Keep when."""
        super().__init__("The server is busy; the phone tries again.")
        self.retry_after_s = retry_after_s


class FairRoom:
    """So much room for all. For the thread of the event loop only.

    A device may take as much as it leaves free for others. So one device alone gets half of the
    room, three get a quarter each, and there is always something left for one that comes later.
    """

    def __init__(self, capacity: int) -> None:
        """Begin with nothing taken."""
        self.taken = 0
        self._capacity = capacity
        self._of_devices: Counter[str] = Counter()
        self._of_sessions: Counter[tuple[str, str]] = Counter()
        self._refused = 0

    def take(self, amount: int, device: str, session: str | None = None) -> Share:
        """Take room, to be given back; nothing is always there.

        Raises:
            Busy: The device, or the session among those of the device, has its share already.
        """
        left = self._capacity - self.taken - self._of_devices[device]
        enough = session is not None and self._has_enough(device, session, left)
        if amount and (amount > left or enough):
            self._refused += 1
            raise Busy(1 + self._refused % SPREAD_S)
        share = Share(self, amount, device, session, asyncio.get_running_loop())
        self.changed_by(amount, share)
        return share

    def changed_by(self, amount: int, share: Share) -> None:
        """Count what was taken or given back."""
        self.taken += amount
        self._of_devices[share.device] += amount
        if not self._of_devices[share.device]:
            del self._of_devices[share.device]
        if share.session is not None:
            key = share.device, share.session
            self._of_sessions[key] += amount
            if not self._of_sessions[key]:
                del self._of_sessions[key]

    def _has_enough(self, device: str, session: str, left: int) -> bool:
        places = max(1, min(left // SESSION_PART, SESSION_MOST))
        return self._of_sessions[device, session] >= places


@dataclass(eq=False)
class Share:
    """Room that somebody has."""

    room: FairRoom
    amount: int
    device: str
    session: str | None
    _loop: asyncio.AbstractEventLoop
    _given_back: bool = field(default=False, init=False)

    def give_back(self) -> None:
        """Give it back, once; from any thread, never waits."""
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._give_back)

    def _give_back(self) -> None:
        if not self._given_back:
            self._given_back = True
            self.room.changed_by(-self.amount, self)
