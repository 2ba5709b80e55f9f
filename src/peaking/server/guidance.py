"""Where the next view of a session helps: computed when there is nothing better to do.

One thread, of low priority, which waits while MPIs are due. Of a session that changes while it
waits for its turn, only the newest state is looked at.
"""

from __future__ import annotations

import base64
import contextlib
import itertools
import logging
import os
import sys
import threading
from collections import Counter, OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import msgspec
import numpy as np

from peaking.errors import PeakingError
from peaking.guidance.next_view import Suggestion
from peaking.guidance.watch import Advice, Pose, Watch, small_views
from peaking.light_field import LightField
from peaking.mpi import Mpi
from peaking.mpi_file import read_mpi
from peaking.options import Options
from peaking.output import encode_jpeg
from peaking.server import wire
from peaking.server.fair_queue import FairQueue
from peaking.server.open_session import OpenSession
from peaking.server.recordings import wire_of_camera
from peaking.server.upload import BadUpload, pose_of_wire
from peaking.view_builder import ViewBuilder

MAX_WATCHED = 4
"""Sessions whose small MPIs are in memory."""

MAX_ANSWERS = 64
"""Sessions whose guidance is kept."""

MAX_VIEWS = 240
"""Of a session with more views, evenly chosen ones are looked at."""

MAX_PATH = 512
"""Moments of a walk that are looked at; of a longer one, every second, every fourth …"""

STEPS_WALKED = 10
"""The walk is looked at again when so many samples of it have come."""

NICE = 10
"""How far this stands behind the rest, where the system can tell threads apart."""

PATIENCE, WAIT_S = 40, 0.05
"""It waits so many times so long for MPIs that are due, before each picture that it foresees."""

JPEG_QUALITY = 70

_log = logging.getLogger("peaking.server")

NOTHING_YET = wire.Guidance(
    revision=0, views=0, score=0.0, verdict="go on", curve=[], next=None, left=[], surface_m=[]
)


class _Closing(Exception):
    """The server stops."""


@dataclass
class _Watched:
    """A session that is watched, and its small MPIs by capture and version."""

    watch: Watch
    mpis: dict[tuple[str, int], Mpi] = field(default_factory=dict[tuple[str, int], Mpi])


class GuidanceWorker:
    """A thread that computes the guidance of sessions, one after the other.

    No lock: the thread of the event loop never waits here, and what it touches changes in one step.
    """

    def __init__(
        self,
        options: Options,
        *,
        on_new: Callable[[OpenSession, int], None],
        is_busy: Callable[[], bool],
    ) -> None:
        """Start the thread.

        Args:
            options: How views are made and blended.
            on_new: Told of a session and the revision of its new guidance; called in the thread.
            is_busy: Whether there is something better to do.
        """
        self._small = small_views(options)
        self._on_new = on_new
        self._is_busy = is_busy
        self._builder: ViewBuilder | None = None
        self._waiting: FairQueue[OpenSession] = FairQueue()
        self._due: set[str] = set()
        self._walked: Counter[str] = Counter()
        self._answers: OrderedDict[str, wire.Guidance] = OrderedDict()
        self._watched: OrderedDict[str, _Watched] = OrderedDict()
        self._count = itertools.count(1)
        self._gone: set[str] = set()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work, name="guidance", daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Sessions that wait for their turn."""
        return len(self._due)

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def of(self, session: OpenSession) -> wire.Guidance:
        """Return what is known of a session; where nothing is, it is computed soon."""
        known = self._answers.get(session.id)
        if known is None:
            self.want(session)
        return known or NOTHING_YET

    def want(self, session: OpenSession) -> None:
        """Have the guidance of a session computed: it has changed. Never waits."""
        if session.owner is not None:
            return  # a study's protocol says what participants are shown
        if session.id not in self._due:
            self._due.add(session.id)
            self._waiting.put(session, "", session.id)

    def walked(self, session: OpenSession, steps: int) -> None:
        """Note that a photographer went on; now and then the guidance is computed for it."""
        self._walked[session.id] += steps
        if self._walked[session.id] >= STEPS_WALKED and session.id in self._answers:
            self._walked.pop(session.id, None)
            self.want(session)

    def forget(self, session_id: str) -> None:
        """Forget what is known of a session of which something is erased."""
        self._answers.pop(session_id, None)
        self._watched.pop(session_id, None)
        self._walked.pop(session_id, None)

    def forget_for_ever(self, session_id: str) -> None:
        """Forget a session that is erased; what is being computed of it is thrown away."""
        self._gone.add(session_id)
        self.forget(session_id)

    def close(self) -> None:
        """End the thread, soon."""
        self._closing.set()
        self._waiting.close()
        self._thread.join(10)

    def _work(self) -> None:
        if sys.platform == "linux":
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICE)
        while (session := self._waiting.get()) is not None:
            self._due.discard(session.id)
            try:
                self._compute(session)
            except _Closing:
                return
            except PeakingError as error:  # gone meanwhile, or a photo is damaged
                _log.info("no guidance for session %s: %s", session.id, error)
            except Exception:  # whatever it is, the next session must be served
                _log.exception("computing the guidance of session %s failed", session.id)

    def _compute(self, session: OpenSession) -> None:
        captures = [
            capture
            for capture in session.captures
            if not capture.removed and capture.state == "ready" and not capture.guessed
        ]
        if not captures:
            if session.id in self._answers:
                self._answer(
                    session, msgspec.structs.replace(NOTHING_YET, revision=next(self._count))
                )
            return
        watched = self._watched_of(session.id)
        some = captures[:: -(-len(captures) // MAX_VIEWS)]
        mpis = self._mpis(session, some, watched)
        advice = watched.watch.advise(mpis, _path(session), pause=self._pause)
        if not any(session.capture(capture.id).ending == "erased" for capture in captures):
            self._keep(session, len(captures), advice, mpis)

    def _keep(self, session: OpenSession, views: int, advice: Advice, mpis: Sequence[Mpi]) -> None:
        before = self._answers.get(session.id, NOTHING_YET)
        curve = [point for point in before.curve if point.views < views]
        field_ = LightField(mpis, self._small)
        answer = wire.Guidance(
            revision=next(self._count),
            views=views,
            score=advice.score,
            verdict=advice.verdict,
            curve=[*curve, wire.ScoreAt(views, advice.score)],
            next=None if advice.next is None else _place(advice.next, None),
            left=[_place(each, self._picture(each, field_, mpis[0])) for each in advice.left],
            surface_m=_some(advice.surface_m),
        )
        self._answer(session, answer)

    def _answer(self, session: OpenSession, answer: wire.Guidance) -> None:
        if session.id in self._gone:
            return
        self._answers.pop(session.id, None)
        self._answers[session.id] = answer  # the newest last
        while len(self._answers) > MAX_ANSWERS:
            self._answers.popitem(last=False)
        self._on_new(session, answer.revision)

    def _watched_of(self, session_id: str) -> _Watched:
        watched = self._watched.pop(session_id, None) or _Watched(Watch(self._small))
        self._watched[session_id] = watched
        while len(self._watched) > MAX_WATCHED:
            self._watched.popitem(last=False)
        return watched

    def _mpis(
        self, session: OpenSession, captures: Sequence[wire.Capture], watched: _Watched
    ) -> list[Mpi]:
        """Return small MPIs of captures; those of others are forgotten."""
        kept: dict[tuple[str, int], Mpi] = {}
        for capture in captures:
            key = (capture.id, capture.mpi_version)
            if key not in watched.mpis:
                self._pause()
                watched.mpis[key] = self._small_mpi(session, capture)
            kept[key] = watched.mpis[key]
        watched.mpis = kept
        return list(kept.values())

    def _small_mpi(self, session: OpenSession, capture: wire.Capture) -> Mpi:
        if self._builder is None:
            self._builder = ViewBuilder(self._small)
        frame = session.frame_of(capture.id)
        if frame.depth_m is not None:
            return self._builder.generate(frame)
        return read_mpi(session.mpi_path(capture.id, capture.mpi_version))

    def _picture(self, suggestion: Suggestion, shown: LightField, like: Mpi) -> bytes:
        size_px = like.camera.pinhole.size_px
        rendering = shown.render(suggestion.camera.resized(*size_px))
        rgb = np.clip(rendering.rgba[..., :3], 0.0, 1.0)
        return encode_jpeg((255 * rgb + 0.5).astype(np.uint8), quality=JPEG_QUALITY)

    def _pause(self) -> None:
        """Let what is more urgent go first."""
        for _ in range(PATIENCE):
            if self._closing.is_set():
                raise _Closing
            if not self._is_busy():
                return
            self._closing.wait(WAIT_S)


def _path(session: OpenSession) -> list[Pose]:
    """Return where the photographer was: most of it stays while the walk goes on."""
    samples, every = session.peaked(), 1
    while len(samples) > MAX_PATH * every:
        every *= 2
    path: list[Pose] = []
    for sample in samples[::every]:
        with contextlib.suppress(BadUpload):  # whatever it is, it is no pose
            path.append(pose_of_wire(sample.world_from_cam, name="world_from_cam"))
    return path


def _place(suggestion: Suggestion, picture: bytes | None) -> wire.GuidedPlace:
    return wire.GuidedPlace(
        camera=wire_of_camera(suggestion.camera),
        reason=suggestion.reason,
        share=suggestion.foresight.help,
        picture=None if picture is None else base64.b64encode(picture).decode("ascii"),
    )


def _some(surface_m: np.ndarray) -> list[float]:
    every = max(1, -(-len(surface_m) // wire.MAX_SURFACE_PLACES))
    return np.round(surface_m[::every].astype(np.float64), 3).reshape(-1).tolist()
