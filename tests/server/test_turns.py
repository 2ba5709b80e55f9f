"""Work of which one device can ask much is done in threads of its own, in turns."""

from __future__ import annotations

import asyncio
import gc
import threading
import weakref
from collections.abc import Callable, Coroutine, Generator
from pathlib import Path
from typing import Any

import pytest
from test_app import SESSION, capture_path, client_of

from capture_uploads import SESSION_ID, new_session, upload
from patience import PATIENCE_S
from peaking.server.open_session import OpenSession
from peaking.server.turns import Turns


class Held:
    """Work that waits until it is let go, and tells what was begun."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.at_once: list[int] = []
        self.running = 0
        self.let_go = threading.Event()
        self._lock = threading.Lock()

    def work(self, name: str) -> str:
        with self._lock:
            self.begun.append(name)
            self.running += 1
            self.at_once.append(self.running)
        assert self.let_go.wait(PATIENCE_S)
        with self._lock:
            self.running -= 1
        return name


async def until(true: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not true():
            await asyncio.sleep(0.001)


def in_turns(
    work: Callable[[Turns], Coroutine[Any, Any, None]],
    threads: int = 1,
    session_by_session: bool = False,
) -> None:
    turns = Turns(threads, name="test", session_by_session=session_by_session)
    try:
        asyncio.run(work(turns))
    finally:
        turns.close()


def test_devices_take_turns_and_their_sessions_within_those() -> None:
    held = Held()

    async def work(turns: Turns) -> None:
        asks = [("flooder", f"s{n % 3}", f"flood {n}") for n in range(9)]
        asks += [("phone", "t", "phone 0"), ("phone", "t", "phone 1")]
        answers = [
            asyncio.ensure_future(turns.do(device, session, held.work, name))
            for device, session, name in asks
        ]
        await until(lambda: len(held.begun) == 1)
        held.let_go.set()
        assert sorted(await asyncio.gather(*answers)) == sorted(name for *_, name in asks)

    in_turns(work)
    assert held.begun[:5] == ["flood 0", "flood 1", "phone 0", "flood 2", "phone 1"]
    assert held.at_once == [1] * 11


def test_a_session_has_one_thread_at_most() -> None:
    held = Held()

    async def work(turns: Turns) -> None:
        same = [asyncio.ensure_future(turns.do("a", "same", held.work, "same")) for _ in range(9)]
        other = asyncio.ensure_future(turns.do("a", "other", held.work, "other"))
        await until(lambda: len(held.begun) == 2)
        assert sorted(held.begun) == ["other", "same"]
        held.let_go.set()
        await asyncio.gather(*same, other)

    in_turns(work, threads=4, session_by_session=True)
    assert max(held.at_once) == 2


def test_what_is_raised_is_told() -> None:
    def fails() -> None:
        raise KeyError("x")

    async def work(turns: Turns) -> None:
        for _ in range(3):
            with pytest.raises(KeyError):
                await turns.do("a", "s", fails)

    in_turns(work)


def test_what_nobody_waits_for_any_more_is_not_begun() -> None:
    held = Held()

    async def work(turns: Turns) -> None:
        first = asyncio.ensure_future(turns.do("a", "s", held.work, "first"))
        gone = asyncio.ensure_future(turns.do("a", "s", held.work, "gone"))
        last = asyncio.ensure_future(turns.do("a", "s", held.work, "last"))
        await until(lambda: held.begun == ["first"])
        gone.cancel()
        first.cancel()
        held.let_go.set()
        assert await last == "last"

    in_turns(work)
    assert held.begun == ["first", "last"]


def test_nothing_is_held_on_to() -> None:
    class Large:
        def itself(self) -> Large:
            return self

    async def work(turns: Turns) -> None:
        large = Large()
        seen = weakref.ref(large)
        assert await turns.do("a", "s", large.itself) is large
        del large
        await until(lambda: gc.collect() >= 0 and seen() is None)

    in_turns(work)


def test_it_begins_again_when_it_is_needed_after_its_end() -> None:
    turns = Turns(1, name="test")
    for _ in range(2):
        assert asyncio.run(turns.do("a", "s", lambda: "done")) == "done"
        turns.close()


@pytest.fixture
def stuck(monkeypatch: pytest.MonkeyPatch) -> Generator[threading.Event, None, None]:
    """Sessions whose disk does not answer."""
    goes_on = threading.Event()
    store = OpenSession.store_capture

    def waits(self: OpenSession, *args: Any) -> Any:
        with self._lock:  # pyright: ignore[reportPrivateUsage]
            assert goes_on.wait(PATIENCE_S)
            return store(self, *args)

    monkeypatch.setattr(OpenSession, "store_capture", waits)
    yield goes_on
    goes_on.set()


def test_who_reads_does_not_wait_for_those_who_store(
    tmp_path: Path, stuck: threading.Event
) -> None:
    """There were 40 threads for everything."""
    other = SESSION.replace(SESSION_ID, "5e551011-0000-4000-8000-000000000002")
    with client_of(tmp_path) as client:
        client.put(SESSION, json=new_session())
        client.put(other, json=new_session())
        uploads = [
            threading.Thread(target=client.put, args=(capture_path(n),), kwargs={"content": b})
            for n, b in ((n, upload(n)) for n in range(1, 46))
        ]
        for thread in uploads:
            thread.start()
        answers: list[int] = []

        def read() -> None:
            answers.extend(client.get(path).status_code for path in (SESSION, other))

        reading = threading.Thread(target=read)
        reading.start()
        reading.join(PATIENCE_S / 2)
        assert answers == [200, 200]
        stuck.set()
        for thread in (reading, *uploads):
            thread.join(PATIENCE_S)
