"""The schema, proven twice: tables equal migrations, and every released schema upgrades."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from shm.errors import NothingThere, SchemaOutdated, StoreError
from shm.resources import migrations_folder
from shm.store import Acknowledgement, Decision, Stage, Store
from shm.store.database import make_engine
from shm.store.schema import changed_objects
from shm.store.tables import SCHEMA, metadata
from shm.values import Fingerprint
from tests.helpers.nouns import NOW, a_change
from tests.helpers.slow import few_of

RELEASED = sorted(Path(__file__).parent.glob("data/schema_*.db"))


def test_the_migrations_make_exactly_the_tables(store: Store) -> None:
    with store.engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, metadata) == []


def test_the_schema_named_in_the_code_is_the_newest_migration() -> None:
    config = Config()
    config.set_main_option("script_location", str(migrations_folder()))
    assert ScriptDirectory.from_config(config).get_heads() == [SCHEMA]


def test_a_database_of_every_schema_is_kept() -> None:
    migrations = sorted((migrations_folder() / "versions").glob("*.py"))
    numbers = [path.name.split("_")[0] for path in migrations]
    assert [path.stem.removeprefix("schema_") for path in RELEASED] == numbers


@pytest.mark.parametrize("released", few_of(RELEASED, 3), ids=lambda path: path.stem)
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
        assert store.recordings.stage_counts()[Stage.DONE] >= 2
        assert store.recordings.stage_counts()[Stage.REFUSED] == 1
        assert [test.test.id for test in store.tests.list_all(3)][:2] == ["t1", "t2"]
        (_, first), (_, second) = store.posteriors.history(3)[:2]
        assert first.tension_n.mean() == pytest.approx(711e3, rel=0.02)
        assert second.model == store.posteriors.selected_models()[3] == "beam1"
        assert store.watch.baseline(3) is not None
        assert {drift.quantity for drift in store.watch.list_drifts(3)} == {"tension"}
        assert store.alerts.list_all()[0].alert.key == "hanger-3:tension-down"
        assert {delivery.hook for delivery in store.alerts.list_deliveries()} == {"mail"}
        assert [event.kind for event in store.recordings.list_events()][:2] == [
            "duplicate",
            "refused",
        ]


def test_a_database_of_before_the_watch_has_alerts_open_and_its_first_baseline(
    tmp_path: Path,
) -> None:
    path = tmp_path / "shm.db"
    shutil.copyfile(RELEASED[2], path)
    Store.upgrade(path)
    with Store.open(path) as store:
        (stored,) = store.alerts.list_all()
        assert (stored.alert.kinds, stored.alert.change) == ((), None)
        assert stored.acknowledgement is None
        assert store.watch.list_all() == ()
        baseline = store.watch.baseline(3)
        assert baseline is not None
        assert (baseline.since, baseline.posterior.tests) == (None, ("t1",))


def test_the_watch_of_a_released_database_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    shutil.copyfile(RELEASED[3], path)
    Store.upgrade(path)
    with Store.open(path) as store:
        (stored,) = store.alerts.list_all()
        assert stored.alert.kinds == ("beyond threshold",)
        assert stored.alert.change == a_change()
        assert stored.acknowledgement == Acknowledgement(1, "engineer", "looked at the pin", NOW)
        watch = store.watch.list_all(3)[0]
        assert watch.watched.change == a_change()
        assert [drift.quantity for drift in watch.watched.drifts] == ["tension"]
        baseline = store.watch.baseline(3)
        assert baseline is not None
        assert (baseline.why, baseline.posterior.tests) == ("new pin", ("t2",))


def test_of_a_database_of_before_the_steps_what_can_be_told_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    shutil.copyfile(RELEASED[3], path)
    Store.upgrade(path)
    with Store.open(path) as store:
        steps = store.recordings.list_steps(1)
        assert [(step.stage, step.test, step.version) for step in steps] == [
            ("received", None, None),
            ("identified", "t1", "0.1.0"),
        ]
        baseline = store.watch.baseline(3)
        assert baseline is not None
        assert [test.test.id for test in store.tests.of_baseline(baseline)] == ["t2"]


def test_what_was_superseded_is_kept_with_its_lineage(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    shutil.copyfile(RELEASED[4], path)
    Store.upgrade(path)
    with Store.open(path) as store:
        (test,) = store.tests.list_former(4)
        assert [made.superseded_at for made in test.posteriors] == [NOW, None]
        assert store.posteriors.get(3, "t4").seed == 11


def test_what_is_held_is_kept_with_what_a_person_made_of_it(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    shutil.copyfile(RELEASED[6], path)
    Store.upgrade(path)
    with Store.open(path) as store:
        confirmed = store.recordings.latest_hold(5)
        assert confirmed is not None
        assert (confirmed.decision, confirmed.who) == (Decision.CONFIRMED, "engineer")
        assert confirmed.time == confirmed.decided_at == NOW + timedelta(days=9)
        (waits,) = store.recordings.list_holds()
        assert [(test.name, test.tension_shift) for test in waits.tests] == [("t6", -0.1)]
        assert [doubt.check for doubt in waits.doubts] == ["copy"]
        known = store.tests.known_samples(7, 5, Fingerprint("0" * 64, np.ones((1, 256))))
        assert [each.fingerprint.shapes.shape for each in known] == [(1, 256)] * 2
        assert store.recordings.get(5).file.modified_at == NOW


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


def test_an_upgrade_from_an_unknown_schema_says_so(tmp_path: Path) -> None:
    path = tmp_path / "shm.db"
    Store.create(path).close()
    _set_version(path, "0000")
    with pytest.raises(StoreError, match="cannot be upgraded"):
        Store.upgrade(path)


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


def test_a_url_without_driver_is_refused_without_its_password() -> None:
    with pytest.raises(StoreError, match="no driver") as caught:
        make_engine("elsewhere://user:secret@host/shm")
    assert "secret" not in str(caught.value)


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
