"""Which captures of a session a policy chooses: the same policies as in replay and evaluation."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from peaking.best_frames.choosing import Chosen, FrameChoice, Looks, choose_by_pictures, faults
from peaking.best_frames.files import selection_csv
from peaking.errors import MpiFileError, PeakingError
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.light_field import LightField, Scratch
from peaking.mpi import Mpi
from peaking.mpi_file import read_mpi
from peaking.options import Options
from peaking.selection.blur import sharpness
from peaking.selection.policy import CandidatePath
from peaking.selection.registry import SelectionOptions, create_policy
from peaking.server import wire
from peaking.server.dataset import photo_name
from peaking.server.open_session import OpenSession
from peaking.server.upload import BadUpload
from peaking.view_builder import ViewBuilder

MAX_MPIS = 48
"""MPIs that are in memory at once; at the paper's size they take 0.2 GB."""

SELECTION = "selection.csv"

REMEMBERED = 16
"""Answers that are remembered, each until a capture changes."""


class DamagedMpi(PeakingError):
    """The MPI of a capture cannot be read."""

    def __init__(self, capture: wire.Capture) -> None:
        """Keep which."""
        super().__init__(f"The MPI of view {capture.number} is damaged.")
        self.capture = capture


class Selections:
    """Answers to questions for a selection; asking twice is cheap. May be used from any thread."""

    def __init__(self, options: Options) -> None:
        """Begin without answers."""
        self._options = options
        self._lock = threading.Lock()
        self._known: OrderedDict[tuple[str, wire.SelectionQuery], _Known] = OrderedDict()

    def ask(self, session: OpenSession, query: wire.SelectionQuery) -> wire.Selection:
        """Return what a policy chooses; raises as `select_captures`."""
        key, candidates = (session.id, query), candidates_of(session)
        looked_at = tuple((capture.id, capture.mpi_version) for capture in candidates)
        with self._lock:
            known = self._known.get(key)
        if known is None or known.looked_at != looked_at:
            known = _Known(looked_at, select_captures(session, candidates, query, self._options))
        with self._lock:
            self._known[key] = known
            self._known.move_to_end(key)
            while len(self._known) > REMEMBERED:
                self._known.popitem(last=False)
        return known.selection

    def forget(self, session_id: str) -> None:
        """Forget the answers about a session."""
        with self._lock:
            for key in [key for key in self._known if key[0] == session_id]:
                del self._known[key]


@dataclass(frozen=True)
class _Known:
    looked_at: tuple[tuple[str, int], ...]
    selection: wire.Selection


def candidates_of(session: OpenSession) -> list[wire.Capture]:
    """Return the captures that can be chosen from, in the order they arrived.

    Captures without an MPI, and those whose scale is a guess, are no candidates.
    """
    return [
        capture
        for capture in session.captures
        if not capture.removed and capture.state == "ready" and not capture.guessed
    ]


def select_captures(
    session: OpenSession,
    captures: Sequence[wire.Capture],
    query: wire.SelectionQuery,
    options: Options,
) -> wire.Selection:
    """Let a policy look at captures of a session, in the order they arrived.

    Raises:
        BadUpload: What the policy goes by is missing, or there are too few captures.
        RecordingError: A photo or its depth cannot be read.
        DamagedMpi: An MPI cannot be read.
    """
    views = CapturedViews(session, options)
    candidates = {c.number: CapturedCandidate(views, c.id, c.number) for c in captures}
    looks = Looks(options.pixels)
    if query.policy == "peaking":
        chosen = choose_by_pictures(candidates, candidates.__getitem__, query.views, options, looks)
        reasons: Mapping[int, str] = {}
    else:
        kept, reasons = _walked(views, list(candidates.values()), query, options)
        for candidate in candidates.values():
            looks.add(candidate)
        chosen = Chosen(dict.fromkeys(kept), [])
    choices = looks.choices(chosen, photo_name)
    is_auto = query.policy == "peaking" and query.views is None
    return wire.Selection(
        policy=query.policy,
        captures=[
            _decision(candidates[number].capture_id, choice, reasons.get(number))
            for number, choice in choices.items()
        ],
        curve=[wire.CurvePoint(point.num_views, point.psnr_db) for point in chosen.curve],
        enough=len(chosen.kept) if is_auto else None,
    )


def chosen_files(session: OpenSession, selection: wire.Selection) -> list[tuple[str, Path | bytes]]:
    """Return names and contents of the data set of the captures that were chosen.

    Raises:
        BadUpload: None was.
        SessionGone: The session is deleted.
    """
    kept = {decision.id for decision in selection.captures if decision.kept}
    if not kept:
        raise BadUpload(
            "The best views cannot be told: none has been processed with depth. Download all.",
            status=409,
        )
    captures = [capture for capture in session.captures if not capture.removed]
    files = session.dataset_files(only=kept)
    return [*files, (SELECTION, csv_of(selection, captures).encode())]


def csv_of(selection: wire.Selection, captures: Sequence[wire.Capture]) -> str:
    """Return what became of captures, as `peaking select` writes it.

    Args:
        selection: What was chosen.
        captures: Of the session, without removed ones; others than those that could be chosen from
            too.
    """
    decided = {decision.id: decision for decision in selection.captures}
    return selection_csv(_choice(capture, decided.get(capture.id)) for capture in captures)


def _choice(capture: wire.Capture, decision: wire.CaptureDecision | None) -> FrameChoice:
    number, name = capture.number, photo_name(capture.number)
    if decision is None:
        return FrameChoice(number, name, False, "no depth", None)
    return FrameChoice(
        number, name, decision.kept, decision.reason, decision.sharpness, decision.worth_db
    )


def _decision(capture_id: str, choice: FrameChoice, reason: str | None) -> wire.CaptureDecision:
    return wire.CaptureDecision(
        capture_id,
        choice.number,
        choice.kept,
        reason or choice.reason,
        choice.worth_db,
        choice.sharpness,
        choice.brightness,
        [*faults(choice.sharpness, choice.brightness)],
    )


def _walked(
    views: CapturedViews,
    candidates: Sequence[CapturedCandidate],
    query: wire.SelectionQuery,
    options: Options,
) -> tuple[list[int], dict[int, str]]:
    """Return which views a policy that is not our own keeps, and why of every candidate."""
    path = CandidatePath(candidates, views.scene_depth_m(candidates))
    try:
        selection = SelectionOptions(
            policy=query.policy,
            num_views=query.views,
            threshold_share=query.threshold_share,
            spacing_m=query.spacing_m,
            seed=query.seed,
        )
        policy = create_policy(selection, options, path=path)
    except ValueError as error:
        raise BadUpload(f"These views cannot be chosen: {error}.", status=400) from error
    reasons: dict[int, str] = {}
    for candidate in candidates:
        decision = policy.observe(candidate)
        reasons[candidate.number] = decision.reason
        reasons |= dict.fromkeys(decision.dropped, f"dropped at view {candidate.number}")
    last = policy.finish()
    return list(policy.views), reasons | dict.fromkeys(last.dropped, last.reason)


class CapturedViews:
    """Frames and MPIs of a session as they lie on the disk."""

    def __init__(self, session: OpenSession, options: Options) -> None:
        """Look at a session with the method's options."""
        self._session = session
        self._builder = ViewBuilder(options)
        self._options = options
        self._scratch = Scratch()
        # One after the other is looked at, each several times.
        self._read = lru_cache(maxsize=1)(session.frame_of)
        self.frame = lru_cache(maxsize=2)(self._frame)
        self.sharpness = lru_cache(maxsize=1)(self._sharpness)
        self.small_mpi = lru_cache(maxsize=1)(self._small_mpi)
        self.mpi = lru_cache(maxsize=MAX_MPIS)(self._mpi)

    def peaked_share(self, capture_id: str, views: Sequence[str]) -> float:
        """Return how much of a capture is red, 0…1, where these show it."""
        frame = self.frame(capture_id, self._options.pixels)
        shown = LightField([self.mpi(view) for view in views], self._options)
        return shown.compare(frame.rgb, frame.camera, scratch=self._scratch).errors.peaked_share

    def scene_depth_m(self, candidates: Sequence[CapturedCandidate]) -> float:
        """Return how far away things typically are."""
        depths_m = [np.median(self.mpi(c.capture_id).plane_depths_m) for c in candidates]
        return float(np.median(depths_m)) if depths_m else 1.0

    def ids(self, numbers: Sequence[int]) -> list[str]:
        """Return the ids of captures of these numbers."""
        ids = {capture.number: capture.id for capture in self._session.captures}
        return [ids[number] for number in numbers]

    def _frame(self, capture_id: str, pixels: int) -> Frame:
        return self._builder.with_pixels(pixels).prepare(self._read(capture_id))

    def _sharpness(self, capture_id: str) -> float:
        return sharpness(self.frame(capture_id, self._options.pixels).rgb)

    def _small_mpi(self, capture_id: str, pixels: int) -> Mpi:
        """Return an MPI of another size: as a rule of depth by the sensor, else of the MPI kept."""
        frame = self._read(capture_id)
        builder = self._builder.with_pixels(pixels)
        return builder.build(frame).mpi if builder.accepts(frame) else self.mpi(capture_id)

    def _mpi(self, capture_id: str) -> Mpi:
        capture = self._session.capture(capture_id)
        try:
            return read_mpi(self._session.mpi_path(capture.id, capture.mpi_version))
        except MpiFileError as error:
            raise DamagedMpi(capture) from error


@dataclass(frozen=True)
class CapturedCandidate:
    """A capture as a policy sees it (`selection.policy.Candidate`)."""

    views: CapturedViews
    capture_id: str
    number: int

    @property
    def camera(self) -> Camera:
        """Its camera at the working size."""
        return self.views.mpi(self.capture_id).camera

    @property
    def accepted(self) -> bool:
        """Whether it can be kept: all candidates have an MPI."""
        return True

    def sharpness(self) -> float:
        """How sharp it is at the working size."""
        return self.views.sharpness(self.capture_id)

    def frame(self, pixels: int) -> Frame:
        """Return the photo and its camera with about so many pixels."""
        return self.views.frame(self.capture_id, pixels)

    def mpi(self, pixels: int) -> Mpi:
        """Return its MPI with about so many pixels."""
        return self.views.small_mpi(self.capture_id, pixels)

    def peaked_share(self, views: Sequence[int]) -> float:
        """Return how much of it is red, 0…1, where these views show it."""
        return self.views.peaked_share(self.capture_id, self.views.ids(views))
