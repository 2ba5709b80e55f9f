"""Which captures of a session a policy chooses: the same policies as in replay and evaluation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

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
from peaking.server.open_session import OpenSession
from peaking.server.upload import BadUpload
from peaking.view_builder import ViewBuilder

MAX_MPIS = 48
"""MPIs that are in memory at once; at the paper's size they take 0.2 GB."""


class DamagedMpi(PeakingError):
    """The MPI of a capture cannot be read."""

    def __init__(self, capture: wire.Capture) -> None:
        """Keep which."""
        super().__init__(f"The MPI of view {capture.number} is damaged.")
        self.capture = capture


def select_captures(
    session: OpenSession, query: wire.SelectionQuery, options: Options
) -> wire.Selection:
    """Let a policy look at the captures of a session, in the order they arrived.

    Captures without an MPI, and those whose scale is a guess, are no candidates.

    Raises:
        BadUpload: What the policy goes by is missing, or there are too few captures.
        RecordingError: A photo or its depth cannot be read.
        DamagedMpi: An MPI cannot be read.
    """
    light_field = _CapturedViews(session, options)
    candidates = [
        CapturedCandidate(light_field, capture.id, capture.number)
        for capture in session.captures
        if not capture.removed and capture.state == "ready" and not capture.guessed
    ]
    path = CandidatePath(candidates, light_field.scene_depth_m(candidates))
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
    reasons |= dict.fromkeys(last.dropped, last.reason)
    kept, worth = set(policy.views), policy.worth
    reasons |= {number: worth[number].why for number in kept if number in worth}
    return wire.Selection(
        policy=query.policy,
        captures=[
            wire.CaptureDecision(
                c.capture_id,
                c.number,
                c.number in kept,
                reasons[c.number],
                worth[c.number].psnr_db if c.number in kept and c.number in worth else None,
            )
            for c in candidates
        ],
    )


class _CapturedViews:
    """Frames and MPIs of a session as they lie on the disk."""

    def __init__(self, session: OpenSession, options: Options) -> None:
        self._session = session
        self._ids = {capture.number: capture.id for capture in session.captures}
        self._builder = ViewBuilder(options)
        self._options = options
        self._scratch = Scratch()
        self.mpi = lru_cache(maxsize=MAX_MPIS)(self._mpi)

    def frame(self, number: int, pixels: int) -> Frame:
        builder = self._builder.with_pixels(pixels)
        return builder.prepare(self._session.frame_of(self._ids[number]))

    def sharpness(self, number: int) -> float:
        return sharpness(self.frame(number, self._options.pixels).rgb)

    def small_mpi(self, number: int, pixels: int) -> Mpi:
        """Return an MPI of another size: as a rule of depth by the sensor, else of the MPI kept."""
        frame = self._session.frame_of(self._ids[number])
        builder = self._builder.with_pixels(pixels)
        return builder.build(frame).mpi if builder.accepts(frame) else self.mpi(number)

    def peaked_share(self, number: int, views: Sequence[int]) -> float:
        frame = self.frame(number, self._options.pixels)
        shown = LightField([self.mpi(view) for view in views], self._options)
        return shown.compare(frame.rgb, frame.camera, scratch=self._scratch).errors.peaked_share

    def scene_depth_m(self, candidates: Sequence[CapturedCandidate]) -> float:
        depths_m = [np.median(self.mpi(c.number).plane_depths_m) for c in candidates]
        return float(np.median(depths_m)) if depths_m else 1.0

    def _mpi(self, number: int) -> Mpi:
        capture = self._session.capture(self._ids[number])
        try:
            return read_mpi(self._session.mpi_path(capture.id, capture.mpi_version))
        except MpiFileError as error:
            raise DamagedMpi(capture) from error


@dataclass(frozen=True)
class CapturedCandidate:
    """A capture as a policy sees it (`selection.policy.Candidate`)."""

    views: _CapturedViews
    capture_id: str
    number: int

    @property
    def camera(self) -> Camera:
        """Its camera at the working size."""
        return self.views.mpi(self.number).camera

    @property
    def accepted(self) -> bool:
        """Whether it can be kept: all candidates have an MPI."""
        return True

    def sharpness(self) -> float:
        """How sharp it is at the working size."""
        return self.views.sharpness(self.number)

    def frame(self, pixels: int) -> Frame:
        """Return the photo and its camera with about so many pixels."""
        return self.views.frame(self.number, pixels)

    def mpi(self, pixels: int) -> Mpi:
        """Return its MPI with about so many pixels."""
        return self.views.small_mpi(self.number, pixels)

    def peaked_share(self, views: Sequence[int]) -> float:
        """Return how much of it is red, 0…1, where these views show it."""
        return self.views.peaked_share(self.number, views)
