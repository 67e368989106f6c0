"""The disk of a PostgreSQL server fills at a write or a commit: it answers SQLSTATE 53100.

Triggers raise it, as the server does where its data files cannot grow. Where its log cannot, it
ends itself: that is a crash, see `tests/faults/test_server_crashes.py`.
"""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest

from shm.store import Workspace
from shm.store.backups import check_archive, check_store
from shm.store.tables import metadata
from shm_daemon import Wakeup, loop
from tests.helpers.contents import quiet
from tests.helpers.feeds import Feed, assert_all_done_once
from tests.helpers.flows import Postman, threads
from tests.helpers.postgres import Databases

_FASTER = 600.0
"""A minute of the daemon's waiting passes in a tenth of a second."""

_COUNTED = """
    CREATE SEQUENCE IF NOT EXISTS disk_asked;
    CREATE TABLE IF NOT EXISTS disk_full (first bigint, last bigint);
    CREATE OR REPLACE FUNCTION ask_for_room() RETURNS trigger LANGUAGE plpgsql AS $$
    DECLARE asked bigint := nextval('disk_asked');
    BEGIN
        IF EXISTS (SELECT 1 FROM disk_full WHERE asked >= first AND asked < last) THEN
            RAISE EXCEPTION 'could not extend file: No space left on device'
                USING ERRCODE = 'disk_full';
        END IF;
        RETURN NULL;
    END $$;
"""
_AT_A_WRITE = (
    "CREATE OR REPLACE TRIGGER room_to_write BEFORE INSERT OR UPDATE OR DELETE ON {table} "
    "FOR EACH STATEMENT EXECUTE FUNCTION ask_for_room()"
)
_AT_THE_COMMIT = (
    "CREATE CONSTRAINT TRIGGER room_to_commit AFTER INSERT ON {table} "
    "DEFERRABLE INITIALLY DEFERRED FOR EACH ROW EXECUTE FUNCTION ask_for_room()"
)


def count_writes(databases: Databases, url: str) -> None:
    """From now on each write and commit of a store is counted, and can be refused."""
    databases.run(_COUNTED, url)
    for table in metadata.sorted_tables:
        for trigger in (_AT_A_WRITE, _AT_THE_COMMIT):
            databases.run(trigger.format(table=f'"{table.name}"'), url)


def forget_writes(databases: Databases, url: str) -> None:
    """The store is as it was made."""
    databases.run("DROP FUNCTION ask_for_room CASCADE", url)
    databases.run("DROP SEQUENCE disk_asked; DROP TABLE disk_full", url)


def fill_from(databases: Databases, url: str, first: int, last: int) -> None:
    """The disk is full from this write, counted from now on, to before that one."""
    databases.run("DELETE FROM disk_full", url)
    databases.run(f"INSERT INTO disk_full VALUES ({first}, {last})", url)
    databases.run("ALTER SEQUENCE disk_asked RESTART", url)


def writes(databases: Databases, url: str) -> int:
    """How many have been asked for since it was filled."""
    ((last, is_called),) = databases.run("SELECT last_value, is_called FROM disk_asked", url)
    return int(last) if is_called else 0


def ingest_meanwhile(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    """A daemon until all is done; what it waits passes quickly."""
    began, wakeup = time.monotonic(), Wakeup()
    quick = SimpleNamespace(monotonic=lambda: began + _FASTER * (time.monotonic() - began))
    wait: Any = wakeup.wait
    with monkeypatch.context() as patched:
        patched.setattr(loop, "time", quick)
        patched.setattr(wakeup, "wait", lambda seconds: wait(min(seconds / _FASTER, 0.05)))
        loop.run(workspace, wakeup=wakeup, once=True, make_executor=threads, notifier=Postman())


def assert_whole(feed: Feed) -> None:
    """All is done once, nothing lost, nothing half written."""
    workspace = feed.workspace
    with workspace.store() as store:
        assert check_store(store, quiet).troubles == ()
        assert check_archive(store, workspace.archive, quiet).troubles == ()
    assert_all_done_once(feed)
