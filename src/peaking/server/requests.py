"""What requests carry: ids in their path, and bodies that are never read beyond a limit."""

from __future__ import annotations

from typing import TypeVar

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request

from peaking.server import wire
from peaking.server.upload import BadUpload

MAX_JSON_BYTES = 1_000_000

T = TypeVar("T")


def id_in_path(request: Request, name: str) -> str:
    """Return an id of the path.

    Raises:
        HTTPException: 404: no id looks like this one, so nothing has it.
    """
    try:
        return msgspec.convert(request.path_params[name], wire.Id)
    except msgspec.ValidationError:
        raise HTTPException(404, f"This is not a valid {name} id.") from None


async def read_json(request: Request, kind: type[T], *, status: int = 422) -> T:
    """Read a body of JSON as `kind`.

    Raises:
        BadUpload: It is too long, or (with `status`) not valid.
    """
    body = await read_body(request, MAX_JSON_BYTES)
    try:
        return msgspec.json.decode(body, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        sentence = f"The JSON of the request is not valid: {error}."
        raise BadUpload(sentence, status=status) from error


async def read_body(request: Request, max_bytes: int) -> bytes:
    """Read a body, and stop as soon as it is too long.

    Raises:
        BadUpload: It is too long.
    """
    declared = request.headers.get("content-length", "0")
    parts: list[bytes] = []
    size = int(declared) if declared.isdigit() else 0
    if size <= max_bytes:
        size = 0
        async for part in request.stream():
            size += len(part)
            if size > max_bytes:
                break
            parts.append(part)
    if size > max_bytes:
        raise BadUpload(
            f"The request has more than {max_bytes:,} bytes.", status=413, kind="too-large"
        )
    return b"".join(parts)
