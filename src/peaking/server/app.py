"""The HTTP application: every address of docs/protocol.md, and the pages of the web client.

Handlers only translate: disk and CPU work is done in threads, never on the event loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import mimetypes
from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

import peaking
from peaking.errors import PeakingError
from peaking.limits import DECODINGS_AT_ONCE
from peaking.options import DEFAULT, Options
from peaking.server import wire
from peaking.server.admission import Admission, Everybody, NotAdmitted
from peaking.server.auth import KNOWN, Guard
from peaking.server.bodies import BoundedBodies
from peaking.server.conversion import converted, zipped_folder
from peaking.server.dataset import zip_stream
from peaking.server.device_routes import DeviceHandlers, looked_after
from peaking.server.devices import Device, Devices
from peaking.server.disk_full import DiskFull
from peaking.server.events import SERVER, Hub
from peaking.server.fair_room import Busy, FairRoom
from peaking.server.file_answers import BoundedStream, FileAnswer, while_it_lasts
from peaking.server.generation import GenerationQueue
from peaking.server.guidance import GuidanceWorker
from peaking.server.keeper import MOST_AUTOMATIC, Keeper
from peaking.server.open_session import NotRestorable, OpenSession, SessionClosed, SessionGone
from peaking.server.openapi import document
from peaking.server.pages import client_pages
from peaking.server.recording_routes import routes_of_recordings
from peaking.server.requests import device_of, id_in_path, read_body, read_json, read_query
from peaking.server.responses import (
    LASTING,
    attachment,
    busy,
    event_stream,
    json_response,
    problem,
)
from peaking.server.selection import DamagedMpi, Selections, chosen_files
from peaking.server.session_state import UnknownCapture
from peaking.server.sessions import SessionStore, UnknownSession
from peaking.server.shown_files import shown_photo, shown_thumbnail, sound_mpi
from peaking.server.told import cause_of, without_paths
from peaking.server.traces import Played
from peaking.server.training import STEPS, Trainings
from peaking.server.training_routes import MadeHandlers
from peaking.server.turns import Turns
from peaking.server.upload import BadUpload, check_protocol, parse_upload
from peaking.server.warm_up import WarmUp

ERASED_EVERY_S = 3600.0
STORED_AT_ONCE = 4
"""Threads that wait for a session's lock or a flush: whoever only reads has others."""

MAX_FILES = 128
"""Files that are being sent at once; one device alone may have half of them."""

MAX_ZIPS = 16
"""The same of data sets: each may have a photo in memory."""

MAX_SELECTIONS = 8
"""Questions for a selection that may wait; one device alone may ask half of them."""

P = ParamSpec("P")
T = TypeVar("T")
_log = logging.getLogger("peaking.server")


@dataclass(frozen=True)
class ServerOptions:
    """What a server serves, and to whom.

    Attributes:
        devices: May ask for what is below /api; None lets in whoever is on this machine.
        client_dir: The built web client.
        options: How clients render and compare, and how MPIs are made.
        recordings: What can be played as the camera, by name.
        max_upload_bytes: Larger uploads are refused.
        pages: What a device opens that is paired by another one; its address, the best first.
        keep_exif: Photos keep their metadata: where, when and with what they were taken.
        most_automatic: Views of a session that the automatic shutter took and that stay in its
            data set.
        training_steps: Of a training of 3D Gaussians.
    """

    devices: Devices | None
    client_dir: Path
    options: Options = DEFAULT
    recordings: Mapping[str, Played] = field(default_factory=dict[str, Played])
    max_upload_bytes: int = 64_000_000
    pages: Sequence[str] = ()
    keep_exif: bool = False
    most_automatic: int = MOST_AUTOMATIC
    training_steps: int = STEPS

    def __post_init__(self) -> None:
        """Refuse what no client can do.

        Raises:
            ValueError: More views are to be blended than clients blend.
        """
        if self.options.neighbours > wire.MAX_NEIGHBOURS:
            raise ValueError(
                f"need neighbours <= {wire.MAX_NEIGHBOURS}, which is what clients can blend, "
                f"got {self.options.neighbours}"
            )


class _Handlers:
    """The handlers, and what they need."""

    def __init__(
        self,
        store: SessionStore,
        config: ServerOptions,
        hub: Hub,
        admission: Admission,
        warm_up: WarmUp,
    ) -> None:
        """Begin to make the MPIs that are missing."""
        self.store = store
        self.admission = admission
        self.config = config
        self.hub = hub
        self.warm_up = warm_up
        self._storing = Turns(STORED_AT_ONCE, name="store", session_by_session=True)
        self._pictures = Turns(DECODINGS_AT_ONCE, name="picture")
        self._selecting = Turns(1, name="select")  # it computes for seconds
        self._selections = Selections(config.options)
        self._waiting_selections = FairRoom(MAX_SELECTIONS)
        self._files = FairRoom(MAX_FILES)
        self._zips = FairRoom(MAX_ZIPS)
        self._converting = Turns(1, name="convert")
        self.queue = GenerationQueue(config.options, on_done=self._made, warm_up=warm_up)
        self.keeper = Keeper(
            config.options,
            on_set_aside=self._set_aside,
            may_work=lambda: self.queue.at_rest,
            most_automatic=config.most_automatic,
        )
        self.guidance = GuidanceWorker(
            config.options,
            on_new=self._tell_guidance,
            is_busy=lambda: not (self.queue.idle and warm_up.done),
        )
        self.trainings = Trainings(
            on_change=self._tell_training,
            is_busy=lambda: not (self.queue.at_rest and warm_up.done),
            steps=config.training_steps,
        )
        self.made = MadeHandlers(
            self.trainings,
            session_of=self._session,
            session_to_change=self._session_to_change,
            pictures=self._pictures,
            files=self._files,
        )
        store.when_erased(self._erased)
        for session in store.sessions():
            self._make_missing(session)

    async def erase_expired(self) -> None:
        """Erase, as long as this runs, what was deleted too long ago to be restored."""
        while True:
            await asyncio.sleep(ERASED_EVERY_S)
            try:
                await run_in_threadpool(self.store.erase_expired)
            except (OSError, PeakingError):  # a full disk: tried again
                _log.warning("sessions deleted 30 days ago could not be erased", exc_info=True)

    def close(self) -> None:
        """End streams and threads, and let another process have the folder."""
        self.hub.close()
        for turns in (self._storing, self._pictures, self._selecting, self._converting):
            turns.close()
        self.trainings.close()
        self.guidance.close()
        self.queue.close()
        self.keeper.close()
        self.store.close()

    # What is there

    async def info(self, _: Request) -> Response:
        options = self.config.options
        return json_response(
            wire.ServerInfo(
                protocol=wire.PROTOCOL,
                version=peaking.__version__,
                options=wire.options_for_clients(options),
                recordings=list(self.config.recordings),
                warm=self.warm_up.done,
                warm_share=self.warm_up.share,
                max_upload_bytes=self.config.max_upload_bytes,
            )
        )

    async def openapi(self, _: Request) -> Response:
        return json_response(await run_in_threadpool(document))

    async def sessions(self, _: Request) -> Response:
        return await run_in_threadpool(lambda: json_response(self._summaries()))

    async def session(self, request: Request) -> Response:
        session = self._any_session(request)
        return await run_in_threadpool(lambda: json_response(self._state(session)))

    async def session_events(self, request: Request) -> Response:
        session = self._session(request)

        def came_or_went() -> None:
            self._tell_summary(session)

        stream = self.hub.stream(
            session.id,
            lambda: wire.SessionState(self._state(session)),
            live="watch" not in request.query_params,
            changed=came_or_went,
            device=device_of(request),
        )
        return event_stream(request, stream)

    async def server_events(self, request: Request) -> Response:
        stream = self.hub.stream(SERVER, self._list, device=device_of(request))
        return event_stream(request, stream)

    # Sessions

    async def begin_session(self, request: Request) -> Response:
        session_id = id_in_path(request, "session")
        with contextlib.suppress(UnknownSession):
            self.store.get(session_id)  # one that is gone is gone, whoever asks
        self._refuse_others(request, session_id)
        new = await read_json(request, wire.NewSession)
        check_protocol(new.protocol, by="client")
        session, created = await self._changing(request, session_id, self._begin, session_id, new)
        if created:
            self._tell_summary(session)
        state = await run_in_threadpool(self._state, session)
        return json_response(state, status=201 if created else 200)

    async def change_session(self, request: Request) -> Response:
        session = self._any_session(request)
        change = await read_json(request, wire.SessionChange)
        if change.deleted is None:
            await run_in_threadpool(self.admission.to_add, session.id)
        else:
            await run_in_threadpool(self.admission.to_end, session.id)
        if change.deleted is False:
            await self._changing(request, session.id, self.store.restore, session.id)
            await run_in_threadpool(self.trainings.allow, session)
            await run_in_threadpool(self._make_missing, session)
        if change.name is not None:
            await self._changing(request, session.id, session.rename, change.name)
        if change.finished is not None:
            await self._changing(request, session.id, session.finish, change.finished)
        if change.deleted is True:
            await self._end_session(request, session.id, self.store.delete)
        self._tell_summary(session)
        return json_response(self._summary(session))

    async def erase_session(self, request: Request) -> Response:
        session_id = id_in_path(request, "session")
        await run_in_threadpool(self.admission.to_end, session_id)
        await self._end_session(request, session_id, self.store.erase)
        return Response(status_code=204)

    async def selection(self, request: Request) -> Response:
        session = self._session(request)
        query = read_query(request, wire.SelectionQuery)
        return json_response(await self._selected(request, session, query))

    async def guided(self, request: Request) -> Response:
        return json_response(self.guidance.of(self._session(request)))

    async def dataset(self, request: Request) -> Response:
        session = self._session(request)
        asked = read_query(request, wire.DatasetQuery)
        views = asked.views
        if views is None:
            name = session.folder.name
            files = await self._changing(request, session.id, session.dataset_files)
        else:
            name = f"{session.folder.name}-best"
            query = wire.SelectionQuery(views=None if views == "auto" else views)
            selection = await self._selected(request, session, query)
            files = await self._changing(request, session.id, chosen_files, session, selection)
        name += "" if asked.format == "nerfstudio" else f"-{asked.format}"
        headers = attachment(f"{name}.zip")
        if request.method == "HEAD":
            return Response(media_type="application/zip", headers=headers)
        keep_exif = self.config.keep_exif
        if asked.format == "nerfstudio":
            zipped = zip_stream(files, session.folder, keep_exif=keep_exif)
        else:
            device, to = device_of(request), asked.format
            folder = await self._converting.do(
                device, session.id, converted, session, files, to, keep_exif=keep_exif
            )
            zipped = zipped_folder(folder)
        return BoundedStream(zipped, room=self._zips, media_type="application/zip", headers=headers)

    async def peaked(self, request: Request) -> Response:
        session = self._session(request)
        return json_response(wire.PeakedSamples(await run_in_threadpool(session.peaked)))

    async def add_peaked(self, request: Request) -> Response:
        session = await self._session_to_change(request)
        id_in_path(request, "batch")
        told = await read_json(request, wire.PeakedSamples)
        await self._changing(request, session.id, session.add_peaked, told.samples)
        self.guidance.walked(session, len(told.samples))
        self._tell_summary(session)
        return Response(status_code=204)

    # Captures

    async def upload(self, request: Request) -> Response:
        session = self._session(request)
        capture_id, arrived_s = id_in_path(request, "capture"), session.now_s
        with contextlib.suppress(UnknownCapture):
            return json_response(session.capture(capture_id))
        place = self.queue.reserve(device_of(request), session)
        try:
            body = await read_body(request, self.config.max_upload_bytes)
            capture, created = await self._changing(
                request, session.id, self._keep, session, capture_id, body, arrived_s
            )
        except BaseException:
            place.give_back()
            raise
        if created:  # the answer is sent before the thread that makes MPIs has its turn
            self._tell_capture(session, capture)
            self.queue.put(session, capture_id, place)
        else:
            place.give_back()
        return json_response(capture, status=201 if created else 200)

    async def remove(self, request: Request) -> Response:
        return await self._end(request, wire.CaptureChange("undone"))

    async def change_capture(self, request: Request) -> Response:
        return await self._end(request, await read_json(request, wire.CaptureChange))

    async def _end(self, request: Request, change: wire.CaptureChange) -> Response:
        """Undo, set aside, erase or restore a capture."""
        session = await self._session_to_change(request)
        capture_id = id_in_path(request, "capture")
        if change.ending == "erased":
            await run_in_threadpool(self.admission.to_end, session.id)
        match change.ending:
            case "undone":
                do = session.remove_capture
            case "set_aside":
                do = session.set_aside
            case "erased":
                do = session.erase_capture
            case None:
                do = session.restore_capture
        if change.ending == "erased":
            self.guidance.forget(session.id)
        was_away = session.capture(capture_id).removed
        capture = await self._changing(request, session.id, do, capture_id)
        if was_away and not capture.removed:
            await run_in_threadpool(self._make_missing, session)
        if change.ending == "erased":  # it is in what was trained on it, too
            await run_in_threadpool(self.trainings.forget, session)
        self._tell_capture(session, capture)
        self.guidance.want(session)
        await self._changing(request, session.id, session.refresh_dataset)
        return json_response(capture)

    async def mpi(self, request: Request) -> Response:
        session = self._session(request)
        capture = session.shown_capture(id_in_path(request, "capture"))
        if capture.state != "ready":
            raise HTTPException(404, "There is no MPI of this capture yet.")
        version = request.path_params.get("version", "1")
        if version not in map(str, range(1, capture.mpi_version + 1)):
            raise HTTPException(404, "There is no such version of this MPI.")
        file = await run_in_threadpool(sound_mpi, session, capture.id, int(version))
        if file is None:
            if capture.mpi_version > int(version):
                raise HTTPException(404, "This version is gone. Ask for the newest.")
            await self._changing(request, session.id, self.queue.make_again, session, capture)
            raise HTTPException(404, "This MPI was damaged on the disk. It is being made again.")
        return FileAnswer(
            file, room=self._files, media_type="application/octet-stream", headers=LASTING
        )

    async def photo(self, request: Request) -> Response:
        session = self._session(request)
        capture = session.shown_capture(id_in_path(request, "capture"))
        picture = await self._pictures.do(
            device_of(request), session.id, shown_photo, session, capture, self.config.keep_exif
        )
        return while_it_lasts(request, picture, room=self._files)

    async def thumbnail(self, request: Request) -> Response:
        session = self._session(request)
        capture = session.shown_capture(id_in_path(request, "capture"))
        picture = await self._pictures.do(
            device_of(request), session.id, shown_thumbnail, session, capture.id
        )
        return while_it_lasts(request, picture, room=self._files)

    # Inside

    async def _selected(
        self, request: Request, session: OpenSession, query: wire.SelectionQuery
    ) -> wire.Selection:
        device = device_of(request)
        place = self._waiting_selections.take(1, device)
        try:
            return await self._selecting.do(
                device, session.id, self._selections.ask, session, query
            )
        except DamagedMpi as error:
            await self._changing(request, session.id, self.queue.make_again, session, error.capture)
            raise Busy(1) from error
        finally:
            place.give_back()

    async def _end_session(
        self, request: Request, session_id: str, end: Callable[[str], object]
    ) -> None:
        """Delete or erase a session, on which nothing is trained from then on."""
        await run_in_threadpool(self.trainings.end, session_id)
        try:
            await self._changing(request, session_id, end, session_id)
        except BaseException:
            with contextlib.suppress(PeakingError):  # it is gone all the same
                await run_in_threadpool(self.trainings.allow, self.store.get(session_id))
            raise
        await run_in_threadpool(self.trainings.end, session_id)  # what was asked for meanwhile

    async def _changing(
        self,
        request: Request,
        session_id: str,
        change: Callable[P, T],
        *args: P.args,
        **kwargs: P.kwargs,
    ) -> T:
        """Do what waits for a session's lock, when it is the turn of the device that asks."""
        return await self._storing.do(device_of(request), session_id, change, *args, **kwargs)

    def _keep(
        self, session: OpenSession, capture_id: str, body: bytearray, arrived_s: float
    ) -> tuple[wire.Capture, bool]:
        """Store an upload that is admitted; return it, and whether it is new (in a thread)."""
        self.admission.to_add(session.id)
        upload = parse_upload(body, keep_exif=self.config.keep_exif)
        return session.store_capture(capture_id, upload, arrived_s=arrived_s)

    def _made(self, session: OpenSession, capture: wire.Capture) -> None:
        """Tell that an MPI is ready, then write what may come later (in a worker thread)."""
        self._tell_capture(session, capture)
        self.guidance.want(session)
        if self.queue.idle:  # otherwise the next one does it
            session.refresh_dataset()
        if capture.automatic:
            self.keeper.look(session)

    def _set_aside(self, session: OpenSession, capture: wire.Capture) -> None:
        """Tell that a view was set aside by the program (in its thread)."""
        self._tell_capture(session, capture)
        session.refresh_dataset()

    def _erased(self, session_id: str) -> None:
        """End the streams of a session that is erased: who listened asks again, and hears of it."""
        self._selections.forget(session_id)
        self.keeper.forget(session_id)
        self.hub.end(session_id)
        self.guidance.forget_for_ever(session_id)
        self.hub.send(SERVER, self._list())

    def _make_missing(self, session: OpenSession) -> None:
        """Have the MPIs made that a session needs and has not."""
        for capture_id in session.unfinished(self.config.options.generator):
            self.queue.put(session, capture_id)

    def _list(self) -> wire.SessionList:
        found = map(self._summary, self.store.all_sessions())
        sessions = [summary for summary in found if not summary.is_empty]
        problems = [without_paths(problem, self.store.root) for problem in self.store.problems]
        return wire.SessionList(sessions, problems)

    def _tell_capture(self, session: OpenSession, capture: wire.Capture) -> None:
        self.hub.send(session.id, wire.CaptureChanged(capture))
        self.trainings.changed(session)
        self._tell_summary(session)

    def _tell_guidance(self, session: OpenSession, revision: int) -> None:
        self.hub.send(session.id, wire.GuidanceChanged(revision))

    def _tell_training(self, session: OpenSession, training: wire.Training) -> None:
        self.hub.send(session.id, wire.TrainingChanged(training))

    def _tell_summary(self, session: OpenSession) -> None:
        event = wire.SessionChanged(self._summary(session))
        self.hub.send(session.id, event)
        self.hub.send(SERVER, event)

    def _state(self, session: OpenSession) -> wire.Session:
        return session.session(live=self.hub.is_live(session.id))

    def _summaries(self) -> list[wire.SessionSummary]:
        found = map(self._summary, self.store.sessions())
        return [summary for summary in found if not summary.is_empty]

    def _summary(self, session: OpenSession) -> wire.SessionSummary:
        return session.summary(live=self.hub.is_live(session.id))

    def _session(self, request: Request) -> OpenSession:
        session = self.store.get(id_in_path(request, "session"))
        self._refuse_others(request, session.id)
        return session

    async def _session_to_change(self, request: Request) -> OpenSession:
        """Return a session that may be added to."""
        session = self._session(request)
        await run_in_threadpool(self.admission.to_add, session.id)
        return session

    def _begin(self, session_id: str, new: wire.NewSession) -> tuple[OpenSession, bool]:
        owner = self.admission.to_begin(session_id)
        return self.store.begin(session_id, new, owner=owner)

    def _any_session(self, request: Request) -> OpenSession:
        """Return a session that may be deleted."""
        session = self.store.get_any(id_in_path(request, "session"))
        self._refuse_others(request, session.id)
        return session

    def _refuse_others(self, request: Request, session_id: str) -> None:
        """Refuse a participant's phone what is another participant's."""
        device: Device | None = request.scope.get(KNOWN)
        if device is None or device.role != "participant":
            return
        if self.admission.owner(session_id) not in device.participants:
            raise NotAdmitted("This capture is another participant's.")


def create_app(
    *,
    store: SessionStore,
    config: ServerOptions,
    hub: Hub | None = None,
    admission: Admission | None = None,
    warm_up: WarmUp | None = None,
) -> Starlette:
    """Return the application; a test can hold ten of them.

    Args:
        store: The sessions.
        config: What is served, and to whom.
        hub: Ends all streams of events when it is closed; one of its own by default.
        admission: Who may begin sessions and add to them; everybody by default.
        warm_up: What is done first; tells how far it is.
    """
    mimetypes.init()  # reads files; Starlette would do that on the event loop
    server = _Handlers(store, config, hub or Hub(), admission or Everybody(), warm_up or WarmUp())

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncGenerator[None, None]:
        erasing = asyncio.ensure_future(server.erase_expired())
        async with looked_after(config.devices):
            yield
        erasing.cancel()
        server.close()

    app = Starlette(
        routes=[
            *_api_routes(server),
            *server.made.routes(),
            *DeviceHandlers(config.devices, config.pages).routes(),
            *routes_of_recordings(config.recordings),
            *client_pages(config.client_dir),
        ],
        exception_handlers=_handlers(store.root),
        lifespan=lifespan,
    )
    app.add_middleware(BoundedBodies, largest_bytes=config.max_upload_bytes)
    app.add_middleware(Guard, devices=config.devices)
    return app


def _api_routes(server: _Handlers) -> list[Route]:
    """Return the addresses below /api."""
    session = "/api/v1/sessions/{session}"
    capture = session + "/captures/{capture}"
    return [
        Route("/api/v1/server", server.info, methods=["GET"]),
        Route("/api/v1/openapi.json", server.openapi, methods=["GET"]),
        Route("/api/v1/events", server.server_events, methods=["GET"]),
        Route("/api/v1/sessions", server.sessions, methods=["GET"]),
        Route(session, server.session, methods=["GET"]),
        Route(session, server.begin_session, methods=["PUT"]),
        Route(session, server.change_session, methods=["PATCH"]),
        Route(session, server.erase_session, methods=["DELETE"]),
        Route(session + "/events", server.session_events, methods=["GET"]),
        Route(session + "/peaked", server.peaked, methods=["GET"]),
        Route(session + "/peaked/{batch}", server.add_peaked, methods=["PUT"]),
        Route(session + "/selection", server.selection, methods=["GET"]),
        Route(session + "/guidance", server.guided, methods=["GET"]),
        Route(session + "/dataset.zip", server.dataset, methods=["GET"]),
        Route(capture, server.upload, methods=["PUT"]),
        Route(capture, server.remove, methods=["DELETE"]),
        Route(capture, server.change_capture, methods=["PATCH"]),
        Route(capture + "/mpi", server.mpi, methods=["GET"]),
        Route(capture + "/mpi/{version}", server.mpi, methods=["GET"]),
        Route(capture + "/photo", server.photo, methods=["GET"]),
        Route(capture + "/thumbnail", server.thumbnail, methods=["GET"]),
    ]


def _handlers(root: Path) -> Mapping[Any, Any]:
    async def refused(_: Request, error: Exception) -> Response:
        if isinstance(error, BadUpload):
            return problem(error.status, str(error), kind=error.kind)
        if isinstance(error, Busy):
            return busy(error)
        if isinstance(error, HTTPException):
            return problem(error.status_code, error.detail, headers=error.headers)
        if isinstance(error, UnknownSession | UnknownCapture):
            return problem(404, str(error))
        if isinstance(error, SessionGone):
            return problem(410, str(error), kind="erased" if error.final else "deleted")
        if isinstance(error, NotAdmitted):
            return problem(403, str(error), kind="not-admitted")
        if isinstance(error, SessionClosed):
            return problem(409, str(error), kind="finished")
        if isinstance(error, NotRestorable):
            return problem(409, str(error))
        if isinstance(error, DiskFull):
            return problem(507, str(error), kind="disk-full")
        _log.error("a request failed", exc_info=error)
        if isinstance(error, PeakingError):
            return problem(500, without_paths(str(error), root))
        sentence = (
            f"Something went wrong on the server ({cause_of(error)}). Its log has the details."
        )
        return problem(500, sentence)

    return {BadUpload: refused, HTTPException: refused, PeakingError: refused, Exception: refused}
