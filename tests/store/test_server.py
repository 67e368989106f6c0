"""A store in PostgreSQL: what its errors turn into, and that its password is never told."""

from __future__ import annotations

import re
import sys
import threading
from pathlib import Path

import pytest
import sqlalchemy as sa

from shm.errors import BadInput, StoreBusy, StoreError
from shm.store import Outcome, Store, database
from shm.store.database import make_engine, shown, url_of
from shm.store.recordings import list_recordings
from tests.helpers.nouns import NOW, a_file
from tests.helpers.postgres import Databases
from tests.helpers.workspaces import make_workspace


def test_the_same_file_received_by_many_at_once_is_entered_once(store: Store) -> None:
    outcomes: list[Outcome] = []

    def receive(number: int) -> None:
        receipt = store.recordings.receive(a_file(1, arrival=f"entry-{number}"), NOW)
        outcomes.append(receipt.outcome)

    threads = [threading.Thread(target=receive, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(outcomes) == sorted([Outcome.NEW] + 7 * [Outcome.DUPLICATE])


def test_a_writer_that_holds_on_keeps_others_waiting_and_then_busy(
    server_store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database, "BUSY_SECONDS", 0.05)
    with server_store.writing():
        with pytest.raises(StoreBusy) as caught:
            server_store.recordings.receive(a_file(1), NOW)
        assert caught.value.retry_after_s == 1.0
        assert list_recordings(server_store) == ()  # reading goes on meanwhile
    server_store.recordings.receive(a_file(1), NOW)


def test_a_connection_lost_between_verbs_is_not_even_noticed(
    server: str, server_store: Store, postgresql: Databases
) -> None:
    server_store.recordings.receive(a_file(1), NOW)
    assert postgresql.cut_connections(server) >= 1
    server_store.recordings.receive(a_file(2), NOW)
    assert len(list_recordings(server_store)) == 2


def test_a_connection_lost_within_a_verb_undoes_it_and_says_when_to_return(
    server: str, server_store: Store, postgresql: Databases
) -> None:
    def lose_it() -> None:
        with server_store.writing() as connection:
            connection.execute(sa.text("DELETE FROM journal"))
            postgresql.cut_connections(server)
            connection.execute(sa.text("DELETE FROM journal"))

    with pytest.raises(StoreError) as caught:
        lose_it()
    assert caught.value.retry_after_s == 5.0
    assert server_store.recordings.receive(a_file(1), NOW).outcome is Outcome.NEW


def test_a_server_that_is_down_is_waited_for_and_its_password_not_told() -> None:
    with pytest.raises(StoreError, match="cannot be reached") as caught:
        Store.open("postgresql://shm:hush-hush@127.0.0.1:1/shm")
    assert caught.value.retry_after_s == 5.0
    assert "postgresql://shm:***@127.0.0.1:1/shm" in str(caught.value)
    assert "hush" not in str(caught.value)


@pytest.mark.parametrize(
    "location",
    [
        "postgresql://shm:hush@hush@db.example.org/arch",
        "postgresql://shm:hush@ed:hush@db.example.org/arch",
        "postgresql://shm:hush@db.example.org:hush/arch",
        "postgresql://shm:hush@db.example.org",
        "mysql://shm:hush@db.example.org/arch",
        "://hush",
    ],
)
def test_a_url_that_cannot_be_used_is_refused_without_telling_it(location: str) -> None:
    with pytest.raises(StoreError) as caught:
        make_engine(location)
    assert "hush" not in str(caught.value)
    assert caught.value.retry_after_s is None


def test_an_address_is_shown_without_password_wherever_that_stands() -> None:
    for location in (
        "postgresql://shm:hush@db.example.org/arch",
        "postgresql://shm@db.example.org/arch?password=hush",
        "postgres://shm:hu%40sh@db.example.org/arch?sslmode=require",
    ):
        told = shown(url_of(location))
        assert "hu" not in told
        assert told.endswith("@db.example.org/arch")


def test_a_password_in_the_description_is_refused(tmp_path: Path) -> None:
    for url in ("postgresql://shm:hush@h/arch", "postgresql://shm@h/arch?password=hush"):
        with pytest.raises(BadInput, match="SHM_STORE") as caught:
            make_workspace(tmp_path / "bridge", settings={"store": url})
        assert "hush" not in str(caught.value)
        assert not (tmp_path / "bridge").exists()


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(StoreError, match=re.escape("pip install shm[postgres]")):
        make_engine("postgresql://shm@db.example.org/arch")
