"""The addresses of recordings that are played as the camera."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import TypeVar

from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from peaking.limits import DECODINGS_AT_ONCE
from peaking.server.responses import LASTING, json_response
from peaking.server.traces import Played

T = TypeVar("T")


def routes_of_recordings(recordings: Mapping[str, Played]) -> list[Route]:
    """Return the addresses below /api/v1/recordings."""
    handlers = _RecordingHandlers(recordings)
    recording = "/api/v1/recordings/{recording}"
    frame = recording + "/frames/{index:int}"
    return [
        Route(recording, handlers.index, methods=["GET"]),
        Route(frame + "/photo", handlers.photo, methods=["GET"]),
        Route(frame + "/depth", handlers.depth, methods=["GET"]),
    ]


class _RecordingHandlers:
    """The handlers, and what they need."""

    def __init__(self, recordings: Mapping[str, Played]) -> None:
        self.recordings = recordings
        self.decoding = asyncio.Semaphore(DECODINGS_AT_ONCE)

    async def index(self, request: Request) -> Response:
        recording = self._recording(request)
        return json_response(await run_in_threadpool(lambda: recording.index))

    async def photo(self, request: Request) -> Response:
        recording = self._recording(request)
        async with self.decoding:
            data = await run_in_threadpool(_or_404, recording.photo, request.path_params["index"])
        return Response(data, media_type="image/jpeg", headers=LASTING)

    async def depth(self, request: Request) -> Response:
        recording = self._recording(request)
        async with self.decoding:
            data = await run_in_threadpool(_or_404, recording.depth, request.path_params["index"])
        if data is None:
            raise HTTPException(404, "This frame has no depth.")
        return Response(data, media_type="application/octet-stream", headers=LASTING)

    def _recording(self, request: Request) -> Played:
        recording = self.recordings.get(request.path_params["recording"])
        if recording is None:
            raise HTTPException(404, "This server has no recording of that name.")
        return recording


def _or_404(call: Callable[[int], T], index: int) -> T:
    try:
        return call(index)
    except IndexError as error:
        raise HTTPException(404, f"No such frame: {error}.") from None
