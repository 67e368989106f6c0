"""Where steps run: each process dies for itself, and nothing is left at work."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path

import pytest

from shm.errors import BadInput, ShmError, WorkerDied
from shm.resources import memory_of_machine
from shm_daemon import execution
from shm_daemon.execution import Workers, children_ended, process_pool
from tests.helpers.slow import few_of


@pytest.fixture
def workers() -> Iterator[Workers]:
    with children_ended():
        found = Workers(2)
        yield found
        found.shutdown(wait=False, cancel_futures=True)


def died(future: Future[object]) -> WorkerDied:
    with pytest.raises(WorkerDied) as death:
        future.result(60)
    return death.value


def test_a_crash_is_told_and_work_left_undone_is_ended_with_the_context() -> None:
    with children_ended():
        pool = Workers(1)
        worker = pool.submit(os.getpid).result(60)
        assert worker != os.getpid()
        assert pool.submit(os.getenv, "OMP_NUM_THREADS").result(60) is not None
        endless = pool.submit(time.sleep, 600)
        pool.shutdown(wait=False)
    with pytest.raises(WorkerDied):
        endless.result(60)
    with children_ended():
        crashing = process_pool(1)
        with pytest.raises(BrokenProcessPool):
            crashing.submit(os._exit, 1).result(60)


@pytest.mark.parametrize(
    ("step", "how"),
    few_of(
        [
            (partial(ctypes.string_at, 8), "SIGSEGV"),
            (os.abort, "SIGABRT"),
            (partial(os._exit, 3), "exit code 3"),
            (partial(signal.raise_signal, signal.SIGTERM), "SIGTERM"),
            (partial(signal.raise_signal, signal.SIGKILL), "SIGKILL"),
        ],
        2,
    ),
)
def test_a_death_says_how_and_takes_no_neighbour_along(
    workers: Workers, step: partial[object], how: str
) -> None:
    neighbour = workers.submit(time.sleep, 1.0)
    death = died(workers.submit(step))
    assert death.how == how
    assert how in death.message
    assert neighbour.result(60) is None
    assert workers.submit(os.getpid).result(60)


def test_no_process_is_begun_once_all_end_for_nobody_would_end_it(tmp_path: Path) -> None:
    at_work = tmp_path / "at work"
    with children_ended():
        pool = Workers(1)
        first = pool.submit(_say_and_sleep, at_work)
        waiting = pool.submit(os.getpid)
        while not at_work.exists():
            time.sleep(0.01)
        pool.shutdown(wait=False)
        assert first.result(60) is None
        assert "not begun" in died(waiting).message


def _say_and_sleep(at_work: Path) -> None:
    at_work.touch()
    time.sleep(0.5)


def _refuse() -> None:
    raise BadInput("cannot be used.", file="a.csv", line=3, remedy="Mend it.")


def test_an_error_comes_back_with_all_that_it_says_and_where_it_was_raised(
    workers: Workers,
) -> None:
    with pytest.raises(BadInput) as refusal:
        workers.submit(_refuse).result(60)
    assert (refusal.value.line, refusal.value.remedy) == (3, "Mend it.")
    assert "in _refuse" in str(refusal.value.__cause__)
    with pytest.raises(TypeError, match="cannot pickle"):
        workers.submit(threading.Lock).result(60)
    with pytest.raises(ValueError, match="exit"):  # not the end of the worker
        workers.submit(_exit).result(60)


def _exit() -> None:
    raise ValueError("exit")


def test_where_no_process_can_be_begun_no_file_is_to_blame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(*args: object) -> None:
        raise OSError(11, "Resource temporarily unavailable")

    with children_ended():
        with monkeypatch.context() as patched:
            patched.setattr("multiprocessing.context.ForkServerProcess.start", full)
            workers = Workers(1)
            with pytest.raises(ShmError, match="no process can be begun") as refusal:
                workers.submit(os.getpid).result(60)
        assert refusal.value.retry_after_s
        assert workers.submit(os.getpid).result(60)
        workers.shutdown(wait=False)


def _grow() -> int:
    held, most = [], memory_of_machine()
    while len(held) << 26 < most:
        held.append(bytearray(1 << 26))
    return len(held)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux bounds the memory of a process")
def test_a_step_that_grows_without_end_gets_an_error_before_the_machine_is_full(
    workers: Workers, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert memory_of_machine() > 1 << 28
    small = Workers(1, prepare=_less_memory)
    with pytest.raises(MemoryError):
        small.submit(_grow).result(120)
    assert small.submit(os.getpid).result(60)
    small.shutdown(wait=False)


def _less_memory() -> None:
    execution._MOST_OF_MEMORY *= 1e9 / memory_of_machine()
    execution._bound_memory()
