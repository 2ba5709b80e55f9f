"""What requests carry: ids, cookies, who asks, and bodies that are never read beyond a limit."""

from __future__ import annotations

from typing import TypeVar

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.types import Scope

from peaking.foreign_json import decode_json
from peaking.server import wire
from peaking.server.upload import BadUpload, CutOff

MAX_JSON_BYTES = 1_000_000
MAX_STRANGER_BYTES = 4_000
"""Of the body of a request that has shown no secret."""

PAIRED = "peaking.paired"
"""In the scope of a request that has shown one; in its extensions, the function to be told."""

DEVICE = "peaking.device"
"""In the scope of a request: which device has sent it."""

T = TypeVar("T")


def cookie_of(scope: Scope, name: str) -> str | None:
    """Return the first cookie of this name, as it was sent; in time linear in the headers."""
    wanted = name.encode()
    for header, value in scope["headers"]:
        if header == b"cookie":
            for pair in value.split(b";"):
                key, _, content = pair.partition(b"=")
                if key.strip() == wanted:
                    return content.strip().decode("latin-1")
    return None


def mark_paired(scope: Scope, device: str | None = None) -> None:
    """Remember that a request may ask for what it asks; its connection is no stranger's any more.

    Args:
        scope: Of the request.
        device: Who asks, where that is known better than by the address.
    """
    scope[PAIRED] = True
    if device is not None:
        scope[DEVICE] = device
    told = scope.get("extensions", {}).get(PAIRED)
    if told is not None:
        told(device)


def device_of(request: Request) -> str:
    """Return which device asks: the one that was paired, otherwise the address."""
    if DEVICE in request.scope:
        return request.scope[DEVICE]
    return request.client.host if request.client is not None else ""


def declared_bytes(request: Request) -> int:
    """Return how long a body says it is; 0 when it does not say so."""
    declared = request.headers.get("content-length", "0")
    return int(declared) if declared.isdecimal() else 0


def id_in_path(request: Request, name: str) -> str:
    """Return an id of the path.

    Raises:
        HTTPException: 404: no id looks like this one, so nothing has it.
    """
    try:
        return msgspec.convert(request.path_params[name], wire.Id)
    except msgspec.ValidationError:
        raise HTTPException(404, f"This is not a valid {name} id.") from None


def read_query(request: Request, kind: type[T]) -> T:
    """Read what is asked after the question mark as `kind`.

    Raises:
        BadUpload: It is not valid.
    """
    try:
        return msgspec.convert(dict(request.query_params), kind, strict=False)
    except msgspec.ValidationError as error:
        raise BadUpload(f"The question is wrong: {error}.", status=400) from error


async def read_json(request: Request, kind: type[T], *, status: int = 422) -> T:
    """Read a body of JSON as `kind`.

    Raises:
        BadUpload: It is too long, or (with `status`) not valid.
    """
    body = await read_body(request, MAX_JSON_BYTES)
    try:
        return decode_json(body, kind)
    except ValueError as error:
        sentence = f"The JSON of the request is not valid: {error}."
        raise BadUpload(sentence, status=status) from error


async def read_body(request: Request, max_bytes: int) -> bytearray:
    """Read a body, and stop as soon as it is too long.

    It is never copied as a whole: that would keep the event loop waiting.

    Raises:
        BadUpload: It is too long, for anybody or for somebody who is not paired.
        CutOff: It ended too early.
    """
    if PAIRED not in request.scope:
        max_bytes = min(max_bytes, MAX_STRANGER_BYTES)
    body = bytearray()  # one large piece of memory goes back to the system, many small ones do not
    size = declared_bytes(request)
    if size <= max_bytes:
        size = 0
        try:
            async for part in request.stream():
                size += len(part)
                if size > max_bytes:
                    break
                body += part
        except ClientDisconnect:
            raise CutOff("the request ended before its body did") from None
    if size > max_bytes:
        raise BadUpload(
            f"The request has more than {max_bytes:,} bytes.", status=413, kind="too-large"
        )
    return body
