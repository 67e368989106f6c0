"""A Dask scheduler and its workers, in processes of their own, to be killed."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.helpers.daemons import ROOT

PATHS = os.pathsep.join(str(ROOT / each) for each in ("", "daemon", "cli"))


@dataclass
class Cluster:
    """The address of the scheduler, and its workers."""

    address: str
    workers: list[subprocess.Popen[bytes]]


@contextmanager
def a_cluster(folder: Path, workers: int = 2, **environment: str) -> Iterator[Cluster]:
    """A scheduler at a free port and its workers, one thread each; all ended at the end."""
    told = folder / "scheduler.json"
    with ExitStack() as stack:
        words = ("scheduler", "--host", "127.0.0.1", "--port", "0")
        _begin(stack, folder, *words, told=told, **environment)
        until = time.monotonic() + 60
        while not told.exists() or not told.read_text().strip().endswith("}"):
            assert time.monotonic() < until, (folder / "dask.log").read_text()
            time.sleep(0.05)
        words = ("worker", "--nthreads", "1", "--no-nanny")
        begun = [_begin(stack, folder, *words, told=told, **environment) for _ in range(workers)]
        yield Cluster(_address(told), begun)


def _begin(
    stack: ExitStack, folder: Path, *words: str, told: Path, **environment: str
) -> subprocess.Popen[bytes]:
    log = stack.enter_context((folder / "dask.log").open("ab"))
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *words, "--scheduler-file", str(told), "--no-dashboard"],
        stderr=log,
        stdout=log,
        cwd=folder,
        env={**os.environ, **threads, "PYTHONPATH": PATHS, **environment},
    )
    stack.callback(process.wait)
    stack.callback(process.kill)
    return process


def _address(told: Path) -> str:
    import json

    address: str = json.loads(told.read_text())["address"]
    return address
