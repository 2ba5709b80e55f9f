"""The pages of the built web client."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

NO_CLIENT = "The web client is not built. Run: make client"


def page(path: Path) -> Callable[[Request], Any]:
    """Return the handler of one page: browsers ask each time whether it has changed."""

    async def answer(_: Request) -> Response:
        return FileResponse(path, headers={"Cache-Control": "no-cache"})

    return answer


def client_pages(client_dir: Path) -> list[BaseRoute]:
    """Return everything outside /api; without a built client, how to build it."""
    if not (client_dir / "index.html").is_file():
        return [Route("/{path:path}", _missing)]
    return [
        Route("/", page(client_dir / "index.html")),
        Route("/index.html", _to_the_root),
        Route("/check", page(client_dir / "check.html")),
        Route("/devices", page(client_dir / "devices.html")),
        Route("/sessions", page(client_dir / "sessions.html")),
        Route("/view", page(client_dir / "view.html")),
        Mount("/", StaticFiles(directory=client_dir)),
    ]


async def _missing(request: Request) -> Response:
    if request.url.path.startswith("/api"):
        raise HTTPException(404, "There is nothing at this address.")
    return Response(NO_CLIENT, 503, media_type="text/plain")


async def _to_the_root(_: Request) -> Response:
    return RedirectResponse("/")
