"""The wakeup: rung by signals, by changes, by threads; one listener."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from watchdog.observers import Observer

from shm_daemon.wakeup import SPOOL, Wakeup, rung_by_changes, stopped_by_signals


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_stop_the_listener_and_only_within_the_context(number: int) -> None:
    wakeup, before = Wakeup(), signal.getsignal(number)
    with stopped_by_signals(wakeup):
        os.kill(os.getpid(), number)
        wakeup.wait(10)
    assert wakeup.stopped
    assert signal.getsignal(number) is before


def test_a_change_in_the_folder_rings(tmp_path: Path) -> None:
    wakeup = Wakeup()
    (tmp_path / "sub").mkdir()
    with rung_by_changes(wakeup, tmp_path):
        (tmp_path / "sub" / "h3.csv").write_text("x")
        assert wakeup.wait(10) == {SPOOL}


def test_looking_does_not_ring(tmp_path: Path) -> None:
    """Else the daemon would wake itself for ever."""
    wakeup = Wakeup()
    (tmp_path / "h3.csv").write_text("x")
    with rung_by_changes(wakeup, tmp_path):
        list(tmp_path.iterdir())
        (tmp_path / "h3.csv").read_text()
        assert wakeup.wait(0.3) == set()


def test_without_hints_the_daemon_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(self: object) -> None:
        raise OSError("inotify watch limit reached")

    monkeypatch.setattr(Observer, "start", refuse)
    went_on = False
    with rung_by_changes(Wakeup(), tmp_path):
        went_on = True
    assert went_on
    assert "inotify watch limit" in caplog.text
