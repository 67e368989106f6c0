"""Workers that are killed again and again, at random moments, while healthy files come in."""

from __future__ import annotations

import os
import random
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

from shm.pipeline import steps
from shm.settings import Settings
from shm.store import Stage, Workspace
from shm_daemon import Bell, run
from shm_daemon.execution import Workers
from tests.helpers import quick_update
from tests.helpers.workspaces import write_test

_SLOW_S = 0.15


def prepare_worker() -> None:
    """The stand-in for the sampler, and reading that takes long enough to be killed in it."""
    for verb in ("update", "refresh", "select"):
        setattr(steps, verb, getattr(quick_update, verb))
    load = steps.load_modes

    def slow_load(*arguments: object) -> object:
        time.sleep(_SLOW_S)
        return load(*arguments)  # type: ignore[arg-type]

    steps.load_modes = slow_load  # type: ignore[assignment]


def children() -> list[int]:
    """The processes that work for us: workers and what reads for them, not what forks them."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            words = (
                (folder / "stat").read_text().rpartition(")")[2].split()
                if folder.name.isdigit()
                else []
            )
            command = (folder / "cmdline").read_bytes() if words else b""
        except OSError:
            continue
        if words and words[0] != "Z" and b"multiprocessing" in command or b"serving" in command:
            found.append((int(folder.name), int(words[1])))
    ours = {os.getpid()}
    helpers = {pid for pid, parent in found if parent == os.getpid()}  # forkserver, tracker
    workers = {pid for pid, parent in found if parent in helpers}
    readers = {pid for pid, parent in found if parent in workers}
    return sorted((workers | readers) - ours)


def kill_workers(
    workspace: Workspace, files: int, kills: int, rng: random.Random, pause_s: float, most_s: float
) -> tuple[int, float]:
    """Drops files while a daemon works and its workers are killed; kills that struck, seconds."""
    for number in range(files):
        write_test(workspace.spool / f"t{number:03}.modes.json", workspace, day=number / 10)
    bell, began, struck = Bell(), time.monotonic(), 0

    def make(settings: Settings) -> Workers:
        return Workers(settings.workers, prepare_worker)

    daemon = threading.Thread(
        target=run, args=(workspace,), kwargs={"bell": bell, "make_executor": make}
    )
    daemon.start()
    try:
        while not _all_through(workspace, files):
            if time.monotonic() - began > most_s:
                raise TimeoutError(f"after {most_s} s: {_counts(workspace)}, {struck} kills")
            time.sleep(rng.uniform(0.0, 2 * pause_s))
            for pid in rng.sample(living, 1) if (living := children()) and struck < kills else ():
                struck += _killed(pid)
    finally:
        bell.stop()
        daemon.join()
    return struck, time.monotonic() - began


def _killed(pid: int) -> bool:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True


def _counts(workspace: Workspace) -> dict[Stage, int]:
    with workspace.store() as store:
        return store.stage_counts()


def _all_through(workspace: Workspace, files: int) -> bool:
    counts = _counts(workspace)
    return counts[Stage.DONE] + counts[Stage.REFUSED] == files


Kill = Callable[[Workspace], tuple[int, float]]
