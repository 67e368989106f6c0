"""A PostgreSQL server that forces to disk what it commits crashes in the middle of the work."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest

from shm.store import Stage, Workspace
from shm.store.backups import check_archive, check_store
from shm.store.recordings import count_stages
from tests.helpers.contents import quiet
from tests.helpers.daemons import quick_daemons, until_serving
from tests.helpers.feeds import Feed, assert_all_done_once
from tests.helpers.postgres import crashing_server
from tests.helpers.workspaces import make_workspace

CRASHES, FILES, SEED = 3, 8, 20260501


@pytest.mark.slow
def test_a_server_that_crashes_again_and_again_loses_nothing(tmp_path: Path) -> None:
    """The daemon lives on: it waits for the server, and goes on where it stood."""
    rng = random.Random(SEED)
    with crashing_server() as server:
        assert server.is_durable()
        workspace = make_workspace(tmp_path / "bridge", settings={"store": server.url})
        feed = Feed(workspace)
        with quick_daemons(workspace.folder) as daemons:
            daemon = daemons.begin()
            try:
                until_serving(daemon, workspace.folder)
                for crash in range(CRASHES):
                    while len(feed.files) < FILES * (crash + 1) / CRASHES:
                        feed.drop()
                    time.sleep(rng.uniform(0.0, 0.5))
                    server.crash()
                    server.begin()
                    assert troubles(workspace) == ()
                until_through(workspace, FILES)
            finally:
                daemons.kill(daemon)
        assert_all_done_once(feed)
        assert troubles(workspace) == ()


def troubles(workspace: Workspace) -> tuple[str, ...]:
    with workspace.store() as store:
        archive = check_archive(store, workspace.archive, quiet)
        return (*check_store(store, quiet).troubles, *archive.troubles)


def until_through(workspace: Workspace, files: int, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        with workspace.store() as store:
            counts = count_stages(store)
        if counts[Stage.DONE] + counts[Stage.REFUSED] == files:
            return
        time.sleep(0.2)
    raise TimeoutError(f"{files} files are not through after {seconds} s: {counts}")
