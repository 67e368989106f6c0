"""The doctor: each trouble is found and named with what to do, and nothing stops it."""

from __future__ import annotations

import re
import shutil
import sqlite3
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from shm.pipeline.intake import receive
from shm.store import Archive, DeliveryState, Workspace
from shm_cli.main import run
from shm_daemon import doctor as checks
from shm_daemon.doctor import Finding, Level, examine
from shm_daemon.heartbeat import HEARTBEAT, beat, turn_failed
from tests.helpers.nouns import NOW
from tests.helpers.outboxes import make_baseline, raise_alerts
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.workspaces import make_workspace, put, write_test


def found(workspace: Workspace, check: str, now: datetime | None = None) -> list[Finding]:
    """Return the findings of one check, by default with the clock of the test machine."""
    findings = examine(workspace.folder, now or datetime.now(UTC))
    assert not [each for each in findings if "report it" in each.remedy], findings
    return [each for each in findings if each.check == check]


def only(workspace: Workspace, check: str, now: datetime | None = None) -> Finding:
    (finding,) = found(workspace, check, now)
    return finding


def describe(workspace: Workspace, text: str) -> None:
    """Put text in front of the description, before its first table."""
    path = workspace.folder / "bridge.toml"
    path.write_text(path.read_text().replace("[settings]", f"{text}\n\n[settings]"))


def test_a_new_workspace_has_no_fault(workspace: Workspace) -> None:
    findings = examine(workspace.folder, datetime.now(UTC))
    assert {each.check for each in findings if each.level is Level.FAULT} == set()
    assert {"versions", "folders", "disk", "store", "daemon", "clock"} <= {
        each.check for each in findings
    }


def test_every_warning_and_fault_says_what_to_do(workspace: Workspace) -> None:
    workspace.database.write_bytes(b"no database at all, but long enough to be looked at" * 100)
    shutil.rmtree(workspace.folder / "archive")
    findings = examine(workspace.folder, datetime.now(UTC))
    troubled = [each for each in findings if each.level in (Level.WARNING, Level.FAULT)]
    assert len(troubled) >= 3
    assert all(each.remedy for each in troubled)


# ------------------------------------------------------------ broken stores


def test_an_outdated_store_is_told(workspace: Workspace) -> None:
    with closing(sqlite3.connect(workspace.database)) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '0001'")
        connection.commit()
    finding = only(workspace, "store")
    assert (finding.level, finding.remedy) == (Level.FAULT, "Run `shm db upgrade`.")


@pytest.mark.parametrize("harm", ["damaged page", "empty"])
def test_a_broken_store_is_told(workspace: Workspace, harm: str) -> None:
    make_baseline(workspace)
    raise_alerts(workspace, range(1, 20), [])
    content = bytearray(workspace.database.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 8192] = b"\xa5" * 8192
    workspace.database.unlink()
    workspace.database.write_bytes(b"" if harm == "empty" else content)
    finding = only(workspace, "store")
    assert finding.level is Level.FAULT
    assert finding.remedy


def test_a_server_that_is_away_is_told_without_its_password(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = "postgresql://shm:T0P-SECRET@127.0.0.1:1/arch"
    monkeypatch.setenv("SHM_STORE", url)
    findings = examine(workspace.folder, datetime.now(UTC))
    assert "T0P-SECRET" not in str(findings)
    (store,) = [each for each in findings if each.check == "store"]
    assert (store.level, "127.0.0.1" in store.found) == (Level.FAULT, True)


# ------------------------------------------------------------ broken workspaces


def test_no_folder_and_no_description_are_told(tmp_path: Path) -> None:
    (_, finding) = examine(tmp_path / "nowhere", NOW)
    assert (finding.level, finding.remedy) == (Level.FAULT, "Make it with `shm init`.")
    findings = examine(tmp_path, NOW)
    assert [each.check for each in findings if each.level is Level.FAULT] == [
        "folders",
        "bridge.toml",
    ]


def test_a_description_that_everybody_may_change_is_a_fault(workspace: Workspace) -> None:
    (workspace.folder / "bridge.toml").chmod(0o666)
    assert "everybody can change" in only(workspace, "permissions").found


@pytest.mark.parametrize(("wanted", "level"), [("warned", Level.WARNING), ("nearly", Level.FAULT)])
def test_a_disk_with_little_room_is_told(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, wanted: str, level: Level
) -> None:
    free = shutil.disk_usage(workspace.folder).free
    monkeypatch.setenv("SHM_MIN_FREE_BYTES", str(2 * free if wanted == "warned" else 20 * free))
    assert found(workspace, "disk")[0].level is level


# ------------------------------------------------------------ the flow


def test_a_daemon_is_told_by_its_lock_and_its_heartbeat(workspace: Workspace) -> None:
    assert "none is active, never seen" in only(workspace, "daemon").found
    with workspace.lock():
        assert "holds the store" in only(workspace, "daemon").found  # no loop has gone round
        beat(workspace)
        finding = only(workspace, "daemon")
        assert (finding.level, "is active" in finding.found) == (Level.OK, True)
    assert (workspace.folder / HEARTBEAT).exists()
    assert "none is active, last seen" in only(workspace, "daemon").found


def test_files_that_wait_too_long_in_the_spool_are_told(workspace: Workspace) -> None:
    put(workspace.spool / "waits.csv", "x")
    (workspace.spool / "alone.toml").write_text("hanger = 3\n")
    (workspace.spool / "broken.csv.part").write_text("x")
    assert only(workspace, "spool").level is Level.OK
    waiting, alone = found(workspace, "spool", datetime.now(UTC) + timedelta(minutes=20))
    assert "sidecars without their file: alone.toml" in alone.found
    later = datetime.now(UTC) + timedelta(days=2)
    waiting, alone, broken = found(workspace, "spool", later)
    assert (waiting.level, "1 file in the queue" in waiting.found) == (Level.WARNING, True)
    assert "alone.toml" in alone.found
    assert "broken.csv.part" in broken.found


@pytest.mark.slow
def test_raw_files_that_came_after_a_restored_backup_are_named_and_can_be_taken_in(
    workspace: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    write_test(workspace.spool / "a.modes.json", workspace)
    ingest_quickly(workspace)
    say = ["--workspace", str(workspace.folder)]
    assert run([*say, "db", "backup", str(workspace.folder / "backup.db")]) == 0
    write_test(workspace.spool / "b.modes.json", workspace, day=30)
    ingest_quickly(workspace)
    restore = [*say, "db", "restore", str(workspace.folder / "backup.db"), "--replace"]
    assert run(restore) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "Raw files: 1 of the archive belong to no recording" in said
    there, unknown = found(workspace, "raw files", NOW)
    assert (there.level, unknown.level) == (Level.OK, Level.WARNING)
    (name,) = re.findall(r"`shm ingest (archive/\S+)`", unknown.remedy)
    assert run([*say, "ingest", str(workspace.folder / name)]) == 0
    assert only(workspace, "raw files").level is Level.OK


def test_a_turn_that_failed_is_a_fault_until_one_goes_well(workspace: Workspace) -> None:
    with workspace.lock():
        beat(workspace)
        turn_failed(workspace, "OSError: too long")
        beat(workspace)
        finding = only(workspace, "daemon")
        assert finding.level is Level.FAULT
        assert "its last turn failed: OSError: too long" in finding.found
        turn_failed(workspace, "")
        assert only(workspace, "daemon").level is Level.OK


def test_a_recording_that_stands_still_is_told(workspace: Workspace) -> None:
    put(workspace.spool / "stuck.csv", "x")
    with workspace.store() as store:
        receive(workspace.spool / "stuck.csv", workspace, store, NOW)
    assert only(workspace, "recordings", NOW + timedelta(minutes=5)).level is Level.OK
    finding = only(workspace, "recordings", NOW + timedelta(hours=2))
    assert (finding.level, "stuck.csv" in finding.found) == (Level.WARNING, True)
    assert "shm ingest --again 1" in finding.remedy


def test_the_quarantine_and_missing_raw_files_are_told(workspace: Workspace) -> None:
    put(workspace.spool / "bad.csv", "x")
    with workspace.store() as store:
        file = receive(workspace.spool / "bad.csv", workspace, store, NOW).recording.file
    assert only(workspace, "raw files").level is Level.OK
    reason = {"file": "bad.csv", "message": "no header.", "sha256": file.sha256, "time": NOW}
    with workspace.archive.opened(file) as path:
        workspace.quarantine.put(path, "bad.csv", reason, path.with_suffix(".toml"))
    assert "bad.csv: no header." in only(workspace, "quarantine").found
    (workspace.archive.folder / str(file.archived_as)).unlink()
    finding = only(workspace, "raw files")
    assert (finding.level, "bad.csv" in finding.found) == (Level.FAULT, True)


# ------------------------------------------------------------ keeping and telling


def test_backups_that_are_missing_old_or_without_raw_files_are_told(
    workspace: Workspace, tmp_path: Path
) -> None:
    put(workspace.spool / "raw.csv", "x")
    with workspace.store() as store:
        file = receive(workspace.spool / "raw.csv", workspace, store, NOW).recording.file
        assert only(workspace, "backup").found == "never made here"
        store.upkeep.note_backup(tmp_path / "b.db", NOW)
        fresh, alone = found(workspace, "backup", NOW + timedelta(days=1))
        assert (fresh.level, "without a copy elsewhere: 1" in alone.found) == (Level.OK, True)
        copies = Archive(tmp_path / "copies")
        copies.folder.mkdir()
        copies.keep(workspace.archive.folder / str(file.archived_as))
        store.upkeep.note_copies(copies, NOW)
    old = only(workspace, "backup", NOW + timedelta(days=30))
    assert (old.level, "30 d ago" in old.found) == (Level.WARNING, True)


def test_a_clock_that_jumped_back_is_a_fault(workspace: Workspace) -> None:
    make_baseline(workspace)
    assert found(workspace, "clock", NOW + timedelta(hours=1))[0].level is not Level.FAULT
    jumped = found(workspace, "clock", NOW - timedelta(hours=5))[0]
    assert (jumped.level, "5 h before the newest row" in jumped.found) == (Level.FAULT, True)


def test_deliveries_that_fail_and_that_were_given_up_are_told(workspace: Workspace) -> None:
    make_baseline(workspace)
    raise_alerts(workspace, [1, 2], ["siren"])
    assert only(workspace, "deliveries", NOW).level is Level.OK
    assert "not tried yet" in only(workspace, "deliveries", NOW + timedelta(hours=1)).found
    with workspace.store() as store:
        first, second = store.alerts.list_deliveries(DeliveryState.WAITING)
        store.alerts.save_failure(first, "no such host", NOW, NOW + timedelta(hours=9))
        store.alerts.save_failure(second, "answered 403", NOW, None)
    failing, lost = found(workspace, "deliveries", NOW)
    assert "siren, tried 1 times: no such host" in failing.found
    assert "answered 403" in lost.found
    assert len(found(workspace, "deliveries", NOW + timedelta(days=60))) == 1


def test_hooks_that_could_not_be_run_are_told_and_nothing_is_sent(tmp_path: Path) -> None:
    """The one that could run would leave a file behind."""
    left = tmp_path / "left"
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\ntouch {left}\n")
    hooks = {"there": [str(program)], "gone": ["/no/such/program"], "named": ["cat"]}
    workspace = make_workspace(tmp_path / "bridge", hooks=hooks)
    assert only(workspace, "hook there").level is Level.FAULT  # it may not be executed
    program.chmod(0o755)
    assert only(workspace, "hook there").level is Level.OK
    assert only(workspace, "hook named").found.endswith("/cat")
    assert only(workspace, "hook gone").level is Level.FAULT
    assert not left.exists()


def test_secrets_that_are_missing_or_open_to_others_are_told_and_never_shown(
    workspace: Workspace,
) -> None:
    describe(
        workspace,
        '[[hook]]\nname = "web"\nurl = "https://example.org/T0P-SECRET"\nsecret_file = "s"\n\n'
        '[[hook]]\nname = "variable"\nurl = "https://example.org/"\nsecret_env = "NOT_SET"\n\n'
        '[[hook]]\nname = "mail"\napprise_file = "addresses"',
    )
    missing = only(workspace, "hook web")
    assert (missing.level, missing.remedy[:8]) == (Level.FAULT, "Write it")
    assert only(workspace, "hook variable").level is Level.UNKNOWN
    (workspace.folder / "s").write_text("T0P-SECRET")
    (workspace.folder / "s").chmod(0o644)
    (workspace.folder / "addresses").write_text("mailto://ann:T0P-SECRET@example.org\n")
    (workspace.folder / "addresses").chmod(0o600)
    ready, open_to_others = found(workspace, "hook web")
    assert (ready.level, ready.found) == (Level.OK, "example.org")
    assert "others can read s" in open_to_others.found
    assert only(workspace, "hook mail").found == "mailto"
    assert "T0P-SECRET" not in str(examine(workspace.folder, NOW))


def test_a_check_that_fails_hides_no_other(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("a fault of ours")

    monkeypatch.setattr(checks, "scan", broken)
    findings = examine(workspace.folder, datetime.now(UTC))
    (spool,) = [each for each in findings if each.check == "spool"]
    assert (spool.level, "ZeroDivisionError" in spool.found) == (Level.UNKNOWN, True)
    assert "hangers" in {each.check for each in findings}


def test_looking_changes_nothing(workspace: Workspace) -> None:
    make_baseline(workspace)
    put(workspace.spool / "a.csv", "x")

    def state() -> dict[str, bytes]:
        files = [path for path in workspace.folder.rglob("*") if path.is_file()]
        return {str(p): p.read_bytes() for p in files if not p.name.endswith(("-shm", "-wal"))}

    before = state()
    examine(workspace.folder, datetime.now(UTC))
    assert state() == before
