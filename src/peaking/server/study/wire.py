"""What the study's pages and the server say to each other; TypeScript is generated from it."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from peaking.server.wire import Id, Problem
from peaking.study import questionnaires
from peaking.study.procedure import Kind
from peaking.study.questionnaires import Answer, Choice, Item, Questionnaire
from peaking.study.records import EventId, StepKey

__all__ = ["Choice", "Item", "Questionnaire"]

Answers = Annotated[dict[str, Answer], Meta(max_length=200)]
Seconds = Annotated[float, Meta(ge=0, le=1e11)]
Share = Annotated[float, Meta(ge=0, le=1)]

MAX_TEXT = questionnaires.MAX_TEXT
"""Characters of an answer in words."""

MAX_EVENTS = 200
"""Events that a phone tells at once."""

CONSTANTS = ("MAX_TEXT", "MAX_EVENTS")


class Struct(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of what is sent: fields that are not known are refused."""


# To the participant's phone


class CaptureSetting(Struct, frozen=True):
    """How the capture page looks in a trial. The name of the condition stays with the server."""

    overlay: Literal["peaks", "none"]
    guide: Literal["none", "plenoptic"]
    area_side_m: float | None
    """Of the guide; null: the client's own."""
    session: str | None
    """Id of the capture session that was begun for this trial, or for its practice."""


class ShownStep(Struct, frozen=True):
    """The step that a participant is at."""

    key: str
    kind: Kind
    running: bool
    """False: the experimenter has not started it yet."""
    text: str
    """What the participant reads; paragraphs are parted by empty lines."""
    form: Questionnaire | None = None
    draft: dict[str, Answer] = {}
    """Of a form: what was filled in so far."""
    capture: CaptureSetting | None = None
    """Of the steps of a trial."""
    over_camera: bool = False
    """A form between capture and review: it is shown over the camera, which goes on tracking."""


class ParticipantState(Struct, frozen=True, tag="ParticipantState"):
    """GET /api/v1/study/participants/{participant}, and every event of its stream."""

    participant: str
    title: str
    language: str
    step: ShownStep | None
    """None: there is nothing more to do."""
    done: int
    total: int
    refused: bool = False


# From the participant's phone


class Consent(Struct, frozen=True):
    """PUT …/consent."""

    agreed: bool
    images: bool = False


class Draft(Struct, frozen=True):
    """PATCH …/steps/{step}/draft: the answers that were changed, and only those."""

    answers: Answers


class Answered(Struct, frozen=True):
    """PUT …/steps/{step}/answers."""

    answers: Answers


class AnswersRefused(Problem, frozen=True):
    """The problem of status 422: what is wrong with which item (keys of the texts)."""

    items: dict[str, str]


class SessionBegun(Struct, frozen=True):
    """PUT …/steps/{step}/session: the capture session of a step."""

    session: Id


ToldKind = Literal[
    "CaptureBegun",
    "CaptureEnded",
    "ViewTaken",
    "ViewUndone",
    "ViewJoined",
    "PeakedTold",
    "TrackingLost",
    "TrackingFound",
    "PageGone",
    "GuideTold",
]


class Told(Struct, frozen=True):
    """Something that happened on the phone; the events of `study/records.py` with these names."""

    kind: ToldKind
    id: EventId
    step: StepKey
    time_s: Seconds
    capture: Annotated[str, Meta(max_length=64)] | None = None
    world_from_cam: Annotated[list[float], Meta(max_length=12)] | None = None
    acknowledged_s: Seconds | None = None
    generated_s: Seconds | None = None
    peaked_share: Share | None = None
    wrong_share: Share | None = None
    unseen_share: Share | None = None
    unfixable_share: Share | None = None
    views: Annotated[int, Meta(ge=0, le=1_000_000)] | None = None
    until_s: Seconds | None = None
    name: Annotated[str, Meta(max_length=40)] | None = None
    value: float | None = None


class ToldEvents(Struct, frozen=True):
    """PUT …/told/{batch}; each event is kept once, in whatever batch it comes."""

    session: Annotated[str, Meta(max_length=64)]
    """The capture session of the page that tells."""
    events: Annotated[list[Told], Meta(max_length=MAX_EVENTS)]


# The console


class StepLine(Struct, frozen=True):
    """One step as the console shows it."""

    key: str
    kind: Kind
    label: str
    state: Literal["waiting", "running", "done"]
    began_s: float | None = None
    ended_s: float | None = None


class TrialLine(Struct, frozen=True):
    """One trial: who does what where, and its first numbers."""

    key: str
    condition: str
    scene: str
    tct_s: float | None
    nct_s: float | None
    captures: int
    """So far."""
    peaked_share: float | None
    """The last one told."""
    tracking_losses: int


class ParticipantLine(Struct, frozen=True):
    """A participant as the console shows them."""

    participant: str
    state: Literal["waiting", "running", "done", "excluded"]
    current: str | None
    """Key of the current step."""
    excluded: str | None
    images: bool
    on_phone: bool
    """A page of this participant is open somewhere."""
    steps: list[StepLine]
    trials: list[TrialLine]
    notes: list[str]


class ConsoleState(Struct, frozen=True, tag="ConsoleState"):
    """Every event of the console's stream."""

    title: str
    planned: int
    remarks: list[str]
    phone_links: list[str]
    """Begin of the links for phones; the participant is appended."""
    participants: list[ParticipantLine]


class Reason(Struct, frozen=True):
    """PUT …/excluded, …/notes/{note} and …/steps/{step}/repetitions/{repetition} of the console."""

    text: Annotated[str, Meta(min_length=1, max_length=2000)]


class NewParticipant(Struct, frozen=True):
    """The answer to PUT …/participants/{new} of the console, where `new` is the client's id."""

    participant: str


StudyEvent = ParticipantState | ConsoleState
