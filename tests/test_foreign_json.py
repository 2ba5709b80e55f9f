"""JSON of others: whatever it is, it is decoded or a ValueError, and costs little."""

from __future__ import annotations

import contextlib
import tracemalloc
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.event_log import DamagedLine, EventLog
from peaking.foreign_json import decode_json


class Event(msgspec.Struct):
    number: int


@pytest.mark.parametrize(
    "data",
    [b"", b"\0", b"\xff", b'{"number":1', b'{"a":' + b"[" * 100_000, b'{"a":' + b'{"a":' * 5000],
)
def test_what_is_no_json_is_a_value_error(data: bytes) -> None:
    with pytest.raises((msgspec.DecodeError, UnicodeDecodeError)):
        decode_json(data, Event)


@given(st.binary(max_size=40))
def test_anything_is_decoded_or_a_value_error(data: bytes) -> None:
    with contextlib.suppress(ValueError):
        assert isinstance(decode_json(data, Event), Event)


def test_damaged_lines_that_follow_one_another_are_said_once(tmp_path: Path) -> None:
    log: EventLog[Event] = EventLog(tmp_path / "log.jsonl", Event)
    log.append(Event(1))
    with log.path.open("ab") as file:
        file.write(b"\n" * 200_000 + b'{"number":2}\n' + b'{"a":' + b"[" * 5000 + b"\n" + b"torn")
    tracemalloc.start()
    try:
        events, damaged = log.read_around_damage()
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 1_000_000
    assert [event.number for event in events] == [1, 2]
    assert [(one.number, one.last) for one in damaged] == [(2, 200_001), (200_003, 200_003)]
    assert str(damaged[0]).startswith("lines 2 to 200001 cannot be read (")
    with pytest.raises(DamagedLine, match="lines 2 to"):
        log.read()
