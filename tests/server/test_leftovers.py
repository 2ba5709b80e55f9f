"""Half-written files that a crash left are gone at the next start; nothing else is."""

from __future__ import annotations

from pathlib import Path

import msgspec

from capture_uploads import SESSION_ID, new_session
from peaking.server import wire
from peaking.server.open_session import OpenSession
from peaking.server.sessions import SessionStore


def test_leftovers_are_gone_wherever_they_lie(tmp_path: Path) -> None:
    store = SessionStore(tmp_path)
    new = msgspec.convert(new_session(), wire.NewSession)
    folder = store.begin(SESSION_ID, new)[0].folder
    store.close()
    ours = [
        folder / ".transforms.json.partial-0011aabb",
        folder / "mpi" / ".000001.mpi.partial-0011aabb",
    ]
    others = [folder / "notes.partial-0011aabb", folder / ".notes"]
    for path in (*ours, *others):
        path.write_bytes(b"x")
    OpenSession(folder, clock=lambda: 0.0)
    assert [path.exists() for path in ours] == [False, False]
    assert [path.exists() for path in others] == [True, True]
