"""Two daemons on one store and a cluster, of which some die while they work."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from shm.store import Stage, Workspace
from shm.store.recordings import count_stages
from tests.helpers.clusters import a_cluster
from tests.helpers.daemons import real_daemon
from tests.helpers.feeds import Feed
from tests.helpers.workspaces import make_workspace


@dataclass(frozen=True)
class Takeover:
    """What was taken in, and how long the standby took to serve after the active one died."""

    feed: Feed
    takeover_s: float


def kill_a_worker_then_the_active_daemon(folder: Path, store: str, files: int) -> Takeover:
    """Two daemons and two workers; a worker dies after a third of the files, then the daemon."""
    with a_cluster(folder) as cluster:
        settings = {"store": store, "scheduler": cluster.address, "workers": 2}
        workspace = make_workspace(folder / "bridge", settings=settings)
        feed = Feed(workspace)
        for _ in range(files):
            feed.drop()
        home = workspace.folder
        with real_daemon(home, standby=True, log_name="first.log") as first:
            until(lambda: "watching" in log(home, "first.log"))
            with real_daemon(home, standby=True, log_name="second.log"):
                until(lambda: "standing by" in log(home, "second.log"))
                until(lambda: done(workspace) >= files // 4)
                cluster.workers[0].kill()
                until(lambda: done(workspace) >= files // 2)
                first.kill()
                died = time.monotonic()
                until(lambda: "watching" in log(home, "second.log"))
                took_s = time.monotonic() - died
                until(lambda: ended(workspace) == files, 600)
    return Takeover(feed, took_s)


def done(workspace: Workspace) -> int:
    with workspace.store() as store:
        return count_stages(store)[Stage.DONE]


def ended(workspace: Workspace) -> int:
    with workspace.store() as store:
        counts = count_stages(store)
    return counts[Stage.DONE] + counts[Stage.REFUSED]


def log(folder: Path, name: str) -> str:
    return (folder / name).read_text()


def until(condition: Callable[[], bool], seconds: float = 240.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)
