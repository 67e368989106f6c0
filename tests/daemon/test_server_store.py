"""The daemon with its store in PostgreSQL: what it does while the server is away."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from shm.store import Stage, Store, Workspace
from shm.store.recordings import count_stages
from shm_daemon import Wakeup, run
from tests.helpers import quick_update
from tests.helpers.flows import threads
from tests.helpers.postgres import Databases
from tests.helpers.waiting import until
from tests.helpers.workspaces import make_workspace, write_test


@pytest.fixture
def url(postgresql: Databases) -> Iterator[str]:
    with postgresql.store() as url:
        yield url


@pytest.fixture
def served(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> Iterator[Workspace]:
    """Yield a workspace on the server, and a daemon that serves it from a thread."""
    caplog.set_level(logging.INFO)
    quick_update.stand_in(monkeypatch.setattr)
    monkeypatch.setenv("SHM_STORE", url.replace("postgres@", "postgres:hush@"))
    workspace, wakeup = make_workspace(tmp_path / "bridge"), Wakeup()
    options = {"wakeup": wakeup, "make_executor": threads}
    daemon = threading.Thread(target=run, args=(workspace,), kwargs=options)
    daemon.start()
    yield workspace
    assert daemon.is_alive()
    wakeup.stop()
    daemon.join(120)
    assert not daemon.is_alive()
    assert "hush" not in caplog.text


def done(url: str) -> int:
    with Store.open(url) as store:
        return count_stages(store)[Stage.DONE]


def test_the_daemon_waits_while_its_server_is_away_and_goes_on(
    served: Workspace, url: str, postgresql: Databases, caplog: pytest.LogCaptureFixture
) -> None:
    write_test(served.spool / "t0.modes.json", served)
    until(lambda: done(url) == 1)
    with postgresql.outage(url):
        write_test(served.spool / "t1.modes.json", served, day=1)
        until(lambda: "cannot be reached" in caplog.text)
        assert (served.spool / "t1.modes.json").exists()
    until(lambda: done(url) == 2)
    until(lambda: not (served.spool / "t1.modes.json").exists())


@pytest.mark.slow
def test_a_cut_of_its_connections_costs_the_daemon_nothing(
    served: Workspace, url: str, postgresql: Databases
) -> None:
    for number in range(4):
        write_test(served.spool / f"t{number}.modes.json", served, day=number)
        postgresql.cut_connections(url)
    until(lambda: done(url) == 4)
    with Store.open(url) as store:
        assert [test.test.id for test in store.tests.list_all(3)] == ["t0", "t1", "t2", "t3"]
