"""The addresses of what is made of a session besides its data set: 3D Gaussians, and points."""

from __future__ import annotations

import contextlib
from collections.abc import Awaitable, Callable

from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from peaking.errors import RecordingError
from peaking.server import wire
from peaking.server.fair_room import FairRoom
from peaking.server.file_answers import FileAnswer, OpenFile
from peaking.server.open_session import OpenSession
from peaking.server.point_answers import captured_points
from peaking.server.requests import device_of, id_in_path, read_json
from peaking.server.responses import LASTING, json_response
from peaking.server.training import Trainings
from peaking.server.turns import Turns

BINARY = "application/octet-stream"
MAX_DIGITS = 16
"""Of a version."""


class MadeHandlers:
    """The handlers, and what they need."""

    def __init__(
        self,
        trainings: Trainings,
        *,
        session_of: Callable[[Request], OpenSession],
        session_to_change: Callable[[Request], Awaitable[OpenSession]],
        pictures: Turns,
        files: FairRoom,
    ) -> None:
        """Take what is shared with other addresses: who may, and whose turn it is."""
        self._trainings = trainings
        self._session_of = session_of
        self._session_to_change = session_to_change
        self._pictures = pictures
        self._files = files

    def routes(self) -> list[Route]:
        """Return the addresses."""
        session = "/api/v1/sessions/{session}"
        training = session + "/training"
        return [
            Route(training, self._training, methods=["GET"]),
            Route(training, self._change, methods=["PUT"]),
            Route(training + "/splat/{version}", self._splat, methods=["GET"]),
            Route(session + "/captures/{capture}/points", self._points, methods=["GET"]),
        ]

    async def _training(self, request: Request) -> Response:
        session = self._session_of(request)
        return json_response(await run_in_threadpool(self._trainings.of, session))

    async def _change(self, request: Request) -> Response:
        session = await self._session_to_change(request)
        if session.owner is not None:
            raise HTTPException(403, "In a study nothing is trained on what participants capture.")
        change = await read_json(request, wire.TrainingChange)
        do = self._trainings.run if change.state == "running" else self._trainings.stop
        return json_response(await run_in_threadpool(do, session))

    async def _splat(self, request: Request) -> Response:
        session = self._session_of(request)
        version = request.path_params["version"]
        path, file = None, None
        if version.isascii() and version.isdigit() and len(version) < MAX_DIGITS:
            path = await run_in_threadpool(self._trainings.splat, session, int(version))
        if path is not None:
            with contextlib.suppress(RecordingError):  # it went meanwhile
                file = await run_in_threadpool(lambda: OpenFile(path, within=session.folder))
        if file is None:
            raise HTTPException(404, "These Gaussians are gone. Ask for the newest.")
        return FileAnswer(file, room=self._files, media_type=BINARY, headers=LASTING)

    async def _points(self, request: Request) -> Response:
        session = self._session_of(request)
        capture = session.shown_capture(id_in_path(request, "capture"))
        data = await self._pictures.do(
            device_of(request), session.id, captured_points, session, capture.id
        )
        if data is None:
            raise HTTPException(404, "There is no depth of this view.")
        return Response(data, media_type=BINARY, headers=LASTING)
