"""Serves one place to browsers of this machine; each of its files is made when it is asked for."""

from __future__ import annotations

import contextlib
import json
import mimetypes
import socket
import sys
import threading
from collections.abc import Callable, Mapping
from functools import lru_cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, cast
from urllib.parse import unquote, urlsplit

from peaking.errors import PeakingError
from peaking.share import viewer_files
from peaking.share.place import SharedPlace
from peaking.share.single_file import with_title

HOSTS = frozenset({"localhost", "127.0.0.1", "::1"})
"""Names of this machine: pages elsewhere that have themselves called otherwise get nothing."""
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript",
    ".css": "text/css",
    ".json": "application/json",
    ".wasm": "application/wasm",
    ".svg": "image/svg+xml",
    ".jpg": "image/jpeg",
}
_OTHER = "application/octet-stream"


class PlaceServer(ThreadingHTTPServer):
    """Answers from memory: nothing is written anywhere."""

    daemon_threads = True

    def __init__(self, listener: socket.socket, shared: SharedPlace, client_dir: Path) -> None:
        """Answer on a socket that listens.

        Raises:
            ToolMissing: The web client is not built.
        """
        super().__init__(listener.getsockname()[:2], _Handler, bind_and_activate=False)
        self.socket.close()
        self.socket = listener
        self.files = files_of(shared, client_dir)
        self._first = shared.place.views[shared.place.start].mpi

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of browsers that went away, and all of what is a fault here."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)

    def warm_up(self) -> None:
        """Make the image that is looked at first, beside what else is done.

        The first one takes longest: compiled code is loaded with it.
        """
        if self._first is not None:
            threading.Thread(target=self._make_quietly, args=[self._first], daemon=True).start()

    def _make_quietly(self, name: str) -> None:
        with contextlib.suppress(PeakingError):  # it is told to whoever asks
            self.files[name]()

    @property
    def port(self) -> int:
        """Where it answers."""
        return int(self.socket.getsockname()[1])


def files_of(shared: SharedPlace, client_dir: Path) -> Mapping[str, Callable[[], bytes]]:
    """Return what makes the answer at each path, once: images one at a time, and so the rest.

    Thumbnails of large photographs are not waited for.

    Raises:
        ToolMissing: The web client is not built.
    """
    page = with_title(viewer_files.page(client_dir), shared.place.title).encode()
    fixed = {"": page, "index.html": page, "place.json": shared.place.to_json()}
    fixed |= viewer_files.assets(client_dir)
    images, others = threading.Lock(), threading.Lock()

    def kept(make: Callable[[], bytes], alone: threading.Lock) -> Callable[[], bytes]:
        made = lru_cache(maxsize=1)(make)

        def answer() -> bytes:
            with alone:
                return made()

        return answer

    return {
        **{name: (lambda data=data: data) for name, data in fixed.items()},
        **{
            name: kept(make, images if name.endswith(".mpi") else others)
            for name, make in shared.files.items()
        },
    }


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = 60

    def do_GET(self) -> None:
        """Answer with a file."""
        server = cast("PlaceServer", self.server)
        if _host(self.headers.get("Host", "")) not in HOSTS:
            self._refuse(403, "This address is not one of this machine.")
            return
        make = server.files.get(unquote(urlsplit(self.path).path).removeprefix("/"))
        if make is None:
            self._refuse(404, "There is nothing at this address.")
            return
        try:
            data = make()
        except PeakingError as error:
            self._refuse(422, str(error))
            return
        self._answer(200, self._type(), data)

    do_HEAD = do_GET  # noqa: N815

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing of requests."""

    def _type(self) -> str:
        ending = Path(urlsplit(self.path).path).suffix or ".html"
        return _TYPES.get(ending) or mimetypes.guess_type(f"a{ending}")[0] or _OTHER

    def _refuse(self, status: int, detail: str) -> None:
        problem = {"status": status, "detail": detail}
        self._answer(status, "application/problem+json", json.dumps(problem).encode())

    def _answer(self, status: int, kind: str, data: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Cache-Control", "no-cache")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)


def _host(header: str) -> str | None:
    """Return the name in a Host header, without its port."""
    try:
        return urlsplit(f"//{header}").hostname
    except ValueError:
        return None
