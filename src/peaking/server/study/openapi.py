"""The study's addresses, for the OpenAPI document."""

from __future__ import annotations

from typing import Any

from peaking.server.openapi import Operation
from peaking.server.study import wire
from peaking.server.wire import PairingLink

_PARTICIPANT = "/api/v1/study/participants/{participant}"
_STEP = _PARTICIPANT + "/steps/{step}"
_CONSOLE = "/api/v1/study/console"
_THEIR = _CONSOLE + "/participants/{participant}"
_THEIR_STEP = _THEIR + "/steps/{step}"


def _participant(method: str, path: str, summary: str, body: Any = None, **more: Any) -> Operation:
    return Operation(method, path, summary, wire.ParticipantState, body, **more)


def _console(path: str, summary: str, body: Any = None) -> Operation:
    return Operation("put", path, summary, wire.ParticipantState, body, needs="console")


STUDY_OPERATIONS = (
    Operation("get", "/api/v1/study/texts", "Words of the participants' pages", dict[str, str]),
    _participant("get", _PARTICIPANT, "Where a participant stands"),
    _participant(
        "get", _PARTICIPANT + "/events", "News of a participant", media="text/event-stream"
    ),
    _participant("put", _PARTICIPANT + "/consent", "Give or refuse consent", wire.Consent),
    Operation(
        "put",
        _PARTICIPANT + "/told/{batch}",
        "Tell what happened on the phone",
        body=wire.ToldEvents,
        status=204,
    ),
    _participant("patch", _STEP + "/draft", "Keep changed answers of a form", wire.Draft),
    _participant(
        "put",
        _STEP + "/answers",
        "Hand a form in",
        wire.Answered,
        refusals=((422, wire.AnswersRefused),),
    ),
    _participant("put", _STEP + "/session", "Name a step's capture session", wire.SessionBegun),
    _participant("put", _STEP + "/finished", "End a part"),
    Operation(
        "get",
        _CONSOLE + "/events",
        "News for the console",
        wire.ConsoleState,
        media="text/event-stream",
        needs="console",
    ),
    Operation(
        "put",
        _CONSOLE + "/participants/{new}",
        "Add a participant",
        wire.NewParticipant,
        status=201,
        needs="console",
    ),
    _console(_THEIR_STEP + "/started", "Start a part"),
    _console(_THEIR_STEP + "/finished", "Stop a part"),
    _console(_THEIR_STEP + "/repetitions/{repetition}", "Repeat a part", wire.Reason),
    _console(_THEIR + "/notes/{note}", "Add a note", wire.Reason),
    _console(_THEIR + "/excluded", "Exclude from the analysis", wire.Reason),
    Operation(
        "post",
        _THEIR + "/codes",
        "A code that pairs a phone for a participant",
        PairingLink,
        needs="console",
    ),
)
