"""One process a store is active: the others are told, or wait until it ends, however it ends."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from shm.errors import StoreBusy, StoreError
from shm.store.active import active, holder
from shm.store.database import is_server
from tests.helpers.postgres import Databases


def patient(limit_s: float = 120.0, pause_s: float = 0.02) -> Callable[[StoreError], bool]:
    """Waits a little at each try, as long as a test may take."""
    end = time.monotonic() + limit_s

    def wait(error: StoreError) -> bool:
        assert error.retry_after_s is not None
        time.sleep(pause_s)
        return time.monotonic() < end

    return wait


def test_only_one_is_active_and_the_other_is_told_who(location: str | Path, tmp_path: Path) -> None:
    file = tmp_path / "shm.lock"
    with active(location, file, None) as lock:
        assert lock.held()
        with (
            pytest.raises(StoreBusy, match=f"process {os.getpid()}") as caught,
            active(location, file, None),
        ):
            pytest.fail("two were active")
        assert caught.value.retry_after_s == 1.0
        assert lock.held()  # the try has not cost it
    with active(location, file, None):
        assert not lock.held()


def test_a_standby_takes_over_when_the_active_one_ends(
    location: str | Path, tmp_path: Path
) -> None:
    file, waiting, over = tmp_path / "shm.lock", threading.Event(), threading.Event()

    def wait(error: StoreError) -> bool:
        waiting.set()
        return patient()(error)

    def stand_by() -> None:
        with active(location, file, wait) as lock:
            assert lock.held()
            over.set()

    standby = threading.Thread(target=stand_by)
    with active(location, file, None):
        standby.start()
        assert waiting.wait(10)
        assert not over.is_set()
    assert over.wait(10)
    standby.join()


def _be_active(location: str | Path, file: Path, ready: multiprocessing.synchronize.Event) -> None:
    with active(location, file, None):
        ready.set()
        multiprocessing.Event().wait()


def test_a_standby_takes_over_within_seconds_of_a_kill(
    location: str | Path, tmp_path: Path
) -> None:
    file, context = tmp_path / "shm.lock", multiprocessing.get_context("spawn")
    ready = context.Event()
    process = context.Process(target=_be_active, args=(location, file, ready))
    process.start()
    assert ready.wait(60)
    with pytest.raises(StoreBusy, match=f"process {process.pid}"), active(location, file, None):
        pytest.fail("two were active")
    process.kill()
    with active(location, file, patient()):
        process.join()


def _look(location: str | Path, file: Path, ready: multiprocessing.synchronize.Event) -> None:
    while True:
        holder(location, file)
        ready.set()


def test_holder_hinders_nobody(location: str | Path, tmp_path: Path) -> None:
    """Looking who is active is never in the way of one who becomes it."""
    file, context = tmp_path / "shm.lock", multiprocessing.get_context("spawn")
    ready = context.Event()
    with active(location, file, None):
        pass
    process = context.Process(target=_look, args=(location, file, ready))
    process.start()
    try:
        assert ready.wait(60)
        for _ in range(20 if is_server(location) else 2000):
            with active(location, file, None):
                assert str(os.getpid()) in str(holder(location, file))
        assert process.is_alive()
    finally:
        process.kill()
        process.join()


def test_holder_names_process(location: str | Path, tmp_path: Path) -> None:
    file, context = tmp_path / "shm.lock", multiprocessing.get_context("spawn")
    ready = context.Event()
    assert holder(location, file) is None
    process = context.Process(target=_be_active, args=(location, file, ready))
    process.start()
    assert ready.wait(60)
    if file.exists():
        file.chmod(0o444)
    assert f"process {process.pid}" in str(holder(location, file))
    process.kill()
    process.join()
    end = time.monotonic() + 20
    while holder(location, file) is not None:
        assert time.monotonic() < end, "it is dead and still named"
        time.sleep(0.02)


def test_who_loses_the_connection_is_no_longer_active(
    server: str, postgresql: Databases, tmp_path: Path
) -> None:
    file = tmp_path / "shm.lock"
    with active(server, file, None) as lock:
        assert postgresql.cut_connections(server) == 1
        assert not lock.held()
        with active(server, file, None) as other:
            assert other.held()
            assert not lock.held()


def test_a_server_that_is_down_is_waited_for(tmp_path: Path) -> None:
    told: list[StoreError] = []

    def once(error: StoreError) -> bool:
        told.append(error)
        return len(told) < 2

    nowhere = f"postgresql://shm@/shm?host={tmp_path}"
    with (
        pytest.raises(StoreError, match="cannot be reached"),
        active(nowhere, tmp_path / "shm.lock", once),
    ):
        pytest.fail("nobody can be active")
    assert [error.retry_after_s for error in told] == [5.0, 5.0]
    assert not any(isinstance(error, StoreBusy) for error in told)
