"""The four endings of a photo: undone, set aside, deleted with its session, erased."""

from __future__ import annotations

import stat
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from capture_uploads import SESSION_ID, capture_id, new_session, photo, upload
from clocks import Clock
from peaking.errors import OutputError
from peaking.server import open_session, wire
from peaking.server.open_session import NotRestorable, OpenSession, SessionGone
from peaking.server.session_state import UnknownCapture
from peaking.server.sessions import RESTORABLE_S, SessionStore, UnknownSession
from peaking.server.upload import parse_upload

OTHER_ID = "5e551011-0000-4000-8000-000000000002"
NEW = msgspec.convert(new_session(), wire.NewSession)


def put(session: OpenSession, *numbers: int) -> None:
    for number in numbers:
        session.store_capture(capture_id(number), parse_upload(upload(number)))


def reopened(store: SessionStore) -> SessionStore:
    store.close()
    return SessionStore(store.root, clock=store._clock)  # pyright: ignore[reportPrivateUsage]


def photos_below(root: Path) -> set[int]:
    """Return the numbers of the photos whose bytes are anywhere below a folder."""
    there = {path.read_bytes() for path in root.rglob("*") if path.is_file()}
    return {number for number in range(1, 9) if photo(number) in there}


# Undo


def test_what_is_undone_can_be_restored_until_the_session_is_finished(tmp_path: Path) -> None:
    store = SessionStore(tmp_path)
    put(store.begin(SESSION_ID, NEW)[0], 1, 2)
    store.get(SESSION_ID).remove_capture(capture_id(1))
    store = reopened(store)
    session = store.get(SESSION_ID)
    undone = session.capture(capture_id(1))
    assert (undone.removed, undone.ending, undone.restorable) == (True, "undone", True)
    with pytest.raises(UnknownCapture):
        session.shown_capture(capture_id(1))
    assert session.restore_capture(capture_id(1)) == session.restore_capture(capture_id(1))
    assert len(session.dataset_files()) == 5

    session.remove_capture(capture_id(1))
    session.finish(True)
    session = reopened(store).get(SESSION_ID)
    assert not session.capture(capture_id(1)).restorable
    assert photos_below(tmp_path) == {2}
    with pytest.raises(NotRestorable, match="finished"):
        session.restore_capture(capture_id(1))
    assert session.store_capture(capture_id(1), parse_upload(upload(1)))[0].removed
    assert photos_below(tmp_path) == {2}


def test_an_undo_overrules_what_the_program_set_aside(tmp_path: Path) -> None:
    session = SessionStore(tmp_path).begin(SESSION_ID, NEW)[0]
    put(session, 1, 2)
    session.set_aside(capture_id(1))
    assert session.remove_capture(capture_id(1)).ending == "undone"
    with pytest.raises(UnknownCapture):
        session.shown_capture(capture_id(1))
    assert session.set_aside(capture_id(1)).ending == "undone"
    session.finish(True)
    assert photos_below(tmp_path) == {2}


def test_an_undo_after_the_end_is_final(tmp_path: Path) -> None:
    store = SessionStore(tmp_path)
    session = store.begin(SESSION_ID, NEW)[0]
    put(session, 1, 2)
    session.finish(True)
    assert not session.remove_capture(capture_id(1)).restorable
    assert photos_below(tmp_path) == {2}
    assert not reopened(store).get(SESSION_ID).capture(capture_id(1)).restorable


def test_an_mpi_that_was_made_meanwhile_is_made_again_for_what_comes_back(tmp_path: Path) -> None:
    store = SessionStore(tmp_path)
    session = store.begin(SESSION_ID, NEW)[0]
    put(session, 1)
    store.delete(SESSION_ID)
    assert session.mark_ready(capture_id(1), b"mpi", generator="layered").problem is None
    store.restore(SESSION_ID)
    assert session.unfinished("layered") == [capture_id(1)]


def test_a_photo_that_is_undone_while_it_is_read_is_given_to_nobody(tmp_path: Path) -> None:
    session = SessionStore(tmp_path).begin(SESSION_ID, NEW)[0]
    put(session, 1)
    shown = session.shown_capture(capture_id(1))
    session.remove_capture(capture_id(1))
    assert not session.photo_path(shown).exists()


def test_a_lost_line_brings_no_undone_photo_back(tmp_path: Path) -> None:
    store = SessionStore(tmp_path)
    session = store.begin(SESSION_ID, NEW)[0]
    put(session, 1)
    session.remove_capture(capture_id(1))
    log = session.folder / "log.jsonl"
    log.write_bytes(b"".join(log.read_bytes().splitlines(keepends=True)[:-1]))
    again = reopened(store).get(SESSION_ID)
    assert again.capture(capture_id(1)).ending == "undone"
    assert [name for name, _ in again.dataset_files()] == ["transforms.json"]


# Set aside


def test_what_is_set_aside_is_kept_within_a_bound(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = sum(len(data) for data in (photo(1), photo(2), photo(3)))
    monkeypatch.setattr(open_session, "SET_ASIDE_BYTES", one)
    store = SessionStore(tmp_path)
    session = store.begin(SESSION_ID, NEW)[0]
    put(session, 1, 2, 3, 4, 5)
    session.set_aside(capture_id(3))
    session.set_aside(capture_id(2))
    session.restore_capture(capture_id(3))
    session.set_aside(capture_id(1))
    session.set_aside(capture_id(3))
    assert session.shown_capture(capture_id(3)).ending == "set_aside"
    session = reopened(store).get(SESSION_ID)
    restorable = {c.number for c in session.captures if c.restorable}
    assert restorable == {1, 3}  # 2 was set aside first
    assert photos_below(tmp_path) == {1, 3, 4, 5}
    with pytest.raises(NotRestorable, match="room"):
        session.restore_capture(capture_id(2))
    session.finish(True)
    assert session.restore_capture(capture_id(1)).ending is None


# Delete


def test_a_deleted_session_takes_and_gives_nothing_and_comes_back(tmp_path: Path) -> None:
    store = SessionStore(tmp_path)
    put(store.begin(SESSION_ID, NEW)[0], 1)
    store.delete(SESSION_ID)
    store.delete(SESSION_ID)
    store = reopened(store)
    assert store.sessions() == []
    session = store.get_any(SESSION_ID)
    assert session.folder.parent == tmp_path / ".deleted"
    for forbidden in (
        lambda: put(session, 2),
        lambda: store.begin(SESSION_ID, NEW),
        lambda: session.remove_capture(capture_id(1)),
        lambda: session.rename("x"),
        session.dataset_files,
        lambda: store.get(SESSION_ID),
    ):
        with pytest.raises(SessionGone, match="30 days"):
            forbidden()
    store.restore(SESSION_ID)
    store.restore(SESSION_ID)
    put(reopened(store).get(SESSION_ID), 2)
    assert photos_below(tmp_path) == {1, 2}


def test_after_thirty_days_a_deleted_session_is_erased(tmp_path: Path) -> None:
    clock = Clock()
    store = SessionStore(tmp_path, clock=clock)
    put(store.begin(SESSION_ID, NEW)[0], 1)
    put(store.begin(OTHER_ID, NEW)[0], 2)
    store.delete(SESSION_ID)
    clock.now_s += RESTORABLE_S - 1
    store = reopened(store)
    assert photos_below(tmp_path) == {1, 2}
    clock.now_s += 2
    assert store.erase_expired() == [SESSION_ID]
    assert photos_below(tmp_path) == {2}
    with pytest.raises(SessionGone, match="for good"):
        reopened(store).restore(SESSION_ID)


# Erase


@pytest.mark.parametrize("known", [True, False])
def test_an_erased_session_never_comes_back(tmp_path: Path, known: bool) -> None:
    store = SessionStore(tmp_path)
    session = store.begin(SESSION_ID, NEW)[0] if known else None
    if session is not None:
        put(session, 1)
    store.erase(SESSION_ID)
    store.erase(SESSION_ID)
    if session is not None:
        with pytest.raises(SessionGone, match="for good"):
            put(session, 2)
        assert session.mark_ready(capture_id(1), b"mpi", generator="layered").state == "queued"
    store = reopened(store)
    for forbidden in (
        lambda: store.begin(SESSION_ID, NEW),
        lambda: store.get(SESSION_ID),
        lambda: store.restore(SESSION_ID),
    ):
        with pytest.raises(SessionGone, match="for good"):
            forbidden()
    assert photos_below(tmp_path) == set()


@pytest.mark.parametrize("deleted_before", [False, True])
def test_an_erasure_that_was_interrupted_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, deleted_before: bool
) -> None:
    store = SessionStore(tmp_path)
    put(store.begin(SESSION_ID, NEW)[0], 1)
    put(store.begin(OTHER_ID, NEW)[0], 2)
    if deleted_before:
        store.delete(SESSION_ID)

    def power_cut(*_: object) -> bool:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("peaking.server.store_folder.StoreFolder.delete", power_cut)
        with pytest.raises(KeyboardInterrupt):
            store.erase(SESSION_ID)
    assert 1 in photos_below(tmp_path)
    store = reopened(store)
    assert [session.id for session in store.sessions()] == [OTHER_ID]
    assert photos_below(tmp_path) == {2}


def test_an_erased_photo_leaves_nothing(tmp_path: Path) -> None:
    store = SessionStore(tmp_path)
    session = store.begin(SESSION_ID, NEW)[0]
    put(session, 1, 2)
    session.mark_ready(capture_id(1), b"made of photo 1", generator="layered")
    session.refresh_dataset()
    session.erase_capture(capture_id(1))
    assert session.erase_capture(capture_id(1)).ending == "erased"
    store = reopened(store)
    session = store.get(SESSION_ID)
    left = {path.name for path in session.folder.rglob("000001*")}
    assert left == set()
    assert [c.ending for c in session.captures] == ["erased", None]
    with pytest.raises(NotRestorable):
        session.restore_capture(capture_id(1))
    assert session.store_capture(capture_id(1), parse_upload(upload(1)))[0].ending == "erased"
    assert photos_below(tmp_path) == {2}


def nothing(*_: object, **__: object) -> None:
    """Do nothing."""


def test_what_cannot_be_deleted_is_told_and_nothing_is_served(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = SessionStore(tmp_path)
    put(store.begin(SESSION_ID, NEW)[0], 1)
    with monkeypatch.context() as patch:
        patch.setattr("shutil.rmtree", nothing)
        for _ in range(2):
            with pytest.raises(OutputError, match="delete it by hand"):
                store.erase(SESSION_ID)
        with pytest.raises(SessionGone, match="for good"):
            store.get(SESSION_ID)
        assert sum("delete it by hand" in problem for problem in store.problems) == 1
    reopened(store).erase(SESSION_ID)
    assert photos_below(tmp_path) == set()


def test_what_a_link_leads_to_is_not_served_as_it_could_not_be_erased(tmp_path: Path) -> None:
    store = SessionStore(tmp_path / "sessions")
    folder = store.begin(SESSION_ID, NEW)[0].folder
    store.close()
    elsewhere = folder.rename(tmp_path / folder.name)
    folder.symlink_to(elsewhere)
    again = SessionStore(tmp_path / "sessions")
    assert again.sessions() == []
    assert any("is a link" in problem for problem in again.problems)


@pytest.mark.parametrize("named_as_before", [False, True])
def test_erasing_one_session_leaves_all_others(tmp_path: Path, named_as_before: bool) -> None:
    store = SessionStore(tmp_path)
    session = store.begin(OTHER_ID, NEW)[0]
    put(session, 1)
    log = session.folder / "log.jsonl"
    log.write_bytes(b"\0" + log.read_bytes()[1:])  # and with it, who it is
    own = tmp_path / f"my_{SESSION_ID[:8]}"
    own.mkdir()
    (own / "a.jpg").write_bytes(photo(2))
    if named_as_before:
        (session.folder / ".id").unlink()
        session.folder.rename(tmp_path / "holiday")
    store = reopened(store)
    store.erase(SESSION_ID)
    assert photos_below(tmp_path) == {1, 2}
    store = reopened(store)
    if not named_as_before:
        store.erase(OTHER_ID)
        assert photos_below(tmp_path) == {2}


def test_what_is_begun_badly_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = SessionStore(tmp_path)
    with monkeypatch.context() as patch:

        def fails(*_: object, **__: object) -> None:
            raise OSError("the disk fails")

        patch.setattr("peaking.server.sessions.OpenSession", fails)
        with pytest.raises(OSError, match="the disk fails"):
            store.begin(SESSION_ID, NEW)
    put(store.begin(SESSION_ID, NEW)[0], 1)
    store = reopened(store)
    assert store.problems == []
    assert len(store.get(SESSION_ID).captures) == 1


# Whose folder it is


def test_a_second_server_is_told_who_has_the_folder(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from peaking.server.sessions import SessionStore\n"
        "store = SessionStore(Path(sys.argv[1])); print('mine', flush=True); sys.stdin.read()"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert other.stdout is not None
    assert other.stdout.readline() == "mine\n"
    with pytest.raises(OutputError, match=f"number {other.pid}, since .*stop it first"):
        SessionStore(tmp_path)
    other.kill()
    other.communicate()
    SessionStore(tmp_path)


def test_a_photo_is_never_replaced_whatever_the_log_says(tmp_path: Path) -> None:
    store = SessionStore(tmp_path)
    session = store.begin(SESSION_ID, NEW)[0]
    put(session, 1, 2)
    log = session.folder / "log.jsonl"
    begun = log.read_bytes().splitlines(keepends=True)[0]
    log.write_bytes(begun)
    (session.folder / "transforms.json").unlink()
    again = reopened(store).get(SESSION_ID)
    put(again, 3)
    assert again.capture(capture_id(3)).number == 3
    assert photos_below(tmp_path) == {1, 2, 3}


def test_photos_are_for_the_owner_only(tmp_path: Path) -> None:
    store = SessionStore(tmp_path / "sessions")
    session = store.begin(SESSION_ID, NEW)[0]
    put(session, 1)
    session.folder.chmod(0o755)
    session = reopened(store).get(SESSION_ID)
    for folder in (session.folder, store.root, store.root / ".peaking", store.root / ".deleted"):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    for file in (session.folder / "log.jsonl", store.root / ".peaking" / "lock"):
        assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_a_session_that_is_not_here_is_unknown(tmp_path: Path) -> None:
    with pytest.raises(UnknownSession):
        SessionStore(tmp_path).delete(SESSION_ID)
