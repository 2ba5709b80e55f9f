"""Room and turns that devices share."""

from __future__ import annotations

import asyncio
import queue
import threading
from collections import Counter
from collections.abc import Callable, Coroutine
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patience import PATIENCE_S
from peaking.server.fair_queue import FairQueue
from peaking.server.fair_room import SPREAD_S, Busy, FairRoom, Share


def on_a_loop(work: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(work())


def taken_by(room: FairRoom, device: str, session: Callable[[int], str | None]) -> int:
    """Return how many places a device gets that wants all."""
    for number in range(10_000):
        try:
            room.take(1, device, session(number))
        except Busy:
            return number
    raise AssertionError("there is no bound")


def test_one_device_alone_gets_half_and_leaves_room_for_more() -> None:
    async def work() -> None:
        room = FairRoom(64)
        assert taken_by(room, "a", lambda _: None) == 32
        assert taken_by(room, "b", lambda _: None) == 16
        assert taken_by(room, "c", lambda _: None) == 8
        assert room.taken == 56

    on_a_loop(work)


def test_sessions_by_the_dozen_gain_nothing() -> None:
    async def work() -> None:
        one, many = FairRoom(64), FairRoom(64)
        taken_by(one, "flooder", lambda _: None)
        taken_by(many, "flooder", str)
        assert many.taken <= one.taken

    on_a_loop(work)


def test_a_session_gets_few_places_and_leaves_some_for_others() -> None:
    async def work() -> None:
        room = FairRoom(512)
        assert taken_by(room, "a", lambda _: "one") == 51
        for session in range(100):
            room.take(1, "a", f"phone {session}")  # each of a hundred phones gets one

    on_a_loop(work)


def test_what_is_given_back_can_be_taken_again_and_counts_once() -> None:
    async def work() -> None:
        room = FairRoom(10)
        share = room.take(5, "a", "s")
        with pytest.raises(Busy):
            room.take(1, "a")
        thread = threading.Thread(target=share.give_back)
        thread.start()
        thread.join()
        share.give_back()
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert room.taken == 0
        room.take(5, "a", "s")

    on_a_loop(work)


def test_those_who_are_refused_come_back_at_different_times() -> None:
    async def work() -> None:
        room, times = FairRoom(0), Counter[int]()
        for _ in range(10 * SPREAD_S):
            with pytest.raises(Busy) as refused:
                room.take(1, "a")
            times[refused.value.retry_after_s] += 1
        assert times == dict.fromkeys(range(1, SPREAD_S + 1), 10)

    on_a_loop(work)


@given(st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from("xy"), st.integers(0, 9))))
def test_the_room_is_never_more_than_full(wanted: list[tuple[str, str, int]]) -> None:
    async def work() -> None:
        room, shares = FairRoom(20), list[Share]()
        for device, session, amount in wanted:
            try:
                shares.append(room.take(amount, device, session))
            except Busy:
                for share in shares[::2]:
                    share.give_back()
                await asyncio.sleep(0)
            assert 0 <= room.taken <= 20
        for share in shares:
            share.give_back()
        await asyncio.sleep(0)
        assert room.taken == 0

    on_a_loop(work)


def test_nothing_is_always_there() -> None:
    async def work() -> None:
        room = FairRoom(4)
        taken_by(room, "a", lambda _: None)
        taken_by(room, "b", lambda _: None)
        room.take(0, "a", "s").give_back()
        room.take(0, "c").give_back()

    on_a_loop(work)


def order(puts: list[tuple[str, str, str]]) -> str:
    waiting: FairQueue[str] = FairQueue()
    for item, device, session in puts:
        waiting.put(item, device, session)
    return "".join(str(waiting.get(0.0)) for _ in puts)


def test_devices_take_turns() -> None:
    flood = [(item, "flooder", "s") for item in "abcdef"]
    assert order([*flood, ("X", "phone", "t"), ("Y", "phone", "t")]) == "aXbYcdef"


def test_sessions_take_turns_within_the_turns_of_a_device() -> None:
    flood = [(item, "flooder", item) for item in "abcdef"]
    assert order([*flood, ("X", "phone", "t"), ("Y", "phone", "t")]) == "aXbYcdef"
    same = [(item, "d", "flood") for item in "abcdef"]
    assert order([*same, ("X", "d", "t"), ("Y", "d", "t")]) == "aXbYcdef"


def test_a_session_keeps_its_order() -> None:
    assert order([(item, "d", "s") for item in "abcdef"]) == "abcdef"


def test_who_comes_later_waits_for_one_turn_only() -> None:
    waiting: FairQueue[str] = FairQueue()
    for number in range(100):
        waiting.put(str(number), "flooder", str(number % 12))
    assert waiting.get(0.0) == "0"
    waiting.put("X", "phone", "t")
    assert "X" in (waiting.get(0.0), waiting.get(0.0))


def test_it_waits_and_is_closed() -> None:
    waiting: FairQueue[str] = FairQueue()
    assert waiting.empty
    with pytest.raises(queue.Empty):
        waiting.get(0.0)
    heard: list[str | None] = []
    thread = threading.Thread(target=lambda: heard.extend((waiting.get(), waiting.get())))
    thread.start()
    waiting.put("a", "d", "s")
    while not heard and thread.is_alive() and not waiting.empty:
        pass
    waiting.close()
    thread.join(PATIENCE_S)
    assert heard == ["a", None] or heard == [None, None]
