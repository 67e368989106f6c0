"""The page of all bridges: real servers are asked, and each that cannot be is said with why."""

from __future__ import annotations

import json
import os
import re
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from shm.bridge import OtherBridge
from shm.documents import dump, value_of
from shm.store import Workspace
from shm_cli.main import run
from shm_daemon.doctor import Finding, Level, examine
from shm_daemon.heartbeat import HEARTBEAT, beat
from shm_daemon.http_client import HttpClient
from shm_daemon.web.address import SUMMARY
from shm_daemon.web.bridge_summary import Summary
from shm_daemon.web.commands import without_commands
from shm_daemon.web.other_bridges import NotReached, OtherBridges, ask
from tests.helpers.listeners import Answer, Listener, a_listener, a_silent_listener
from tests.helpers.nouns import NOW
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.web_servers import ELSEWHERE, served, words_of
from tests.helpers.workspaces import make_workspace, write_loss, write_test

SAID = Summary(
    bridge="Severn bridge", version="0.1.0", status="steady", state="No change detected.",
    action="No action is needed.", urgency="none", notes=(), others="", notices=(), troubles=(),
    hangers=3, latest_test_at=NOW, open_alerts=0, held=0,
)  # fmt: skip


def free_address() -> str:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        return f"http://127.0.0.1:{listening.getsockname()[1]}"


def renamed(workspace: Workspace, name: str) -> Workspace:
    path = workspace.folder / "bridge.toml"
    path.write_text(path.read_text().replace("Test bridge", name))
    return workspace.reopened()


def name_others(workspace: Workspace, *others: OtherBridge) -> None:
    tables = (
        "[[other_bridge]]\n" + "\n".join(f"{k} = {json.dumps(v)}" for k, v in found.items())
        for found in ({k: v for k, v in asdict(each).items() if v} for each in others)
    )
    path = workspace.folder / "bridge.toml"
    path.write_text("\n\n".join((path.read_text(), *tables)) + "\n")


@dataclass(frozen=True)
class Neighbourhood:
    """`home` lists the others; `urls` are where the real ones of them are served."""

    home: Workspace
    client: httpx.Client
    urls: dict[str, str]

    def rows(self) -> dict[str, dict[str, Any]]:
        return {each["name"]: each for each in self.document()["bridges"]}

    def document(self) -> Any:
        return self.client.get("/api/bridges").json()

    def page(self) -> str:
        return plain(self.client.get("/bridges").text)


def plain(page: str) -> str:
    """Return the words without the marks of commands and the blanks that tags leave."""
    return re.sub(r" ([.,)])", r"\1", words_of(page.replace("`", ""))).replace("( ", "(")


@pytest.fixture(scope="module")
def there(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Neighbourhood]:
    """`Lost` has an alert, `Dead` no daemon, `Wrong` has our token revoked, `Gone` is nowhere."""
    folder = tmp_path_factory.mktemp("bridges")
    made = {
        name: renamed(make_workspace(folder / name.lower(), hangers=(3, 4)), name)
        for name in ("Home", "Lost", "Dead")
    }
    for name, workspace in made.items():
        if name == "Lost":
            write_loss(workspace.spool, workspace)
        else:
            write_test(workspace.spool / "t0.modes.json", workspace)
        ingest_quickly(workspace)
        beat(workspace)
        seen = time.time() + (-7200 if name == "Dead" else 7200)  # a slow run takes a while
        os.utime(workspace.folder / HEARTBEAT, (seen, seen))
    with ExitStack() as stack:
        lost = stack.enter_context(served(made["Lost"], ELSEWHERE))
        dead = stack.enter_context(served(made["Dead"]))
        (made["Home"].folder / "lost.token").write_text(f"{lost.read_token}\n")
        (made["Home"].folder / "wrong.token").write_text("shm_r_of-another-bridge\n")
        (made["Home"].folder / "lost.token").chmod(0o600)
        name_others(
            made["Home"],
            OtherBridge("Dead", dead.url),
            OtherBridge("Gone", free_address()),
            OtherBridge("Lost", lost.url, "lost.token"),
            OtherBridge("Wrong", lost.url, "wrong.token"),
            OtherBridge("Open", lost.url),
        )
        home = made["Home"].reopened()
        client = stack.enter_context(stack.enter_context(served(home)).client())
        yield Neighbourhood(home, client, {"Lost": lost.url, "Dead": dead.url})


# ---------------------------------------------------------------- two real servers, and more


@pytest.mark.parametrize("name", ["Lost", "Dead"])
def test_a_bridge_is_said_in_the_words_of_its_own_home_page(
    there: Neighbourhood, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    token = (there.home.folder / "lost.token").read_text().strip()
    headers = {"Authorization": f"Bearer {token}"} if name == "Lost" else {}
    with httpx.Client(headers=headers, timeout=120) as own:
        state = own.get(f"{there.urls[name]}/api/bridge").json()
        home_page = plain(own.get(f"{there.urls[name]}/").text)
    row = there.rows()[name]["summary"]
    keys = ("bridge", "status", "state", "action", "urgency", "notes")
    assert {key: row[key] for key in keys} == {key: state[key] for key in keys}
    said = plain(without_commands(value_of(Summary, row).words))
    assert said in home_page
    assert said in there.page()
    for notice in (plain(f"{each['state']} {each['action']}") for each in row["notices"]):
        assert notice in home_page
        assert notice in there.page()
    folder = there.home.folder.parent / name.lower()
    assert run(["--workspace", str(folder), "status", "--json"]) == 0
    hangers = json.loads(capsys.readouterr().out)["hangers"]
    of_status = [(each["state"], each["action"], each["urgency"]) for each in hangers]
    assert name == "Dead" or tuple(row[key] for key in ("state", "action", "urgency")) in of_status


def test_worst_bridge_comes_first(there: Neighbourhood) -> None:
    found = there.document()
    names = [each["name"] for each in found["bridges"]]
    assert names[0] == "Lost"
    assert names[-1] == "Home"
    assert set(names[1:-1]) == {"Dead", "Gone", "Wrong", "Open"}
    assert found["headline"].startswith("6 bridges. Action today: Lost. Not reached: Gone, ")
    assert "Stopped: Dead." in found["headline"]
    rows = {each["name"]: each for each in found["bridges"]}
    assert rows["Dead"]["summary"]["status"] == "first"
    assert (rows["Dead"]["states"], rows["Dead"]["urgency"]) == (["Stopped"], "today")
    page = there.client.get("/bridges").text
    for name in ("Dead", "Gone", "Wrong", "Open"):
        part = page.split(f'aria-labelledby="bridge-{name}"')[1].split("</article>")[0]
        assert re.search(r'class="status alert">', part)
        assert not re.search(r"class=\"(status|summary) (steady|first)", part)
    assert "The daemon was last seen 2 h ago." in page


def test_why_a_bridge_is_not_reached_is_said_and_a_link_leads_to_each(there: Neighbourhood) -> None:
    words, rows = there.page(), there.rows()
    for name, said, remedy in (
        ("Gone", "no connection: Connection refused.",
         "See today that its machine and shm web run there"),
        ("Wrong", "it refuses the token of wrong.token.", "Write it into wrong.token."),
        ("Open", "it asks for a token.", "name that in bridge.toml: token_file."),
    ):  # fmt: skip
        trouble = rows[name]["trouble"]
        assert rows[name]["states"] == ["Not reached"]
        assert trouble["state"].endswith(said), trouble
        assert remedy in plain(trouble["action"])
        assert plain(f"{trouble['state']} {trouble['action']}")[-30:] in words
    page = there.client.get("/bridges").text
    for url in (*(f"{url}/" for url in there.urls.values()), "/"):
        assert '<h2 id="bridge-' in page
        assert re.search(rf'<h2 [^>]*><a href="{re.escape(url)}">', page)
    assert '<a href="/bridges">All bridges</a>' in there.client.get("/").text
    for path in (SUMMARY, "/api/bridges", "/bridges"):
        assert httpx.get(f"{there.urls['Lost']}{path}").status_code == 401


def test_command_and_doctor_agree(there: Neighbourhood, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--workspace", str(there.home.folder), "bridges", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    served_rows = there.document()
    assert told["headline"] == served_rows["headline"]
    for mine, theirs in zip(told["bridges"], served_rows["bridges"], strict=True):
        assert {**mine, "asked_at": 0, "trouble": 0} == {**theirs, "asked_at": 0, "trouble": 0}
    assert run(["--workspace", str(there.home.folder), "bridges"]) == 0
    assert "Lost (Alert): Hanger 3: " in capsys.readouterr().out
    found: dict[str, list[Finding]] = {}
    for each in examine(there.home.folder, NOW):
        found.setdefault(each.check, []).append(each)
    assert [each.level for each in found["bridge Lost"]] == [Level.OK]
    assert [each.level for each in found["bridge Wrong"]] == [Level.WARNING] * 2
    assert "others can read wrong.token" in [each.found for each in found["bridge Wrong"]]
    assert [each.level for each in found["bridge Gone"]] == [Level.WARNING]


def test_a_bridge_alone_says_how_others_are_added(tmp_path: Path) -> None:
    with served(make_workspace(tmp_path / "alone")) as site, site.client() as client:
        assert "Add others as [[other_bridge]]" in plain(client.get("/bridges").text)
        assert "All bridges" not in client.get("/").text


# ---------------------------------------------------------------- what may answer instead


def asked(listener: Listener, folder: Path, timeout_s: float = 5.0, **more: str) -> Summary:
    address = listener.url.removesuffix("/alerts")
    return ask(OtherBridge("Severn", address, **more), folder, HttpClient(), timeout_s)


@pytest.mark.parametrize(
    ("answer", "said", "remedy"),
    [
        *((answer, "Something else than shm", "Correct its address") for answer in (
            Answer(200, b"<!doctype html>"), Answer(200, b'{"status": "green"}'),
            Answer(200, b"[1]"), Answer(404, b"not found"), Answer(200, b" " * 70_000))),
        (Answer(404, b'{"message": "Not found"}'), "It answers 404: Not found", "See today"),
        (Answer(200, b'{"version": "9.0", "status": "purple"}'), "Its shm 9.0 and this", "Upgrade"),
        (Answer(503, b'{"message": "Out.", "remedy": "Wait."}'), "It answers 503: Out.", "Wait."),
        (Answer(500, b'{"message": "a\\u001b[31m"}'), "It answers 500: a [31m", "See today"),
        (Answer(cut=True), "No connection: ", "See today"),
    ],
)  # fmt: skip
def test_foreign_answer_is_said(tmp_path: Path, answer: Answer, said: str, remedy: str) -> None:
    with a_listener(lambda _: answer) as listener, pytest.raises(NotReached) as caught:
        asked(listener, tmp_path)
    assert said in caught.value.message
    assert remedy in caught.value.remedy


def test_nobody_else_is_asked_where_an_address_sends_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "t").write_text("shm_secret")
    with a_listener() as elsewhere:
        away = Answer(302, b"", (("Location", elsewhere.url),))
        with (
            a_listener(lambda _: away) as listener,
            pytest.raises(NotReached, match=r"Something else .*\(302\)"),
        ):
            asked(listener, tmp_path, token_file="t")
        assert elsewhere.told == []
    (told,) = listener.told
    assert (told.path, told.headers["Authorization"]) == (SUMMARY, "Bearer shm_secret")


@pytest.mark.parametrize("drip", [b"", b"HTTP/1.1 200 OK\r\n\r\n" + b" " * 9000])
def test_a_slow_bridge_is_given_up(tmp_path: Path, drip: bytes) -> None:
    with (
        a_silent_listener(drip, 0.005) as url,
        pytest.raises(NotReached, match=r"[Nn]o answer within 0\.4 s"),
    ):
        ask(OtherBridge("Severn", url.rstrip("/")), tmp_path, HttpClient(), 0.4)


@pytest.mark.parametrize("content", [None, "", "two\nlines", "ümlaut"])
def test_a_token_that_cannot_be_read_is_sent_to_nobody(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "t").write_text(content)
    with a_listener() as listener, pytest.raises(NotReached, match="cannot be read from t"):
        asked(listener, tmp_path, token_file="t")
    assert listener.told == []


def test_a_certificate_of_an_own_authority_is_trusted_once_it_is_named(
    workspace: Workspace, certificate: tuple[Path, Path], tmp_path: Path
) -> None:
    with served(workspace, certificate=certificate) as site:
        with pytest.raises(NotReached, match=r"self-signed") as caught:
            ask(OtherBridge("Severn", site.url), tmp_path, HttpClient())
        assert "certificate_file" in caught.value.remedy
        named = OtherBridge("Severn", site.url, certificate_file=str(certificate[0]))
        assert ask(named, tmp_path, HttpClient()).bridge == "Test bridge"
    gone = replace(named, certificate_file="gone.pem")
    with pytest.raises(NotReached, match=r"no file gone\.pem"):
        ask(gone, tmp_path, HttpClient())


# ---------------------------------------------------------------- how long a page takes


def test_silent_bridges_are_given_up_together(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent, ExitStack() as stack:
        silent.settimeout(120)
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        others = [OtherBridge(f"B{n}", url) for n in range(6)]
        asking = OtherBridges(timeout_s=1.0)
        stack.callback(asking.close)
        found = asking.rows(others, tmp_path)
        for _ in others:  # all are asked though none has answered
            stack.enter_context(silent.accept()[0])
    assert all("no answer within 1 s" in str(each.trouble).lower() for each in found)


def test_bridge_is_asked_again_after_some_seconds(tmp_path: Path) -> None:
    clock, answers = [NOW], [Answer(200, dump(asdict(SAID)).encode())]
    with a_listener(lambda _: answers[0]) as listener:
        severn = OtherBridge("Severn", listener.url.removesuffix("/alerts"))
        asking = OtherBridges(clock=lambda: clock[0])
        (row,) = asking.rows([severn], tmp_path)
        assert (row.summary, row.asked_at, row.trouble) == (SAID, NOW, None)
        assert row.states == (("No change", "steady"),)
        answers[0] = Answer(cut=True)
        assert asking.rows([severn], tmp_path) == [row]  # just asked: it is not asked again
        clock[0] = NOW + timedelta(hours=3)
        (lost,) = asking.rows([severn], tmp_path)
        assert (lost.summary, lost.asked_at) == (None, clock[0])
        assert (lost.states, lost.urgency) == ((("Not reached", "alert"),), "today")
        asking.close()
    assert len(listener.told) == 2
