"""The pool of processes: a crash is told, and nothing is left at work."""

from __future__ import annotations

import os
import time
from concurrent.futures.process import BrokenProcessPool

import pytest

from shm_daemon.execution import children_ended, process_pool


def test_a_crash_is_told_and_work_left_undone_is_ended_with_the_context() -> None:
    with children_ended():
        crashing = process_pool(1)
        with pytest.raises(BrokenProcessPool):
            crashing.submit(os._exit, 1).result(60)
        pool = process_pool(1)
        worker = pool.submit(os.getpid).result(60)
        assert worker != os.getpid()
        assert pool.submit(os.getenv, "OMP_NUM_THREADS").result(60) is not None
        endless = pool.submit(time.sleep, 600)
        pool.shutdown(wait=False)
    with pytest.raises(BrokenProcessPool):
        endless.result(20)
