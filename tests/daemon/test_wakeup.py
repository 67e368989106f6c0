"""The wakeup: rung by signals and by threads; one listener."""

from __future__ import annotations

import os
import signal

import pytest

from shm_daemon.wakeup import Wakeup, stopped_by_signals


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_stop_the_listener_and_only_within_the_context(number: int) -> None:
    wakeup, before = Wakeup(), signal.getsignal(number)
    with stopped_by_signals(wakeup):
        os.kill(os.getpid(), number)
        wakeup.wait(10)
    assert wakeup.stopped
    assert signal.getsignal(number) is before
