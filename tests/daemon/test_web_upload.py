"""Uploads over HTTP: safe on disk before the answer; the first file of a logger is asked about."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from shm.read import sidecar_path
from shm.store import Stage, Workspace
from shm.store.journal import list_events
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.web_servers import HTML, UPLOAD, Served, served
from tests.helpers.workspaces import make_workspace, write_test


@pytest.fixture
def client(at_home: Served) -> Iterator[httpx.Client]:
    """One who may write."""
    with at_home.client(at_home.write_token) as client:
        yield client


def a_test_file(workspace: Workspace, folder: Path) -> bytes:
    write_test(folder / "t0.modes.json", workspace)
    return (folder / "t0.modes.json").read_bytes()


def spooled(workspace: Workspace) -> list[str]:
    return sorted(path.name for path in workspace.spool.iterdir() if path.is_file())


def test_upload_goes_through(client: httpx.Client, workspace: Workspace, tmp_path: Path) -> None:
    content = a_test_file(workspace, tmp_path)
    sha256 = hashlib.sha256(content).hexdigest()
    answer = client.post("/api/recordings?name=t0.modes.json", content=content)
    assert answer.status_code == 202
    told = answer.json()
    assert (told["sha256"], told["size_bytes"], told["outcome"]) == (sha256, len(content), "new")
    assert (workspace.spool / "t0.modes.json").read_bytes() == content
    assert client.get(told["status_url"]).status_code == 404  # the daemon has not taken it yet
    asked = f"/api/recordings?sha256={sha256}"
    assert client.get(asked).json() == {"recordings": []}
    ingest_quickly(workspace)
    (found,) = client.get(asked).json()["recordings"]
    assert found == client.get(told["status_url"]).json()
    assert found["stage"] == Stage.DONE
    (test,) = found["tests"]
    assert test["page"].startswith("/hangers/3/tests/")
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
    assert (status["stage"], status["tests"]) == ("refused", [])
    assert status["reason"]["remedy"]
    assert status["reason"]["message"]
    for key in (status["id"], told["sha256"]):
        assert client.get(f"/api/recordings/{key}").json() == status
    again = client.post("/api/recordings?name=bad.csv&hanger=3", content=b"no,numbers\n").json()
    assert again["outcome"] == "reopened"


def test_sidecar_of_an_upload(client: httpx.Client, workspace: Workspace) -> None:
    query = {"name": "h.csv", "hanger": 3, "time": "2026-05-01T12:00:00+02:00",
             "temperature_c": -2.5, "unit": "N, m/s2", "x_m": ",2.52"}  # fmt: skip
    assert client.post("/api/recordings", params=query, content=b"force,acc_1\n").status_code == 202
    assert (workspace.spool / "h.toml").read_text() == (
        'hanger = 3\ntime = 2026-05-01T10:00:00Z\ntemperature_c = -2.5\nunit = ["N", "m/s2"]\n'
        'x_m = ["", 2.52]\n'
    )


def test_taken_name_gets_checksum(client: httpx.Client, workspace: Workspace) -> None:
    (workspace.spool / "h.toml").write_text("hanger = 9\n")  # of h.uff, say
    for content in (b"one", b"two", b"two"):
        told = client.post("/api/recordings?name=h.csv", content=content).json()
        path = workspace.spool / told["file_name"]
        assert path.read_bytes() == content
        assert told["file_name"] == f"h-{told['sha256'][:8]}.csv"
        assert not sidecar_path(path).exists()
    assert len(spooled(workspace)) == 3


def test_upload_name_stays_in_spool(client: httpx.Client, workspace: Workspace) -> None:
    """One that the spool would leave alone is refused."""
    for name in ("x.part", "x.toml", "...", "/", "x.tmp"):
        answer = client.post("/api/recordings", params={"name": name}, content=b"x")
        assert answer.status_code == 422
        assert answer.json()["remedy"]
        assert spooled(workspace) == []
    for given, kept in (
        ("../../etc/cron.csv", "cron.csv"),
        (r"C:\data\hit.uff", "hit.uff"),
        (".hidden.csv", "hidden.csv"),
        ("a\x00b\n.csv", "ab.csv"),
        ("x" * 250 + ".csv", "x" * 196 + ".csv"),
        ("hanger3.csv.gz", "hanger3.csv.gz"),
    ):
        answer = client.post("/api/recordings", params={"name": given}, content=b"x")
        assert answer.json()["file_name"] == kept
        assert spooled(workspace) == [kept]
        (workspace.spool / kept).unlink()


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
        unsaid = client.post(UPLOAD, content=pieces())
        said = client.post(UPLOAD, content=bytes(3_000_001))
    assert sent > 30
    assert (unsaid.status_code, said.status_code) == (413, 413)
    assert "max_file_bytes" in unsaid.json()["remedy"]
    assert left(workspace) == []


def test_useless_upload_is_refused(client: httpx.Client, workspace: Workspace) -> None:
    """A wrong value, a form, an empty body and a wrong checksum."""
    for query in (
        "name=x.csv&time=yesterday", "name=x.csv&time=0001-01-01T00:00:00%2B14:00",
        "name=x.csv&temperature_c=nan", "name=x.csv&x_m=1,two", "name=x.csv&hanger=-1", "",
    ):  # fmt: skip
        answer = client.post(f"/api/recordings?{query}", content=b"x")
        assert answer.status_code == 422, query
        assert answer.json()["message"]
    assert client.post(UPLOAD, files={"file": b"x"}).status_code == 415
    assert client.post(UPLOAD, content=b"").status_code == 422
    assert left(workspace) == []
    right = hashlib.sha256(b"x").hexdigest()
    for sha256, status in (("0" * 64, 422), ("rubbish", 422), (right, 202), (right.upper(), 202)):
        answer = client.post(UPLOAD, content=b"x", headers={"X-Content-SHA256": sha256})
        assert answer.status_code == status
    assert [path.name for path in left(workspace)] == ["x.csv"]


def test_files_are_offered_only_to_who_may_send_them(at_home: Served) -> None:
    with at_home.client(**HTML) as reader:
        assert 'type="file"' not in reader.get("/upload").text
        assert "/sign-in?next=/upload" in reader.get("/upload").text
    with at_home.client(at_home.write_token, **HTML) as writer:
        page = writer.get("/upload").text
    assert 'type="file" id="files" multiple' in page
    assert '<option value="3">Hanger 3</option>' in page


HEAD = "Abtastrate;500 Hz\nZeit [s];Kraft [N];A1 [g];AI 2 [V]\n"


def export(seed: int, rows_: int = 600) -> bytes:
    rng = np.random.default_rng(seed)
    rows = "".join(f"{i / 500:.3f};{a:.4f};{b:.4f};{c:.4f}\n" for i, (a, b, c) in enumerate(
        rng.normal(size=(rows_, 3))
    ))  # fmt: skip
    return (HEAD + rows.replace(".", ",")).encode("latin-1")


def asked(client: httpx.Client, content: bytes, said: Any = None, name: str = "a.csv") -> Any:
    query = {"name": name, **({} if said is None else {"said": json.dumps(said)})}
    return client.post("/api/imports", params=query, content=content)


def test_look_asks_and_keeps_nothing(client: httpx.Client, workspace: Workspace) -> None:
    found = asked(client, export(1)).json()
    assert [(q["about"], q["channel"]) for q in found["questions"]] == [
        ("hanger", ""), ("unit", "AI 2"), ("place", "Kraft"), ("place", "A1"), ("plane", "A1"),
    ]  # fmt: skip
    assert [c["quantity"] for c in found["columns"]] == ["force", "acceleration", None]
    assert len(found["columns"][0]["outline"]) == 32
    assert found["sha256"] is None
    assert not [path for path in workspace.spool.iterdir() if path.is_file()]


def test_answers_are_kept(client: httpx.Client, workspace: Workspace) -> None:
    said = {
        "hanger": 3,
        "columns": {"A1": {"place": "2,5", "plane": "transverse"}, "AI 2": {"unit": "leave out"}},
    }
    found = asked(client, export(1), said).json()
    assert [question["channel"] for question in found["questions"]] == ["Kraft"]
    assert found["problems"] == []
    assert found["sha256"]  # the hammer's place is asked for, not needed
    told = tomllib.loads((workspace.spool / "a.toml").read_text())
    assert told["channel"]["A1"] == {"x_m": 2.5, "plane": "transverse"}
    assert asked(client, export(2), {}, "b.csv").json()["sha256"]


def test_answers_that_are_none_are_refused_with_words(client: httpx.Client) -> None:
    for said in (
        [], {"columns": 3}, {"columns": {"A1": 3}}, {"columns": {"A9": {"plane": "t"}}},
        {"columns": {"A1": {"plane": "up"}}}, {"hanger": "three"}, {"sampling_rate_hz": -1},
    ):  # fmt: skip
        answer = asked(client, export(1), said)
        assert answer.status_code == 422
        assert answer.json()["remedy"]


def test_what_cannot_be_read_is_refused_with_its_reason(client: httpx.Client) -> None:
    assert asked(client, b"some words\nin lines\n").json()["problems"]
    assert asked(client, b"\x89PNG\r\n\x1a\n").status_code == 422
    assert client.post("/api/imports?name=a.csv", content=b"").status_code == 422
    assert asked(client, export(1, 40_000)).json()["samples"] == 40_000
