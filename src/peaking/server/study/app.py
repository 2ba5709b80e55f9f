"""The HTTP application of a study: the capture server, and what the study's pages ask for.

Addresses below /api/v1/study are the participants', each for the phones that were paired for that
participant; those below /api/v1/study/console are the console's.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncGenerator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Mount, Route

from peaking.errors import OutputError, PeakingError
from peaking.server.auth import Guard
from peaking.server.device_routes import pairing_link
from peaking.server.devices import Devices
from peaking.server.events import Hub
from peaking.server.fair_room import Busy
from peaking.server.open_session import SessionGone
from peaking.server.openapi import OPERATIONS, document
from peaking.server.pages import page
from peaking.server.pairing_codes import Grant
from peaking.server.requests import device_of, id_in_path, read_json
from peaking.server.responses import (
    busy,
    event_stream,
    json_response,
    problem,
    problem_response,
    type_and_title,
)
from peaking.server.study import wire
from peaking.server.study.open_participant import Incomplete, NotNow, OpenParticipant, TooMuch
from peaking.server.study.open_study import OpenStudy, UnknownParticipant
from peaking.server.study.openapi import STUDY_OPERATIONS
from peaking.server.study.shown import ConsoleView, participant_state
from peaking.server.told import cause_of, without_paths
from peaking.server.upload import BadUpload
from peaking.study.records import StepKey

CONSOLE = ""
"""The console's topic; every other topic is a participant."""
FORGOTTEN_EVERY_S = 3600.0
CONSOLE_PERIOD_S = 0.1
"""The console is told at most so often, however many phones tell something."""

T = TypeVar("T")
_log = logging.getLogger("peaking.server")

_log = logging.getLogger("peaking.server")


@dataclass(frozen=True)
class StudyServerOptions:
    """Who may do what, and where phones find it.

    Attributes:
        devices: Those that are paired; None lets in whoever is on this machine.
        client_dir: The built web client.
        phone_links: Begin of the links for phones, the best first; the participant is appended.
    """

    devices: Devices | None
    client_dir: Path
    phone_links: list[str]


class _Handlers:
    """The handlers, and what they need."""

    def __init__(self, study: OpenStudy, config: StudyServerOptions, hub: Hub) -> None:
        self.study = study
        self.config = config
        self.hub = hub
        self._view = ConsoleView(study)
        self._telling: asyncio.Task[None] | None = None

    async def forget_images(self) -> None:
        """Erase, as long as this runs, photos that may not be kept any longer."""
        while True:
            await asyncio.sleep(FORGOTTEN_EVERY_S)
            forgotten, problems = await run_in_threadpool(self.study.forget_overdue_images)
            for problem_ in problems:  # a full disk: tried again
                _log.warning(problem_)
            for participant in forgotten:
                state = await run_in_threadpool(self._state, participant)
                self.hub.send(participant.pseudonym, state, replaces=True)

    async def openapi(self, _: Request) -> Response:
        """Describe the capture server's addresses and the study's."""
        return json_response(await run_in_threadpool(document, [*OPERATIONS, *STUDY_OPERATIONS]))

    # The participant's phone

    async def texts(self, _: Request) -> Response:
        return await run_in_threadpool(lambda: json_response(self.study.texts.pages))

    async def state(self, request: Request) -> Response:
        participant = await self._participant(request)
        return json_response(await run_in_threadpool(self._state, participant))

    async def events(self, request: Request) -> Response:
        participant = await self._participant(request)
        stream = self.hub.stream(
            participant.pseudonym,
            lambda: self._state(participant),
            live=True,
            changed=self._tell_console,
            device=device_of(request),
        )
        return event_stream(request, stream)

    async def consent(self, request: Request) -> Response:
        answer = await _json(request, wire.Consent)
        return await self._do(request, lambda who: who.consent(answer))

    async def draft(self, request: Request) -> Response:
        step, draft = _step(request), await _json(request, wire.Draft)
        return await self._do(request, lambda who: who.keep_draft(step, draft))

    async def answers(self, request: Request) -> Response:
        step, given = _step(request), await _json(request, wire.Answered)
        return await self._do(request, lambda who: who.answer(step, given))

    async def session(self, request: Request) -> Response:
        step, begun = _step(request), await _json(request, wire.SessionBegun)
        return await self._do(request, lambda who: self.study.grant(who, step, begun))

    async def finish(self, request: Request) -> Response:
        step = _step(request)
        return await self._do(request, lambda who: who.stop(step, by="participant"))

    async def told(self, request: Request) -> Response:
        participant = await self._participant(request)
        told = await _json(request, wire.ToldEvents)
        await run_in_threadpool(participant.tell, told.events, session=told.session)
        self._tell_console()
        return Response(status_code=204)

    # The console

    async def console_events(self, request: Request) -> Response:
        stream = self.hub.stream(CONSOLE, self._console, live=True, device=device_of(request))
        return event_stream(request, stream)

    async def add(self, request: Request) -> Response:
        new_id = id_in_path(request, "new")
        participant, created = await run_in_threadpool(self.study.add, new_id)
        self._tell_console()
        answer = wire.NewParticipant(participant.pseudonym)
        return json_response(answer, status=201 if created else 200)

    async def start(self, request: Request) -> Response:
        step = _step(request)
        return await self._do(request, lambda who: who.start(step))

    async def stop(self, request: Request) -> Response:
        step = _step(request)
        return await self._do(request, lambda who: who.stop(step, by="experimenter"))

    async def repeat(self, request: Request) -> Response:
        step, new_id = _step(request), id_in_path(request, "repetition")
        reason = await _json(request, wire.Reason)
        return await self._do(request, lambda who: who.repeat(step, reason.text, new_id=new_id))

    async def note(self, request: Request) -> Response:
        new_id = id_in_path(request, "note")
        said = await _json(request, wire.Reason)
        return await self._do(request, lambda who: who.note(said.text, new_id=new_id))

    async def exclude(self, request: Request) -> Response:
        said = await _json(request, wire.Reason)
        return await self._do(request, lambda who: who.exclude(said.text))

    async def code(self, request: Request) -> Response:
        """Make a code that pairs a phone for one participant."""
        who = (await self._participant(request)).pseudonym
        pages = [link + who for link in self.config.phone_links]
        grant = Grant("participant", who)
        return json_response(
            await run_in_threadpool(pairing_link, self.config.devices, pages, grant)
        )

    # Inside

    async def _do(self, request: Request, change: Callable[[OpenParticipant], None]) -> Response:
        """Change a participant, tell who looks, and answer with the new state."""
        participant = await self._participant(request)
        state = await run_in_threadpool(self._changed, participant, change)
        self._tell_console()
        return json_response(state)

    def _changed(
        self, participant: OpenParticipant, change: Callable[[OpenParticipant], None]
    ) -> wire.ParticipantState:
        """Change a participant, and tell the phone (in a thread)."""
        change(participant)
        try:
            self.study.forget_images(participant)
        except (OSError, OutputError):  # the participant goes on, and it is tried again
            _log.warning("photos of %s cannot be erased", participant.pseudonym, exc_info=True)
        state = self._state(participant)
        self.hub.send(participant.pseudonym, state, replaces=True)
        return state

    async def _participant(self, request: Request) -> OpenParticipant:
        return await run_in_threadpool(self.study.get, request.path_params["participant"])

    def _state(self, participant: OpenParticipant) -> wire.ParticipantState:
        return participant_state(participant, self.study.texts)

    def _console(self) -> wire.ConsoleState:
        """Return what the console shows (in a thread)."""
        links = [f"{link}{{participant}}" for link in self.config.phone_links]
        return self._view.state(links, on_phone=self.hub.is_live)

    def _tell_console(self) -> None:
        """Have the console told soon; what changes until then is told at once."""
        if self._telling is None and self.hub.is_live(CONSOLE):
            self._telling = asyncio.get_running_loop().create_task(self._tell_soon())

    async def _tell_soon(self) -> None:
        await asyncio.sleep(CONSOLE_PERIOD_S)
        self._telling = None
        state = await run_in_threadpool(self._console)
        self.hub.send(CONSOLE, state, replaces=True)


def create_study_app(
    *,
    study: OpenStudy,
    capture: Starlette,
    config: StudyServerOptions,
    hub: Hub | None = None,
) -> Starlette:
    """Return the application of a study around the one of the capture server.

    Closing the hub ends the streams of events of the study's own pages.
    """
    handlers = _Handlers(study, config, hub or Hub())

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncGenerator[None, None]:
        forgetting = asyncio.ensure_future(handlers.forget_images())
        async with capture.router.lifespan_context(capture):
            yield
        forgetting.cancel()
        handlers.hub.close()

    app = Starlette(
        routes=[
            Route("/study", page(config.client_dir / "study.html")),
            Route("/participant", page(config.client_dir / "participant.html")),
            Mount("/api/v1/study/console", app=_console_app(handlers)),
            Route("/api/v1/openapi.json", handlers.openapi, methods=["GET"]),
            *_participant_routes(handlers),
            Mount("/", app=capture),
        ],
        exception_handlers=_refusals(study.folder),
        lifespan=lifespan,
    )
    app.add_middleware(Guard, devices=config.devices)
    return app


def _participant_routes(handlers: _Handlers) -> list[Route]:
    participant = "/api/v1/study/participants/{participant}"
    return [
        Route("/api/v1/study/texts", handlers.texts, methods=["GET"]),
        Route(participant, handlers.state, methods=["GET"]),
        Route(participant + "/events", handlers.events, methods=["GET"]),
        Route(participant + "/consent", handlers.consent, methods=["PUT"]),
        Route(participant + "/told/{batch}", handlers.told, methods=["PUT"]),
        Route(participant + "/steps/{step}/draft", handlers.draft, methods=["PATCH"]),
        Route(participant + "/steps/{step}/answers", handlers.answers, methods=["PUT"]),
        Route(participant + "/steps/{step}/session", handlers.session, methods=["PUT"]),
        Route(participant + "/steps/{step}/finished", handlers.finish, methods=["PUT"]),
    ]


def _console_app(handlers: _Handlers) -> Starlette:
    participant = "/participants/{participant}"
    step = participant + "/steps/{step}"
    return Starlette(
        routes=[
            Route("/events", handlers.console_events, methods=["GET"]),
            Route("/participants/{new}", handlers.add, methods=["PUT"]),
            Route(step + "/started", handlers.start, methods=["PUT"]),
            Route(step + "/finished", handlers.stop, methods=["PUT"]),
            Route(step + "/repetitions/{repetition}", handlers.repeat, methods=["PUT"]),
            Route(participant + "/notes/{note}", handlers.note, methods=["PUT"]),
            Route(participant + "/excluded", handlers.exclude, methods=["PUT"]),
            Route(participant + "/codes", handlers.code, methods=["POST"]),
        ],
        exception_handlers=_refusals(handlers.study.folder),
    )


def _refusals(folder: Path) -> dict[Any, Any]:
    async def refused(_: Request, error: Exception) -> Response:
        match error:
            case Incomplete():
                described = type_and_title(422, "incomplete")
                return problem_response(
                    wire.AnswersRefused(
                        *described, status=422, detail=str(error), items=error.items
                    )
                )
            case NotNow():
                return problem(409, str(error), kind="out-of-date")
            case TooMuch():
                return problem(413, str(error), kind="too-large")
            case UnknownParticipant():
                return problem(404, str(error))
            case SessionGone():
                return problem(410, str(error), kind="erased" if error.final else "deleted")
            case Busy():
                return busy(error)
            case BadUpload():
                return problem(error.status, str(error), kind=error.kind)
            case HTTPException():
                return problem(error.status_code, error.detail, headers=error.headers)
            case OSError():
                sentence = f"The server could not write to its disk ({error.strerror}). Try again."
                return problem(507, sentence, kind="disk-full")
            case PeakingError():
                return problem(500, without_paths(str(error), folder))
            case _:
                _log.error("a request failed", exc_info=error)
                sentence = f"Something went wrong on the server ({cause_of(error)})."
                return problem(500, sentence)

    return {BadUpload: refused, HTTPException: refused, PeakingError: refused, Exception: refused}


def _step(request: Request) -> str:
    """Return the step of the path: a key that cannot be is one that is not there."""
    try:
        return msgspec.convert(request.path_params["step"], StepKey)
    except msgspec.ValidationError:
        raise HTTPException(404, "There is no such part in this study.") from None


async def _json(request: Request, kind: type[T]) -> T:
    return await read_json(request, kind, status=400)
