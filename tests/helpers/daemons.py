"""Real daemons in processes of their own, to be killed."""

from __future__ import annotations

import logging
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path

import shm_daemon
from shm.pipeline import steps
from shm.store import Workspace
from tests.helpers import quick_update


def serve_quickly(folder: Path, once: bool) -> None:
    """The daemon with the stand-in for the sampler and its steps in a thread."""
    logging.basicConfig(filename=folder / "daemon.log", level=logging.INFO)
    steps.update, steps.select = quick_update.update, quick_update.select  # type: ignore[assignment]
    shm_daemon.run(Workspace.open(folder), once=once, make_executor=ThreadPoolExecutor)


def quick_daemon(folder: Path, once: bool = False) -> ForkServerProcess:
    """Begins one within milliseconds: it is forked off a process that has everything imported."""
    context = multiprocessing.get_context("forkserver")
    assert isinstance(context, ForkServerContext)
    context.set_forkserver_preload(["__main__", __name__])
    process = context.Process(target=serve_quickly, args=(folder, once))
    process.start()
    return process


@contextmanager
def real_daemon(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """`python -m shm_daemon`, as an owner begins it, logging to `daemon.log`; ended at the end."""
    command = [sys.executable, "-m", "shm_daemon", str(folder)]
    with (folder / "daemon.log").open("ab") as log, subprocess.Popen(command, stderr=log) as daemon:
        try:
            yield daemon
        finally:
            daemon.kill()


def until_serving(pid: int | None, folder: Path, seconds: float = 30.0) -> None:
    """Waits until a daemon begun a moment ago holds the workspace."""
    lock, end = folder / "shm.lock", time.monotonic() + seconds
    while not lock.exists() or lock.read_text() != str(pid):
        if time.monotonic() > end:
            raise TimeoutError(f"process {pid} does not serve {folder}")
        time.sleep(0.005)
