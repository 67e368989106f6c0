"""Who runs it and who may come in: `doctor`, `daemon`, `token`, `web`, `user`, `alerts test`."""

from __future__ import annotations

import io
import json
import re
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.store import Workspace
from shm_daemon.heartbeat import beat
from tests.cli.conftest import Ended, Shm
from tests.helpers.listeners import Answer, Listener, a_listener
from tests.helpers.workspaces import make_workspace


def test_without_a_fault_the_exit_code_is_0(shm: Shm, empty: Workspace) -> None:
    ended = shm("--workspace", empty.folder, "doctor")
    assert ended.code == 0
    assert "warning  hooks" in ended.out
    assert "-> See docs/alerts.md." in ended.out
    assert ended.out.splitlines()[-1].startswith("faults: 0, warnings: ")


def test_a_store_that_cannot_be_used_is_exit_code_5(shm: Shm, empty: Workspace) -> None:
    empty.database.write_bytes(b"")
    ended = shm("--workspace", empty.folder, "doctor", "--json")
    assert (ended.code, ended.err) == (5, "")
    assert ended.document["worst"] == "fault"
    (store,) = [each for each in ended.document["findings"] if each["check"] == "store"]
    assert store["level"] == "fault"
    assert store["remedy"] == "Run `shm db upgrade`."


@pytest.mark.parametrize("harm", ["no description", "no folder", "no archive"])
def test_another_fault_is_exit_code_1(shm: Shm, empty: Workspace, harm: str) -> None:
    if harm == "no description":
        (empty.folder / "bridge.toml").unlink()
    else:
        shutil.rmtree(empty.folder if harm == "no folder" else empty.folder / "archive")
    ended = shm("--workspace", empty.folder, "doctor")
    assert (ended.code, ended.err) == (1, "")
    assert "fault" in ended.out


def test_a_bridge_with_a_history_is_examined(on_bridge: Shm) -> None:
    levels = {each["check"]: each["level"] for each in on_bridge.json("doctor")["findings"]}
    assert (levels["store"], levels["raw files"]) == ("ok", "ok")


def test_status_shows_the_daemon_the_queue_and_what_is_open(shm: Shm, empty: Workspace) -> None:
    call = ("--workspace", empty.folder, "status")
    document = shm(*call, "--json").document
    assert document["daemon"] == {"active": None, "seen_at": None, "failed": None}
    assert (document["under_way"], document["open_alerts"]) == (0, 0)
    assert document["disk_free_bytes"] > 0
    assert "daemon: none active, never seen" in shm(*call).out
    with empty.lock():
        beat(empty)
        assert shm(*call, "--json").document["daemon"]["active"].startswith("process ")
        assert " ago" in shm(*call).out


def test_the_daemon_prints_its_unit_and_does_not_begin(shm: Shm, empty: Workspace) -> None:
    ended = shm("--workspace", empty.folder, "daemon", "--standby", "--workers", 2, "--print-unit")
    assert ended.code == 0
    assert ended.out == ended.out.rstrip() + "\n"  # as a file is kept
    assert "ExecStart=/usr/bin/env shm daemon --standby --workers 2" in ended.out.splitlines()
    assert f"Environment=SHM_WORKSPACE={empty.folder}" in ended.out.splitlines()
    assert not (empty.folder / "daemon.heartbeat").exists()


def test_the_daemon_logs_to_a_file_that_is_named(
    shm: Shm, empty: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[tuple[object, ...]] = []
    monkeypatch.setattr("shm_daemon.logs.begin_logging", lambda *given: begun.append(given))
    monkeypatch.setattr("shm_daemon.loop.run", lambda *given, **named: None)
    monkeypatch.setenv("SHM_LOG_FORMAT", "json")
    log = tmp_path / "shm.log"
    assert shm("--workspace", empty.folder, "daemon", "--log-file", log).code == 0
    ((settings, file),) = begun
    assert (getattr(settings, "log_format", None), file) == ("json", log)


def test_a_token_is_told_once_listed_without_its_secret_and_revoked(on_empty: Shm) -> None:
    made = on_empty("token", "create", "logger", "--scope", "write")
    secret = made.out.strip()
    assert made.code == 0
    assert secret.startswith("shm_")
    listed = on_empty("token", "list", "--json")
    (token,) = listed.document["tokens"]
    assert (token["name"], token["scopes"]) == ("logger", ["read", "write"])
    assert secret not in listed.out + on_empty("token", "list").out
    assert on_empty("token", "create", "logger").code == 2
    assert on_empty("token", "revoke", "logger").code == 0
    assert on_empty("token", "revoke", "logger").code == 4


def test_unit_has_the_address(on_empty: Shm) -> None:
    web = on_empty("web", "--port", 8500, "--print-unit").out
    assert "ExecStart=/usr/bin/env shm web --host 127.0.0.1 --port 8500\n" in web
    daemon = on_empty("daemon", "--web", "--print-unit").out
    assert "shm daemon --web --host 127.0.0.1 --port 8400\n" in daemon


PASSWORD = "correct horse battery"


@pytest.fixture
def user(on_empty: Shm, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Ended]:
    def call(*words: object, password: str = "") -> Ended:
        monkeypatch.setattr("sys.stdin", io.StringIO(f"{password}\n"))
        return on_empty("user", *words)

    return call


def test_a_user_is_made_listed_without_a_secret_and_removed(user: Callable[..., Ended]) -> None:
    assert "at least 15 characters" in " ".join(user("add", "--help", password="").out.split())
    made = user("add", "M. Huber", "--role", "operator", "--json", password=PASSWORD)
    expected = {"schema": "shm.user_add/1", "name": "M. Huber", "role": "operator"}
    assert made.document == expected
    listed = user("list", "--json")
    (one,) = listed.document["users"]
    assert (one["name"], one["role"], one["removed_at"]) == ("M. Huber", "operator", None)
    assert "argon2" not in listed.out
    assert user("remove", "M. Huber").code == 0
    assert user("list", "--json").document["users"][0]["removed_at"]
    assert user("add", "M. Huber", password=PASSWORD).code == 0


def test_single_sign_on_has_no_password(user: Callable[..., Ended], empty: Workspace) -> None:
    assert user("add", "ann@example.org").code == 2  # an empty line is none
    assert user("add", "ann@example.org", "--single-sign-on").code == 0
    with empty.store() as store:
        assert store.people.sign_in("ann@example.org", "", utc_now()) is None
        assert store.people.sign_in_as("ann@example.org", utc_now())
        assert store.people.sign_in_as("Ann@example.org", utc_now()) is None


def test_password_of_stdin_signs_in(user: Callable[..., Ended], empty: Workspace) -> None:
    user("add", "a", password=PASSWORD)
    assert user("password", "a", password="four other long words").code == 0
    with empty.store() as store:
        at = store.people.list_all()[0].made_at
        assert store.people.sign_in("a", PASSWORD, at) is None
        assert store.people.sign_in("a", "four other long words", at)


def test_user_changes_to_single_sign_on(user: Callable[..., Ended], empty: Workspace) -> None:
    user("add", "ann@example.org", password=PASSWORD)
    with empty.store() as store, pytest.raises(UsageError, match="with a password"):
        store.people.sign_in_as("ann@example.org", utc_now())
    assert user("single-sign-on", "ann@example.org").code == 0
    assert "single sign-on" in user("list").out
    assert user("list", "--json").document["users"][0]["single_sign_on"] is True
    with empty.store() as store:
        assert store.people.sign_in_as("ann@example.org", utc_now())
        for password in ("", PASSWORD):
            assert store.people.sign_in("ann@example.org", password, utc_now()) is None
    assert user("password", "ann@example.org", password=PASSWORD).code == 0
    assert user("list", "--json").document["users"][0]["single_sign_on"] is False


def test_what_cannot_be_done_says_how_to_go_on(user: Callable[..., Ended]) -> None:
    user("add", "a", password=PASSWORD)
    for words, password, code, said in (
        ("add b", "short", 2, "four or five words"),
        ("add a", PASSWORD, 2, "shm user remove a"),
        ("password a", "short", 2, "four or five words"),
        ("password b", PASSWORD, 4, "shm user list"),
        ("remove b", "", 4, "shm user list"),
        ("single-sign-on b", "", 4, "shm user list"),
    ):
        refused = user(*words.split(), password=password)
        assert refused.code == code
        assert said in refused.said


@pytest.fixture
def listener() -> Iterator[Listener]:
    with a_listener() as listener:
        yield listener


@pytest.fixture
def hooked(tmp_path: Path, listener: Listener) -> Workspace:
    """Return a workspace with a command hook `mail` and a webhook `ops`."""
    workspace = make_workspace(
        tmp_path / "bridge", hooks={"mail": ["tee", "told.json"], "none": ["/no/such/program"]}
    )
    described = Path(workspace.bridge.source)
    hook = f'\n[[hook]]\nname = "ops"\nurl = "{listener.url}"\nsecret_file = "secret"\n'
    described.write_text(described.read_text() + hook)
    (workspace.folder / "secret").write_text("not for everyone")
    return workspace


def rows_of(workspace: Workspace) -> dict[str, int]:
    """Return how many rows each table of the store has."""
    with closing(sqlite3.connect(workspace.folder / "shm.db")) as store:
        names = [
            name for (name,) in store.execute("SELECT name FROM sqlite_master WHERE type='table'")
        ]
        return {name: store.execute(f"SELECT count(*) FROM {name}").fetchone()[0] for name in names}


def test_test_alert_is_in_audit_log_alone(shm: Shm, hooked: Workspace) -> None:
    before = rows_of(hooked)
    ended = shm.at(hooked).done("alerts test --hook mail")
    assert rows_of(hooked) == {**before, "journal": before["journal"] + 1}
    (newest, *_) = shm.at(hooked).json("audit")["changes"]
    assert (newest["action"], newest["subject"]) == ("hook tested", "mail")
    assert (newest["detail"], newest["via"]) == ("it arrived", "command line")
    assert shm.at(hooked).json("alerts")["alerts"] == []
    assert "The hook mail took the test alert in" in ended.out
    told = json.loads((hooked.folder / "told.json").read_text())
    assert re.fullmatch(r"test:mail:20\d\d-\d\d-\d\dT[\d:.]+Z", told["key"])
    assert (told["kinds"], told["drifts"]) == (["test"], [])
    assert "This is a test of the hook mail of Test bridge." in told["message"]
    assert "Nothing has happened" in told["message"]


def test_webhook_beside_a_daemon(shm: Shm, hooked: Workspace, listener: Listener) -> None:
    with hooked.lock():
        ended = shm("alerts", "test", "--hook", "ops", "--json", "--workspace", hooked.folder)
    assert ended.code == 0
    assert (ended.document["kind"], ended.document["answer"]) == ("webhook", "200 OK")
    assert listener.told[0].headers["Idempotency-Key"] == ended.document["key"]


@pytest.mark.parametrize(("status", "remedy"), [(503, "its server runs"), (401, "its secret")])
def test_a_hook_that_does_not_take_the_test_gives_an_error_with_a_remedy(
    shm: Shm, hooked: Workspace, listener: Listener, status: int, remedy: str
) -> None:
    listener.answer = lambda told: Answer(status, b"not today")
    ended = shm("--workspace", hooked.folder, "alerts", "test", "--hook", "ops", "--json")
    assert (ended.code, ended.document["error"]) == (1, "failed")
    assert f"answered {status}: not today" in ended.err
    assert remedy in ended.err
    assert len(listener.told) == 1  # tried once


def test_a_hook_that_is_not_there_is_named_with_those_that_are(shm: Shm, hooked: Workspace) -> None:
    shm = shm.at(hooked)
    ended = shm("alerts test --hook none")
    assert ended.code == 1
    assert "Check its path." in ended.err
    ended = shm("alerts test --hook pager")
    assert ended.code == 2
    assert "no hook pager (known: mail, none, ops)" in ended.err
    assert shm("alerts").told == "No alert has been raised."
    assert shm("alerts", "--workspace", hooked.folder).told == "No alert has been raised."
