"""What takes seconds is made beside the requests: one at a time, kept, and never begun twice."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

from shm.errors import BadInput, ShmError
from shm_daemon.web.background_work import BackgroundWorker
from tests.helpers.web_servers import a_thread

_MADE: list[str] = []
_LET_GO = threading.Event()


@dataclass(frozen=True)
class Text:
    said: str
    padding: bytes = b""


@dataclass(frozen=True)
class Order:
    """Says a word, in the way that `how` names."""

    word: str
    how: str = "at once"
    size_bytes: int = 0

    def make(self) -> Text:
        _MADE.append(self.word)
        if self.how == "refused":
            raise BadInput(f"{self.word} is no word.", remedy="Say another.")
        if self.how == "bug":
            raise ZeroDivisionError
        if self.how == "slow":
            _LET_GO.wait(600)
        if self.how == "dies":
            os._exit(3)
        if self.how == "dies once" and not Path(self.word).exists():
            Path(self.word).touch()
            os._exit(3)
        return Text(self.word, bytes(self.size_bytes))


def a_process(workers: int) -> ProcessPoolExecutor:
    """Without the imports of the daemon's, which take seconds."""
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("fork"))


@pytest.fixture
def background_worker() -> Iterator[BackgroundWorker[Text]]:
    _MADE.clear()
    _LET_GO.clear()
    background_worker: BackgroundWorker[Text] = BackgroundWorker(longest_s=120.0, pool=a_thread)
    yield background_worker
    _LET_GO.set()
    background_worker.close()


def until(found: Callable[[], Text | None]) -> Text:
    for _ in range(24_000):
        if (text := found()) is not None:
            return text
        time.sleep(0.005)
    raise AssertionError("nothing came")


def test_failure_stops_nothing_else(background_worker: BackgroundWorker[Text]) -> None:
    for how, told in (("refused", "is no word"), ("bug", "internal error")):
        order = Order("none", how)
        with pytest.raises(ShmError, match=told):
            until(lambda order=order: background_worker.get_or_start(order))  # type: ignore[misc]
        with pytest.raises(ShmError, match=told):
            background_worker.get_or_start(order)
    assert _MADE == ["none", "none"]
    assert until(lambda: background_worker.get_or_start(Order("some"))) == Text("some")


def test_what_takes_too_long_is_given_up() -> None:
    background_worker: BackgroundWorker[Text] = BackgroundWorker(longest_s=2.0, pool=a_thread)
    _LET_GO.clear()
    try:
        with pytest.raises(ShmError, match="more than 2 s"):
            until(lambda: background_worker.get_or_start(Order("slow one", "slow")))
        # It hangs on, and nobody waits for it.
        assert until(lambda: background_worker.get_or_start(Order("quick one"))) == Text(
            "quick one"
        )
    finally:
        _LET_GO.set()
        background_worker.close()


def test_a_process_that_dies_is_told_and_replaced() -> None:
    background_worker: BackgroundWorker[Text] = BackgroundWorker(longest_s=120.0, pool=a_process)
    try:
        with pytest.raises(ShmError, match="died"):
            until(lambda: background_worker.get_or_start(Order("last words", "dies")))
        assert until(lambda: background_worker.get_or_start(Order("next"))) == Text("next")
    finally:
        background_worker.close()


def test_closing_ends_the_work_at_once() -> None:
    background_worker: BackgroundWorker[Text] = BackgroundWorker(longest_s=60.0, pool=a_process)
    _LET_GO.clear()
    assert background_worker.get_or_start(Order("endless", "slow")) is None
    time.sleep(0.2)
    closing = threading.Thread(target=background_worker.close)
    closing.start()
    closing.join(120)
    assert not closing.is_alive()  # the order would take ten minutes
    assert background_worker.get_or_start(Order("endless", "slow")) is None
    assert background_worker.get_or_start(Order("another")) is None
    until(lambda: None if multiprocessing.active_children() else Text("all gone"))
