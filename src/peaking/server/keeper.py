"""Sets aside what the automatic shutter took beyond a number: those views that are missed least.

Views that were taken by hand, and those that somebody brought back, stay whatever they show. Where
no more than that number was taken automatically, nothing is looked at.
"""

from __future__ import annotations

import contextlib
import logging
import os
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from peaking.errors import PeakingError
from peaking.options import Options
from peaking.selection.backward_elimination import HELD_WITHOUT_NUMBER, BackwardElimination
from peaking.server import wire
from peaking.server.open_session import OpenSession
from peaking.server.selection import CapturedCandidate, CapturedViews, candidates_of

MOST_AUTOMATIC = HELD_WITHOUT_NUMBER
"""Views of a session that the automatic shutter took and that stay in the data set."""

REMEMBERED = 4
"""Sessions of which is remembered what their views show; others are looked at anew."""

NICENESS = 10
"""Of the thread: whatever else there is to do goes first."""

ENDING_S = 10.0

POLL_S = 0.02
MOST_PATIENT_S = 5.0
"""So long it waits, for each view that it looks at, until there is nothing else to do."""

_log = logging.getLogger("peaking.server")

Told = Callable[[OpenSession, wire.Capture], None]


@dataclass
class _Watched:
    """What is known of a session's views."""

    policy: BackwardElimination
    seen: dict[str, int] = field(default_factory=dict[str, int])
    """Numbers of the views that were looked at and are in the data set, by id."""
    gone: set[str] = field(default_factory=set[str])
    """Ids of those that were, and are not there any more."""


class Keeper:
    """Looks at sessions in a thread of its own, one after the other, when nothing else is to do."""

    def __init__(
        self,
        options: Options,
        *,
        on_set_aside: Told,
        may_work: Callable[[], bool] = lambda: True,
        most_automatic: int = MOST_AUTOMATIC,
    ) -> None:
        """Start the thread.

        Args:
            options: How views are built and shown.
            on_set_aside: Called from the thread for each view that was set aside.
            may_work: Whether there is nothing else to do now.
            most_automatic: How many views that were taken automatically stay in a session.
        """
        self._options = options
        self._on_set_aside = on_set_aside
        self._may_work = may_work
        self._most = most_automatic
        self._due: queue.SimpleQueue[OpenSession | None] = queue.SimpleQueue()
        self._waiting: set[str] = set()
        self._watched: dict[str, _Watched] = {}
        """By session, the one that was looked at longest ago first."""
        self._closed = False
        self._thread: threading.Thread | None = None

    def look(self, session: OpenSession) -> None:
        """Have a session looked at, if it has too many; from any thread, never waits."""
        if session.id in self._waiting or len(self._automatic(session)) <= self._most:
            return
        self._waiting.add(session.id)
        self._due.put(session)
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="keeper", daemon=True)
            self._thread.start()

    def forget(self, session_id: str) -> None:
        """Forget what was seen of a session; from any thread."""
        self._watched.pop(session_id, None)

    def close(self) -> None:
        """Let the thread finish the view that it looks at."""
        self._closed = True
        self._due.put(None)
        if self._thread is not None:
            self._thread.join(ENDING_S)

    # Inside

    def _automatic(self, session: OpenSession) -> list[wire.Capture]:
        return [capture for capture in candidates_of(session) if capture.automatic]

    def _work(self) -> None:
        import numba  # takes a second to load

        numba.set_num_threads(1)
        with contextlib.suppress(OSError, AttributeError):  # of this thread alone, on Linux
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
        while (session := self._due.get()) is not None and not self._closed:
            self._waiting.discard(session.id)
            try:
                self._thin_out(session)
            except PeakingError as error:  # a full disk, a damaged photo, an erased session
                _log.warning("no view of %s was set aside: %s", session.folder.name, error)
            except Exception:  # whatever it is, the next session must be looked at
                _log.exception("no view of %s was set aside", session.folder.name)

    def _thin_out(self, session: OpenSession) -> None:
        watched = self._looked_at(session)
        while not self._closed:
            automatic = {capture.number: capture for capture in self._automatic(session)}
            if len(automatic) <= self._most:
                break
            least = self._least_missed(watched, automatic)
            if least is None:
                break
            self._on_set_aside(session, session.set_aside(least.id))
            watched.gone.add(least.id)
            watched.seen.pop(least.id)
        watched.policy.forget_renderings()

    def _least_missed(
        self, watched: _Watched, automatic: dict[int, wire.Capture]
    ) -> wire.Capture | None:
        """Return the view that goes: one that is not held, as another shows the same, or the next.

        None where none of them was looked at.
        """
        known = {number for number in watched.seen.values() if number in automatic}
        spare = sorted(known - set(watched.policy.views))
        number = spare[0] if spare else watched.policy.give_up(known)
        return None if number is None else automatic[number]

    def _give_way(self) -> None:
        """Wait until there is nothing else to do, but not for ever."""
        for _ in range(round(MOST_PATIENT_S / POLL_S)):
            if self._closed or self._may_work():
                return
            time.sleep(POLL_S)

    def _looked_at(self, session: OpenSession) -> _Watched:
        """Look at the views that came since the last time."""
        candidates = candidates_of(session)
        watched = self._watched.get(session.id)
        if watched is None or any(capture.id in watched.gone for capture in candidates):
            # A view that is there again cannot be looked at a second time.
            watched = _Watched(BackwardElimination(None, self._options, most_held=2 * self._most))
        self._watched.pop(session.id, None)
        self._watched[session.id] = watched
        for longest in list(self._watched)[:-REMEMBERED]:
            self._watched.pop(longest, None)
        there = {capture.id for capture in candidates}
        for capture_id in watched.seen.keys() - there:
            watched.policy.give_up({watched.seen.pop(capture_id)})
            watched.gone.add(capture_id)
        views = CapturedViews(session, self._options)
        for capture in candidates:
            if self._closed:
                break
            if capture.id not in watched.seen:
                self._give_way()
                watched.policy.observe(CapturedCandidate(views, capture.id, capture.number))
                watched.seen[capture.id] = capture.number
        return watched
