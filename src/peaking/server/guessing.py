"""Guessing is slow: an address that was wrong waits before it is heard again.

Codes and credentials have 144 and 256 random bits, so this is a second wall, and one that must not
stand in the way of phones that are paired: what they show is looked at first, and never waits.
"""

from __future__ import annotations

import asyncio
import ipaddress
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

FREE_FAILURES = 3
"""Of one address, before it waits: links are mistyped."""
FIRST_DELAY_S = 0.5
LONGEST_DELAY_S = 8.0
FORGOTTEN_AFTER_S = 300.0
MAX_ADDRESSES = 1000
"""That are remembered; the one that failed longest ago is forgotten."""
MAX_WAITING = 16
"""Requests that may wait at once, of all addresses."""
MAX_WAITING_OF_ADDRESS = 2
TRIES_PER_S = 5.0
"""Of all addresses that have failed before, together."""


class TooManyGuesses(Exception):
    """Nobody looked at what was shown: come again after `retry_after_s`."""

    def __init__(self, retry_after_s: float) -> None:
        """Say when."""
        super().__init__("Too many wrong links were tried here. Wait a moment and try again.")
        self.retry_after_s = retry_after_s


@dataclass
class _Failures:
    count: int = 0
    last_s: float = 0.0
    waiting: int = 0


class Guesses:
    """Who was wrong lately. Used on one event loop."""

    def __init__(
        self,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], asyncio.Future[None]] | None = None,
    ) -> None:
        """Begin with a good opinion of everybody."""
        self._clock = clock
        self._sleep = sleep or asyncio.sleep
        self._failures: OrderedDict[str, _Failures] = OrderedDict()
        self._waiting = 0
        self._tries = TRIES_PER_S
        self._tries_s = clock()

    async def before(self, address: str) -> None:
        """Wait before an address is heard that was wrong before.

        Raises:
            TooManyGuesses: Too many wait already, or were heard in the last second.
        """
        found = self._of(address)
        if found is None or found.count < FREE_FAILURES:
            return
        delay_s = min(FIRST_DELAY_S * 2.0 ** (found.count - FREE_FAILURES), LONGEST_DELAY_S)
        await self._wait(found, delay_s)
        now_s = self._clock()
        self._tries = min(self._tries + (now_s - self._tries_s) * TRIES_PER_S, TRIES_PER_S)
        self._tries_s = now_s
        if self._tries < 1.0:
            raise TooManyGuesses(1.0)
        self._tries -= 1.0

    async def failed(self, address: str) -> None:
        """Remember that an address was wrong, and let it wait for its answer.

        Raises:
            TooManyGuesses: Too many wait already.
        """
        found = self._of(address) or _Failures()
        found.count = min(found.count + 1, 30)
        found.last_s = self._clock()
        self._failures[_network(address)] = found
        self._failures.move_to_end(_network(address))
        while len(self._failures) > MAX_ADDRESSES:
            self._failures.popitem(last=False)
        if found.count > FREE_FAILURES:
            await self._wait(found, FIRST_DELAY_S)

    async def _wait(self, who: _Failures, delay_s: float) -> None:
        if self._waiting >= MAX_WAITING or who.waiting >= MAX_WAITING_OF_ADDRESS:
            raise TooManyGuesses(delay_s)
        self._waiting += 1
        who.waiting += 1
        try:
            await self._sleep(delay_s)
        finally:
            self._waiting -= 1
            who.waiting -= 1

    def _of(self, address: str) -> _Failures | None:
        found = self._failures.get(_network(address))
        if found is not None and self._clock() >= found.last_s + FORGOTTEN_AFTER_S:
            return None
        return found


def _network(address: str) -> str:
    """Return what counts as one address: of global IPv6 a whole /64, which one machine may have.

    Other networks (fe80::/64, fd…::/64) are those of everybody on the spot: each address counts for
    itself, and a neighbour who guesses slows nobody else. It may take as many addresses as it likes
    and guess as fast as the server answers; the codes' length is what stops it.
    """
    try:
        found = ipaddress.ip_address(address.split("%")[0])
    except ValueError:
        return address
    if isinstance(found, ipaddress.IPv6Address):
        found = found.ipv4_mapped or found
        if isinstance(found, ipaddress.IPv6Address) and found.is_global:
            return str(ipaddress.ip_network((found, 64), strict=False))
    return str(found)
