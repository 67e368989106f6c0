"""Uploads over HTTP: safe on disk before the answer, in the spool as if dropped there."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from shm.read import sidecar_path
from shm.store import Stage, Workspace
from shm.store.journal import list_events
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.web_servers import served
from tests.helpers.workspaces import make_workspace, write_test


@pytest.fixture
def client(workspace: Workspace) -> Iterator[httpx.Client]:
    """One who may write."""
    with served(workspace) as site, site.client(site.write_token) as client:
        yield client


def a_test_file(workspace: Workspace, folder: Path) -> bytes:
    write_test(folder / "t0.modes.json", workspace)
    return (folder / "t0.modes.json").read_bytes()


def spooled(workspace: Workspace) -> list[str]:
    return sorted(path.name for path in workspace.spool.iterdir() if path.is_file())


def test_an_upload_is_safe_in_the_spool_and_goes_through_like_a_dropped_file(
    client: httpx.Client, workspace: Workspace, tmp_path: Path
) -> None:
    content = a_test_file(workspace, tmp_path)
    sha256 = hashlib.sha256(content).hexdigest()
    answer = client.post("/api/recordings?name=t0.modes.json", content=content)
    assert answer.status_code == 202
    told = answer.json()
    assert (told["sha256"], told["size_bytes"], told["outcome"]) == (sha256, len(content), "new")
    assert (workspace.spool / "t0.modes.json").read_bytes() == content
    assert client.get(told["status_url"]).status_code == 404  # the daemon has not taken it yet
    ingest_quickly(workspace)
    assert client.get(told["status_url"]).json()["stage"] == Stage.DONE
    assert spooled(workspace) == []
    again = client.post("/api/recordings?name=again.modes.json", content=content)
    assert again.json()["outcome"] == "duplicate"
    ingest_quickly(workspace)
    with workspace.store() as store:
        assert [event.kind for event in list_events(store)] == ["duplicate"]


def test_a_refused_upload_tells_its_reason(client: httpx.Client, workspace: Workspace) -> None:
    told = client.post("/api/recordings?name=bad.csv&hanger=3", content=b"no,numbers\n").json()
    ingest_quickly(workspace)
    status = client.get(told["status_url"]).json()
    assert status["stage"] == "refused"
    assert status["reason"]["remedy"]
    assert client.get(f"/api/recordings/{status['id']}").json() == status
    again = client.post("/api/recordings?name=bad.csv&hanger=3", content=b"no,numbers\n").json()
    assert again["outcome"] == "reopened"


def test_what_the_file_cannot_say_becomes_its_sidecar(
    client: httpx.Client, workspace: Workspace
) -> None:
    query = {
        "name": "h.csv",
        "hanger": 3,
        "time": "2026-05-01T12:00:00+02:00",
        "temperature_c": -2.5,
        "unit": "N, m/s2",
        "x_m": ",2.52",
    }
    assert client.post("/api/recordings", params=query, content=b"force,acc_1\n").status_code == 202
    assert (workspace.spool / "h.toml").read_text() == (
        'hanger = 3\ntime = 2026-05-01T10:00:00Z\ntemperature_c = -2.5\nunit = ["N", "m/s2"]\n'
        'x_m = ["", 2.52]\n'
    )


def test_a_taken_name_gets_a_piece_of_the_checksum_and_no_strange_sidecar(
    client: httpx.Client, workspace: Workspace
) -> None:
    (workspace.spool / "h.toml").write_text("hanger = 9\n")  # of h.uff, say
    for content in (b"one", b"two", b"two"):
        told = client.post("/api/recordings?name=h.csv", content=content).json()
        path = workspace.spool / told["file_name"]
        assert path.read_bytes() == content
        assert told["file_name"] == f"h-{told['sha256'][:8]}.csv"
        assert not sidecar_path(path).exists()
    assert len(spooled(workspace)) == 3


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("../../etc/cron.csv", "cron.csv"),
        (r"C:\data\hit.uff", "hit.uff"),
        (".hidden.csv", "hidden.csv"),
        ("a\x00b\n.csv", "ab.csv"),
        ("x" * 250 + ".csv", "x" * 196 + ".csv"),
        ("hanger3.csv.gz", "hanger3.csv.gz"),
    ],
)
def test_a_name_leads_nowhere_but_into_the_spool(
    client: httpx.Client, workspace: Workspace, given: str, kept: str
) -> None:
    answer = client.post("/api/recordings", params={"name": given}, content=b"x")
    assert answer.json()["file_name"] == kept
    assert spooled(workspace) == [kept]


@pytest.mark.parametrize("name", ["x.part", "x.toml", "...", "/", "x.tmp"])
def test_a_name_that_the_spool_would_leave_alone_is_refused(
    client: httpx.Client, workspace: Workspace, name: str
) -> None:
    answer = client.post("/api/recordings", params={"name": name}, content=b"x")
    assert answer.status_code == 422
    assert answer.json()["remedy"]
    assert spooled(workspace) == []


def left(workspace: Workspace) -> list[Path]:
    return [path for path in workspace.spool.rglob("*") if path.is_file()]


def test_too_much_is_refused_while_it_comes_and_leaves_nothing(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "small", settings={"max_file_bytes": 3_000_000})
    sent = 0

    def pieces() -> Iterator[bytes]:
        nonlocal sent
        for _ in range(33):
            sent += 1
            yield bytes(100_000)

    with served(workspace) as site, site.client(site.write_token) as client:
        unsaid = client.post("/api/recordings?name=x.csv", content=pieces())
        said = client.post("/api/recordings?name=x.csv", content=bytes(3_000_001))
    assert sent > 30
    assert (unsaid.status_code, said.status_code) == (413, 413)
    assert "max_file_bytes" in unsaid.json()["remedy"]
    assert left(workspace) == []


def test_a_wrong_checksum_is_refused_and_a_right_one_is_not(
    client: httpx.Client, workspace: Workspace
) -> None:
    right = hashlib.sha256(b"x").hexdigest()
    for sha256, status in (("0" * 64, 422), ("rubbish", 422), (right, 202), (right.upper(), 202)):
        headers = {"X-Content-SHA256": sha256}
        answer = client.post("/api/recordings?name=x.csv", content=b"x", headers=headers)
        assert answer.status_code == status
    assert [path.name for path in left(workspace)] == ["x.csv"]


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ("name=x.csv&time=yesterday", 422),
        ("name=x.csv&time=0001-01-01T00:00:00%2B14:00", 422),
        ("name=x.csv&temperature_c=nan", 422),
        ("name=x.csv&x_m=1,two", 422),
        ("name=x.csv&hanger=-1", 422),
        ("", 422),
    ],
)
def test_a_value_that_cannot_be_used_is_refused_with_words(
    client: httpx.Client, workspace: Workspace, query: str, status: int
) -> None:
    answer = client.post(f"/api/recordings?{query}", content=b"x")
    assert answer.status_code == status
    assert answer.json()["message"]
    assert left(workspace) == []


def test_a_form_and_an_empty_body_are_refused(client: httpx.Client, workspace: Workspace) -> None:
    form = client.post("/api/recordings?name=x.csv", files={"file": b"x"})
    assert form.status_code == 415
    assert client.post("/api/recordings?name=x.csv", content=b"").status_code == 422
    assert left(workspace) == []
