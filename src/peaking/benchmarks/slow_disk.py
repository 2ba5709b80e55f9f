"""A server whose disk is slow, and that writes down how late its event loop is."""

from __future__ import annotations

import asyncio
import os
import socket
import time
from pathlib import Path

from peaking.server import serving

FLUSH_S = 0.15
TICK_S = 0.005


def begin(lateness: str) -> None:
    """Let every flush of this process take 150 ms, and its server keep a file up to date.

    Args:
        lateness: Gets a line for every 5 ms: how much later the loop was than asked for, ms.
    """
    flush = os.fsync

    def slowly(descriptor: int) -> None:
        time.sleep(FLUSH_S)
        flush(descriptor)

    os.fsync = slowly
    start = serving.Server.startup

    async def watched(self: serving.Server, sockets: list[socket.socket] | None = None) -> None:
        await start(self, sockets)
        self.watching = asyncio.create_task(_watch(Path(lateness)))  # type: ignore[attr-defined]

    serving.Server.startup = watched


async def _watch(path: Path) -> None:
    loop = asyncio.get_running_loop()
    with path.open("a", buffering=1) as file:
        while True:
            due_s = loop.time() + TICK_S
            await asyncio.sleep(TICK_S)
            file.write(f"{(loop.time() - due_s) * 1e3:.3f}\n")
