"""Threads of their own for work of which one device can ask much: no other one waits for it all."""

from __future__ import annotations

import asyncio
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, ParamSpec, TypeVar

from peaking.server.fair_queue import Lines

ENDING_S = 10.0

P = ParamSpec("P")
T = TypeVar("T")


class Turns:
    """A few threads in which devices take turns, and the sessions of a device within those.

    For the thread of the event loop, which never waits here.
    """

    def __init__(self, threads: int, *, name: str, session_by_session: bool = False) -> None:
        """Start the threads.

        Args:
            threads: How many things are done at once.
            name: Of the threads.
            session_by_session: At most one thing at once is done for each session: the others
                would wait for its lock, each in a thread.
        """
        self._lines: Lines[_Work[Any]] = Lines()
        self._one_at_once = session_by_session
        self._busy: set[str] = set()
        self._names = [f"{name}-{number}" for number in range(threads)]
        self._free = threads
        self._due: queue.SimpleQueue[_Work[Any] | None] = queue.SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._start()

    async def do(
        self, device: str, session: str, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Call something in a thread when its turn has come, and return what it returns."""
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[T] = loop.create_future()
        self._lines.add(_Work(lambda: call(*args, **kwargs), session, answer), device, session)
        if not self._threads:
            self._start()
        self._hand_out()
        return await answer

    def close(self) -> None:
        """Let the threads finish what they do; they are started again when they are needed."""
        for _ in self._threads:
            self._due.put(None)
        for thread in self._threads:
            thread.join(ENDING_S)
        self._threads.clear()

    def _start(self) -> None:
        self._threads += (
            threading.Thread(target=self._work, name=name, daemon=True) for name in self._names
        )
        for thread in self._threads:
            thread.start()

    def _hand_out(self) -> None:
        while self._free and (found := self._lines.next(but=self._busy)) is not None:
            work, session = found
            if work.answer.done():
                continue  # nobody waits for it any more
            if self._one_at_once:
                self._busy.add(session)
            self._free -= 1
            self._due.put(work)

    def _work(self) -> None:
        while self._do_next():
            pass  # nothing of what was done is held on to while this waits

    def _do_next(self) -> bool:
        work = self._due.get()
        if work is None:
            return False
        try:
            result, error = work.call(), None
        except BaseException as raised:  # whatever it is, who asked is told
            result, error = None, raised
        try:
            work.answer.get_loop().call_soon_threadsafe(self._done, work, result, error)
        except RuntimeError:  # the loop has ended, and with it all that waited
            self._give_back(work)
        return True

    def _done(self, work: _Work[Any], result: Any, error: BaseException | None) -> None:
        self._give_back(work)
        if not work.answer.done():
            if error is None:
                work.answer.set_result(result)
            else:
                work.answer.set_exception(error)
        # who is told now answers before the next thing is begun
        work.answer.get_loop().call_soon(self._hand_out)

    def _give_back(self, work: _Work[Any]) -> None:
        self._free += 1
        self._busy.discard(work.session)


@dataclass(frozen=True, eq=False)
class _Work(Generic[T]):
    """Something to be done, whose turn it is, and who waits for it."""

    call: Callable[[], T]
    session: str
    answer: asyncio.Future[T]
