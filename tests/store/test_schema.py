"""The schema, proven twice: tables equal migrations, and every released schema upgrades."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from shm.errors import NothingThere, SchemaOutdated, StoreError
from shm.resources import migrations_folder
from shm.store import AlertNote, Decision, Stage, Store
from shm.store.journal import (
    change_document,
    list_changes,
    list_events,
    list_former_tests,
    list_steps,
)
from shm.store.posteriors import list_history
from shm.store.recordings import count_stages, find_latest_hold, list_holds
from shm.store.rows import Ending
from shm.store.schema import changed_objects
from shm.store.tables import SCHEMA, metadata, tests
from shm.store.tests import list_baseline_tests, list_known_samples
from shm.store.watch import list_selected_models
from shm.values import Fingerprint
from tests.helpers.nouns import NOW, a_change

RELEASED = sorted(Path(__file__).parent.glob("data/schema_*.db"))


def test_the_migrations_make_exactly_the_tables(store: Store) -> None:
    with store.engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, metadata) == []


def test_the_schema_named_in_the_code_is_the_newest_migration() -> None:
    config = Config()
    config.set_main_option("script_location", str(migrations_folder()))
    assert ScriptDirectory.from_config(config).get_heads() == [SCHEMA]


def test_a_database_of_each_release_and_of_today_is_kept() -> None:
    """0.1.0 had the first schema, 1.0.0 the fourteenth; the fifteenth came after it."""
    numbers = [path.stem.removeprefix("schema_") for path in RELEASED]
    assert numbers == ["0001", "0014", "0015", "0016", SCHEMA]


@pytest.mark.parametrize("released", RELEASED, ids=lambda path: path.stem)
def test_a_released_database_upgrades_and_keeps_its_contents(
    released: Path, tmp_path: Path
) -> None:
    path = tmp_path / "shm.db"
    shutil.copyfile(released, path)
    Store.upgrade(path)
    with Store.open(path) as store:
        context = MigrationContext.configure(store.engine.connect())
        assert compare_metadata(context, metadata) == []
        assert changed_objects(context.connection) == ()
        context.connection.close()
        assert count_stages(store)[Stage.DONE] >= 2
        assert count_stages(store)[Stage.REFUSED] == 1
        assert [test.test.id for test in store.tests.list_all(3)][:2] == ["t1", "t2"]
        (_, first), (_, second) = list_history(store, 3)[:2]
        assert first.tension_n.mean() == pytest.approx(711e3, rel=0.02)
        assert second.model == list_selected_models(store)[3] == "beam1"
        assert store.watch.baseline(3) is not None
        assert {drift.quantity for drift in store.watch.list_drifts(3)} == {"tension"}
        assert store.alerts.list_all()[0].alert.key == "hanger-3:tension-down"
        assert {delivery.hook for delivery in store.alerts.list_deliveries()} == {"mail"}
        assert [event.kind for event in list_events(store)][:2] == [
            "duplicate",
            "refused",
        ]


def upgraded(schema: int, folder: Path) -> Store:
    path = folder / "shm.db"
    shutil.copyfile(RELEASED[schema], path)
    Store.upgrade(path)
    return Store.open(path)


def test_a_database_of_the_first_release_has_alerts_open_and_what_is_known_of_its_steps(
    tmp_path: Path,
) -> None:
    with upgraded(0, tmp_path) as store:
        (stored,) = store.alerts.list_all()
        assert (stored.alert.kinds, stored.alert.change) == ((), None)
        assert stored.acknowledgement is None
        assert store.watch.list_all() == ()
        baseline = store.watch.baseline(3)
        assert baseline is not None
        assert (baseline.since, baseline.posterior.tests) == (None, ("t1",))
        steps = list_steps(store, 1)
        assert [(step.kind, step.test, step.version) for step in steps] == [
            ("received", None, None),
            ("identified", "t1", "0.1.0"),
        ]
        with store.reading() as connection:
            rows = connection.execute(sa.select(tests.c.taken_at, tests.c.temperature_c)).all()
        stored_tests = [each.test for each in store.tests.list_all(3)]
        assert [tuple(row) for row in rows] == [(t.time, t.temperature_c) for t in stored_tests]


@pytest.mark.parametrize(
    ("who", "why", "kind"),
    [
        ("shm", "judged again with the thresholds in force (tension 5 %)", Ending.JUDGED_AGAIN),
        ("Ann", "test discarded by Ann: a van", Ending.TEST_DISCARDED),
        ("shm", "tests t3 and t4, of two visits, do not show it any more", Ending.OVER),
        ("Ann", "a new pin", Ending.BY_PERSON),
    ],
)
def test_how_an_alert_ended_was_its_first_words(
    who: str, why: str, kind: Ending, tmp_path: Path
) -> None:
    path = tmp_path / "shm.db"
    shutil.copyfile(RELEASED[3], path)
    with closing(sqlite3.connect(path)) as former, former:
        ended = "UPDATE alerts SET ended_at = raised_at, ended_who = ?, ended_why = ? WHERE id = 1"
        former.execute(ended, (who, why))
    Store.upgrade(path)
    with Store.open(path) as store:
        end = store.alerts.get(1).resolution
        assert end is not None
        assert (end.who, end.why, end.ending) == (who, why, kind)


@pytest.mark.parametrize("schema", [1, 2])
def test_all_that_a_database_of_1_0_0_holds_is_kept(schema: int, tmp_path: Path) -> None:
    with upgraded(schema, tmp_path) as store:
        stored = store.alerts.list_all()[0]
        assert stored.alert.kinds == ("beyond threshold",)
        assert stored.alert.change == a_change()
        assert stored.acknowledgement == AlertNote(1, "engineer", "looked at the pin", NOW)
        watch = store.watch.list_all(3)[0]
        assert watch.watched.change == a_change()
        assert [drift.quantity for drift in watch.watched.drifts] == ["tension"]
        baseline = store.watch.baseline(3)
        assert baseline is not None
        assert (baseline.why, baseline.posterior.tests) == ("new pin", ("t2",))
        assert [test.test.id for test in list_baseline_tests(store, baseline)] == ["t2"]
        (test,) = list_former_tests(store, 4)
        assert [made.superseded_at for made in test.posteriors] == [NOW, None]
        assert store.posteriors.get(3, "t4").seed == 11
        confirmed = find_latest_hold(store, 5)
        assert confirmed is not None
        assert (confirmed.decision, confirmed.who) == (Decision.CONFIRMED, "engineer")
        assert confirmed.time == confirmed.decided_at == NOW + timedelta(days=9)
        (waits,) = list_holds(store)
        assert [(test.name, test.tension_shift) for test in waits.tests] == [("t6", -0.1)]
        assert [doubt.check for doubt in waits.doubts] == ["copy"]
        known = list_known_samples(store, 7, 5, Fingerprint("0" * 64, np.ones((1, 256))))
        assert [each.fingerprint.shapes.shape for each in known] == [(1, 256)] * 2
        assert store.recordings.get(5).file.modified_at == NOW


def test_four_histories_become_one_journal_in_which_a_refusal_is_one_entry(tmp_path: Path) -> None:
    with upgraded(1, tmp_path) as store:
        steps = [(each.kind, each.test) for each in list_steps(store, 3)]
        assert steps == [("archived", None), ("received", None), ("refused", None)]
        assert list_steps(store, 3)[-1].version == "0.1.0"
        events = [(each.kind, each.subject) for each in list_events(store)]
        assert events.count(("refused", "h3-3.csv")) == 1
        held = [each.kind for each in list_steps(store, 6) if each.test is None]
        assert held.count("held") == 1
        changes = {(each.who, change_document(each)["action"]) for each in list_changes(store)}
        assert ("engineer", "recording confirmed") in changes
        assert ("engineer", "baseline set") in changes


def test_a_schema_between_two_releases_is_refused_with_the_release_that_upgrades_it(
    tmp_path: Path,
) -> None:
    path = tmp_path / "shm.db"
    shutil.copyfile(RELEASED[1], path)
    _set_version(path, "0009")
    with pytest.raises(StoreError, match="no release of shm had") as caught:
        Store.upgrade(path)
    assert "shm 1.0.0" in caught.value.remedy
    assert "audit" in _tables(path)


@pytest.mark.parametrize("version", ["0000", None])
def test_an_older_schema_is_refused_with_the_command_that_mends_it(
    tmp_path: Path, version: str | None
) -> None:
    path = tmp_path / "shm.db"
    Store.create(path).close()
    _set_version(path, version)
    with pytest.raises(SchemaOutdated, match="shm db upgrade") as caught:
        Store.open(path)
    assert caught.value.exit_code == 5


def test_a_schema_of_the_future_is_refused_and_not_touched(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    Store.create(path).close()
    _set_version(path, "9999")
    for attempt in (Store.open, Store.upgrade):
        with pytest.raises(SchemaOutdated, match="newer"):
            attempt(path)
    assert _tables(path) >= {"recordings", "tests"}


def test_an_upgrade_that_fails_leaves_nothing_half_done(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE tests (id INTEGER)")
    connection.close()
    with pytest.raises(StoreError):
        Store.upgrade(path)
    assert _tables(path) == {"tests"}


def test_upgrading_twice_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    Store.create(path).close()
    with closing(sqlite3.connect(path)) as store:
        before = list(store.iterdump())
        Store.upgrade(path)
        assert list(store.iterdump()) == before


def test_what_is_not_a_database_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    path.write_text("not a database, but long enough to be taken for one" * 100)
    with pytest.raises(StoreError, match="is not a database"):
        Store.open(path)


def test_a_missing_store_is_not_made_by_looking(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    for attempt in (Store.open, Store.upgrade):
        with pytest.raises(NothingThere, match="shm init"):
            attempt(path)
    assert not path.exists()


def _set_version(path: Path, version: str | None) -> None:
    connection = sqlite3.connect(path)
    with connection:
        connection.execute("DELETE FROM alembic_version")
        if version is not None:
            connection.execute("INSERT INTO alembic_version VALUES (?)", (version,))
    connection.close()


def _tables(path: Path) -> set[str]:
    connection = sqlite3.connect(path)
    rows = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
    connection.close()
    return {name for (name,) in rows}
