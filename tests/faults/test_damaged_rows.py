"""A damaged row is named, stops its hanger alone, and is made again from the archive."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sqlalchemy as sa

import shm_daemon
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import bridge_report, hanger_lines
from shm.pipeline.reporting import hanger_report
from shm.report.hanger_status import Status
from shm.store import Stage, Store, Workspace
from shm.store.checking import check_store
from shm.store.tables import posteriors
from shm.values import FloatArray
from shm_cli import working
from shm_cli.main import run
from tests.helpers import quick_update
from tests.helpers.contents import quiet
from tests.helpers.damaging import change, damage, flipped
from tests.helpers.flows import Clock, a_flow, receive_all, tension_kn, threads
from tests.helpers.workspaces import START, make_workspace, write_test


@pytest.fixture(scope="module", autouse=True)
def _quick() -> Iterator[None]:
    """The sampler's stand-in, also for the command line. Two equal hangers ring alike, which
    is not what is tried here."""
    with pytest.MonkeyPatch.context() as patch:
        quick_update.stand_in(patch.setattr)
        patch.setattr(working, "executor_of", threads)
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two hangers with three tests each, all through; each has an alert, and a notice before it."""
    workspace = make_workspace(tmp_path_factory.mktemp("damage") / "bridge", hangers=(3, 4))
    for hanger in (3, 4):
        for day, tension in ((0, 1.0), (59, 0.8), (60, 0.8)):
            name = f"h{hanger}-{day}.modes.json"
            write_test(workspace.spool / name, workspace, hanger=hanger, day=day, tension=tension)
    with a_flow(workspace) as flow:
        receive_all(flow)
        flow.drain()
    return workspace.folder


@pytest.fixture
def bridge(made: Path, tmp_path: Path) -> Workspace:
    return Workspace.open(shutil.copytree(made, tmp_path / "bridge"))


def through_the_flow(workspace: Workspace) -> dict[str, Stage]:
    """Takes in what lies in the spool; where each file then stands."""
    with a_flow(workspace, clock=Clock(START + timedelta(days=200))) as flow:
        receive_all(flow)
        flow.drain()
        return {each.file.file_name: each.stage for each in flow.store.recordings.list_all()}


def next_tests(workspace: Workspace) -> None:
    for hanger in (3, 4):
        path = workspace.spool / f"h{hanger}-90.modes.json"
        write_test(path, workspace, hanger=hanger, day=90, tension=0.8)


def troubles(workspace: Workspace) -> tuple[str, ...]:
    with workspace.store() as store:
        return check_store(store, quiet).troubles


def test_one_damaged_posterior_stops_its_hanger_alone_and_says_so(
    bridge: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    before = tension_of(bridge)
    damage(bridge, "posteriors", "samples", 1)
    next_tests(bridge)
    stages = through_the_flow(bridge)
    assert (stages["h4-90.modes.json"], stages["h3-90.modes.json"]) == (Stage.DONE, Stage.RECEIVED)
    assert run(["--workspace", str(bridge.folder), "status"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "hanger 3 stands still: row 1 of posteriors of hanger 3 is damaged" in said
    assert "shm ingest --again" in said
    with bridge.store() as store:
        assert [row.hanger for row in store.upkeep.known_damage()] == [3]
    assert run(["--workspace", str(bridge.folder), "ingest", "--again", "h3-0"]) == 0
    assert troubles(bridge) == ()
    stages = through_the_flow(bridge)
    assert set(stages.values()) == {Stage.DONE}
    after = tension_of(bridge)
    assert {name: after[name] for name in before} == pytest.approx(before, rel=1e-3)
    with bridge.store() as store:
        assert store.upkeep.known_damage() == ()


@pytest.mark.parametrize(("table", "column"), [("posteriors", "samples"), ("tests", "document")])
def test_status_tells_a_damaged_baseline_before_a_test_meets_it(
    bridge: Workspace, capsys: pytest.CaptureFixture[str], table: str, column: str
) -> None:
    damage(bridge, table, column, 1)
    assert run(["--workspace", str(bridge.folder), "status"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"hanger 3 stands still: row 1 of {table} of hanger 3 is damaged" in said


def baseline_tension_n(workspace: Workspace) -> FloatArray:
    with workspace.store() as store:
        baseline = store.watch.baseline(3)
        assert baseline is not None
        return baseline.posterior.tension_n


def tension_of(workspace: Workspace) -> dict[str, float]:
    with workspace.store() as store:
        return tension_kn(store)


def test_the_daemon_lives_with_a_damaged_posterior(bridge: Workspace) -> None:
    damage(bridge, "posteriors", "samples", 1)
    next_tests(bridge)
    shm_daemon.run(bridge, once=True, make_executor=threads)
    with bridge.store() as store:
        assert store.tests.named(4, "h4-90").stage is Stage.WATCHED
        # It cannot be judged without the baseline, so it is not even kept as identified.
        assert store.recordings.list_all()[6].stage is Stage.RECEIVED
        assert [row.hanger for row in store.upkeep.known_damage()] == [3]


def test_what_all_hangers_are_asked_for_answers_without_the_damaged_one(bridge: Workspace) -> None:
    """Of each table that a page, a report or `shm status` reads, one row damaged at a time."""
    for table, column, id_ in (
        ("posteriors", "document", 2),
        ("tests", "document", 2),
        ("watches", "document", 1),
        ("alerts", "document", 1),
        ("summaries", "document", 2),
        ("watch_states", "content", 1),
        ("recordings", "received_at", 2),
        ("tests", "time", 2),
    ):
        with values_changed(bridge, table, column, id_):
            with bridge.store() as store:
                lines = hanger_lines(bridge, store, utc_now())
                assert len(lines) == 2
                assert lines[1].status is Status.ALERT, table
                assert hanger_report(bridge, store, 4, START).posterior.hanger == 4
                assert len(store.alerts.list_all()) == len(store.alerts.list_rows()) == 4
            assert run(["--workspace", str(bridge.folder), "status"]) == 0
            assert run(["--workspace", str(bridge.folder), "report", "--bridge"]) == 0
            assert run(["--workspace", str(bridge.folder), "db", "check"]) == 5


def test_a_bridge_report_names_a_damaged_test_and_shows_the_other_hangers(
    bridge: Workspace,
) -> None:
    """One whose row is read for its sensors alone: until then nothing finds the damage."""
    with values_changed(bridge, "tests", "time", 2), bridge.store() as store:
        lines = bridge_report(bridge, store, utc_now()).hangers
    assert lines[0].status is None
    assert "row 2 of tests of hanger 3 is damaged" in lines[0].called
    assert lines[1].status is Status.ALERT
    assert not lines[1].called.startswith("row")


def test_a_damaged_watch_shows_no_green_hanger(bridge: Workspace) -> None:
    damage(bridge, "watches", "document", 2)
    with bridge.store() as store:
        line = hanger_lines(bridge, store, utc_now())[0]
    assert line.status is None
    assert "row 2 of watches of hanger 3 is damaged" in line.called


@contextmanager
def values_changed(workspace: Workspace, table: str, column: str, id_: int) -> Iterator[None]:
    """One value is damaged while the context lasts."""
    before: list[Any] = []

    def altered(value: Any) -> Any:
        before.append(value)
        return "no time" if column in ("time", "received_at") else flipped(value)

    change(workspace.location, table, column, id_, altered)
    yield
    change(workspace.location, table, column, id_, lambda _: before[0])


@pytest.mark.parametrize(
    ("table", "column", "id_"),
    [
        ("tests", "document", 1),  # of the baseline
        ("tests", "document", 3),
        ("posteriors", "document", 1),
        ("posteriors", "samples", 3),
        ("watches", "document", 1),
        ("summaries", "document", 1),
        ("watch_states", "content", 1),
    ],
)
def test_what_can_be_computed_is_made_again_from_the_archive(
    bridge: Workspace, table: str, column: str, id_: int
) -> None:
    before, baseline_n = tension_of(bridge), baseline_tension_n(bridge)
    damage(bridge, table, column, id_)
    assert any(f"of {table}" in said for said in troubles(bridge))
    recording = str(id_ if table in ("tests", "posteriors") else 2)
    assert run(["--workspace", str(bridge.folder), "ingest", "--again", recording]) == 0
    assert troubles(bridge) == ()
    assert tension_of(bridge) == pytest.approx(before, rel=1e-3)
    assert np.array_equal(baseline_tension_n(bridge), baseline_n)
    next_tests(bridge)
    assert set(through_the_flow(bridge).values()) == {Stage.DONE}


def test_an_update_of_a_damaged_row_does_not_make_it_pass_for_whole(bridge: Workspace) -> None:
    damage(bridge, "posteriors", "samples", 2)
    with bridge.store() as store:
        with store.writing() as connection:
            changed = sa.update(posteriors).where(posteriors.c.id == 2)
            connection.execute(changed.values(superseded_at=START))
        assert [(each.table, each.id) for each in check_store(store, quiet).damaged] == [
            ("posteriors", 2)
        ]


def test_a_backup_keeps_all_else_and_names_the_damaged_row(
    bridge: Workspace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    damage(bridge, "posteriors", "document", 2)
    file = tmp_path / "safe.db"
    assert run(["--workspace", str(bridge.folder), "db", "backup", str(file)]) == 5
    assert "row 2 of posteriors of hanger 3 is damaged" in capsys.readouterr().err
    with Store.open(file) as store:
        assert len(store.recordings.list_all()) == 6


@pytest.mark.parametrize(
    ("was", "became"),
    [("CONSTRAINT fk_tests", "CONSTRAINT fk_tdsts"), ("archived_as TEXT", "archived_as TEPT")],
)
def test_a_flip_in_the_text_of_the_schema_is_found_and_a_restore_heals_it(
    bridge: Workspace, was: str, became: str
) -> None:
    bits = bridge.database.read_bytes()
    assert bits.count(was.encode()) >= 1
    bridge.database.write_bytes(bits.replace(was.encode(), became.encode(), 1))
    backup = bridge.folder / "backup.db"
    assert run(["--workspace", str(bridge.folder), "db", "check"]) == 5
    assert run(["--workspace", str(bridge.folder), "db", "backup", str(backup)]) == 5
    assert run(["--workspace", str(bridge.folder), "db", "restore", str(backup), "--replace"]) == 0
    assert run(["--workspace", str(bridge.folder), "db", "check", "--archive"]) == 0


def test_a_name_in_the_archive_that_became_a_number_ends_no_check(
    bridge: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    bits = bridge.database.read_bytes()
    bridge.database.write_bytes(bits.replace(b"archived_as TEXT", b"archived_as TINT", 1))
    with closing(sqlite3.connect(bridge.database)) as connection, connection:
        connection.execute("UPDATE recordings SET archived_as = '7' WHERE id = 1")
    assert run(["--workspace", str(bridge.folder), "db", "check", "--archive"]) == 5
    assert "archive/7" in capsys.readouterr().err
