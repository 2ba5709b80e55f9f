"""GET …/selection: every policy on the captures of a live session."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from capture_uploads import SESSION_ID, capture_id, new_session, upload
from peaking.options import DEFAULT, POLICY_NAMES
from peaking.selection.registry import POLICIES
from peaking.server.app import ServerOptions, create_app
from peaking.server.sessions import SessionStore
from server.test_two_speeds import wait_for

SESSION = f"/api/v1/sessions/{SESSION_ID}"
CAPTURES = 5
ASKED = {
    "threshold": {"threshold_share": "0.05"},
    "plenoptic": {"spacing_m": "0.05"},
    "all": {},
}
"""What policies go by that are not asked for a number of views here."""


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Generator[TestClient]:
    root: Path = tmp_path_factory.mktemp("selection")
    options = replace(DEFAULT, pixels=4096, num_planes=8)
    config = ServerOptions(devices=None, client_dir=root, options=options)
    app = create_app(store=SessionStore(root / "sessions"), config=config)
    with TestClient(app, base_url="http://localhost") as client:
        client.put(SESSION, json=new_session())
        for n in range(1, CAPTURES + 1):
            client.put(f"{SESSION}/captures/{capture_id(n)}", content=upload(n))
            wait_for(client, n, lambda c: c["state"] == "ready")
        yield client


def chosen(client: TestClient, **query: str) -> dict[str, Any]:
    answer = client.get(f"{SESSION}/selection", params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_every_name_is_a_policy() -> None:
    assert set(POLICY_NAMES) == set(POLICIES)


@pytest.mark.parametrize("policy", sorted(POLICIES))
def test_every_policy_chooses_among_the_captures(client: TestClient, policy: str) -> None:
    found = chosen(client, policy=policy, **ASKED.get(policy, {"views": "2"}))
    assert [capture["number"] for capture in found["captures"]] == list(range(1, CAPTURES + 1))
    assert all(capture["reason"] for capture in found["captures"])
    kept = [capture["number"] for capture in found["captures"] if capture["kept"]]
    if policy not in ASKED:
        assert len(kept) == 2
    assert kept == sorted(kept)
    assert kept
    assert (policy == "all") == (len(kept) == CAPTURES) or policy in ("plenoptic", "threshold")


def test_an_undone_capture_is_no_candidate(client: TestClient) -> None:
    removed = f"{SESSION}/captures/{capture_id(CAPTURES + 1)}"
    client.put(removed, content=upload(CAPTURES + 1))
    client.delete(removed)
    assert len(chosen(client, policy="all")["captures"]) == CAPTURES


@pytest.mark.parametrize(
    ("query", "says"),
    [
        ({"policy": "best"}, "best"),
        ({"policy": "uniform"}, "need a number of views for the policy uniform"),
        ({"policy": "uniform", "views": "6"}, "need at least 6 candidates for 6 views, got 5"),
        ({"views": "0"}, "views"),
        ({"threshold_share": "nan"}, "threshold_share"),
        ({"whatever": "1"}, "whatever"),
    ],
)
def test_wrong_questions_are_refused_with_a_sentence(
    client: TestClient, query: dict[str, str], says: str
) -> None:
    answer = client.get(f"{SESSION}/selection", params=query)
    assert answer.status_code == 400
    assert says in answer.json()["detail"]
