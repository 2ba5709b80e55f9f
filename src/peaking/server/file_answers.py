"""Answers that are files: sent in parts, so that whoever reads slowly costs little memory."""

from __future__ import annotations

import contextlib
import os
import zlib
from collections.abc import Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from starlette.concurrency import iterate_in_threadpool
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.types import Receive, Scope, Send

from peaking.datasets.foreign_files import open_file
from peaking.server.fair_room import FairRoom
from peaking.server.requests import device_of

READ_BYTES = 262_144


class OpenFile:
    """A file as it was when it was opened, whatever becomes of its name; to be closed.

    Attributes:
        size: Bytes.
    """

    def __init__(self, path: Path, *, within: Path) -> None:
        """Open it.

        Raises:
            RecordingError: There is no such file, or links lead to it out of `within`.
        """
        self._file: BinaryIO = open_file(path, within=within)
        self.size = os.fstat(self._file.fileno()).st_size

    def parts(self) -> Generator[bytes]:
        """Yield what is in it, from its beginning.

        Raises:
            OSError: The disk fails.
        """
        self._file.seek(0)
        left = self.size
        while left and (part := self._file.read(min(left, READ_BYTES))):
            left -= len(part)
            yield part

    def read(self) -> bytes:
        """Return what is in it, read at once: no other thread waits for that.

        Raises:
            OSError: The disk fails.
        """
        self._file.seek(0)
        return self._file.read(self.size)

    def checksum(self) -> int:
        """Return the CRC-32 of what is in it.

        Raises:
            OSError: The disk fails.
        """
        checksum = 0
        for part in self.parts():
            checksum = zlib.crc32(part, checksum)
        return checksum

    def close(self) -> None:
        """Close it; again does nothing."""
        self._file.close()


class BoundedStream(StreamingResponse):
    """Sends what a thread makes, as fast as it is taken; takes a place while it does."""

    def __init__(
        self,
        parts: Generator[bytes],
        *,
        room: FairRoom,
        media_type: str,
        headers: Mapping[str, str],
    ) -> None:
        """Take what is sent, and the room for all that is being sent."""
        super().__init__(iterate_in_threadpool(parts), media_type=media_type, headers=headers)
        self._parts = parts
        self._room = room

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it.

        Raises:
            Busy: The device does not read as many to the end as it may ask for.
        """
        with contextlib.closing(self._parts), contextlib.ExitStack() as at_the_end:
            at_the_end.callback(self._room.take(1, device_of(Request(scope))).give_back)
            await super().__call__(scope, receive, send)


class FileAnswer(BoundedStream):
    """Sends a file, and closes it."""

    def __init__(
        self, file: OpenFile, *, room: FairRoom, media_type: str, headers: Mapping[str, str]
    ) -> None:
        """Take the file, and the room for files that are being sent."""
        headers = {"Content-Length": str(file.size), **headers}
        super().__init__(file.parts(), room=room, media_type=media_type, headers=headers)
        self._file = file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it; where only the head is asked for, nothing of it is read.

        Raises:
            Busy: The device does not read as many to the end as it may ask for.
        """
        with contextlib.closing(self._file):
            if scope["method"] == "HEAD":
                await Response(headers=dict(self.headers))(scope, receive, send)
            else:
                await super().__call__(scope, receive, send)


@dataclass(frozen=True)
class Picture:
    """A JPEG, in memory or in an open file, and its checksum."""

    content: bytes | OpenFile
    checksum: int

    @property
    def size(self) -> int:
        """Bytes."""
        return len(self.content) if isinstance(self.content, bytes) else self.content.size


def while_it_lasts(request: Request, picture: Picture, *, room: FairRoom) -> Response:
    """Return what may be taken back: browsers ask each time whether it is still there.

    Args:
        request: Who asks, and what they have.
        picture: What is there; a file is closed when it is sent.
        room: For files that are being sent.
    """
    content = picture.content
    tag = f'"{picture.size:x}-{picture.checksum:08x}"'
    headers = {"Cache-Control": "private, no-cache", "ETag": tag}
    if request.headers.get("if-none-match") == tag:
        if isinstance(content, OpenFile):
            content.close()
        return Response(status_code=304, headers=headers)
    if isinstance(content, OpenFile):
        return FileAnswer(content, room=room, media_type="image/jpeg", headers=headers)
    return Response(content, media_type="image/jpeg", headers=headers)
