"""Workers that are killed again and again, in the midst of a step, while healthy files come in."""

from __future__ import annotations

import os
import random
import signal
import threading
import time
from functools import partial
from pathlib import Path

from shm.pipeline import steps
from shm.settings import Settings
from shm.store import Stage, Workspace
from shm.store.recordings import count_stages
from shm_daemon import Wakeup, run
from shm_daemon.execution import Workers
from tests.helpers import quick_update
from tests.helpers.workspaces import write_test

_SLOW_S = 0.1


def prepare_worker(busy: Path) -> None:
    """The stand-in for the sampler; every step says in a folder that it is at work, and is slow."""
    for verb in ("update", "refresh", "select"):
        setattr(steps, verb, partial(_at_work, busy, getattr(quick_update, verb)))
    for verb in ("load_modes", "watch_newest"):
        setattr(steps, verb, partial(_at_work, busy, getattr(steps, verb)))


def _at_work(busy: Path, verb: object, *arguments: object) -> object:
    mark = busy / str(os.getpid())
    mark.touch()
    time.sleep(_SLOW_S)
    found = verb(*arguments)  # type: ignore[operator]
    mark.unlink(missing_ok=True)
    return found


def kill_workers(
    workspace: Workspace, files: int, kills: int, rng: random.Random, most_s: float
) -> int:
    """Lets a daemon do so many healthy files and kills its workers at work; the kills that struck.

    Raises TimeoutError where the files are not through in time.
    """
    for number in range(files):
        write_test(workspace.spool / f"t{number:04}.modes.json", workspace, day=number / 10)
    busy = workspace.folder / "busy"
    busy.mkdir()
    wakeup, end, struck = Wakeup(), time.monotonic() + most_s, 0

    def make(settings: Settings) -> Workers:
        return Workers(settings.workers, partial(prepare_worker, busy))

    daemon = threading.Thread(
        target=run, args=(workspace,), kwargs={"wakeup": wakeup, "make_executor": make}
    )
    daemon.start()
    try:
        while not _all_through(workspace, files):
            if time.monotonic() > end:
                raise TimeoutError(f"{struck} kills, and then: {stage_counts(workspace)}")
            wait_until = time.monotonic() + 1.0
            while struck < kills and time.monotonic() < wait_until:
                struck += _kill_one(busy, rng)
            time.sleep(0.0 if struck < kills else 0.5)
    finally:
        wakeup.stop()
        daemon.join()
    return struck


def _kill_one(busy: Path, rng: random.Random) -> bool:
    """Kills one that is at work, after a moment; whether it was still there."""
    marks = sorted(busy.iterdir())
    time.sleep(rng.uniform(0.0, _SLOW_S))
    if not marks:
        return False
    mark = rng.choice(marks)
    mark.unlink(missing_ok=True)
    try:
        os.kill(int(mark.name), signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True


def stage_counts(workspace: Workspace) -> dict[Stage, int]:
    with workspace.store() as store:
        return {stage: count for stage, count in count_stages(store).items() if count}


def _all_through(workspace: Workspace, files: int) -> bool:
    counts = stage_counts(workspace)
    return counts.get(Stage.DONE, 0) + counts.get(Stage.REFUSED, 0) == files
