"""The daemon is killed without warning, again and again: nothing is lost, nothing doubled.

The long form, with the daemon as its owner begins it and the real sampler, is the benchmark
`tests/benchmarks/kill_daemon.py`.
"""

from __future__ import annotations

import random
import time
from pathlib import Path

from shm.store import Workspace
from tests.helpers.daemons import quick_daemons, until_serving
from tests.helpers.feeds import Feed, assert_all_done_once
from tests.helpers.workspaces import make_workspace

KILLS, FILES, SEED = 30, 40, 20260501


def test_thirty_kills_at_random_moments_lose_and_double_nothing(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    feed, rng, seen = Feed(workspace), random.Random(SEED), set()
    with quick_daemons(workspace.folder) as daemons:
        for life in range(KILLS):
            while len(feed.files) < FILES * (life + 1) / KILLS:
                feed.drop()
            daemon = daemons.begin()
            if rng.random() < 0.8:  # else it may be killed before it comes to work
                until_serving(daemon, workspace.folder)
            time.sleep(rng.uniform(0.0, 0.25))
            assert daemons.kill(daemon) == -9
            seen.add(where_files_stand(workspace, len(feed.files)))
        daemons.begin(once=True)
        assert daemons.ended() == 0
    assert len(seen) > KILLS / 3, "the kills did not catch the daemon at work"
    assert_all_done_once(feed)


def where_files_stand(workspace: Workspace, files: int) -> tuple[int, ...]:
    """How many files lie in the spool and how many at each stage: none less than were dropped."""
    with workspace.store() as store:
        counts = store.stage_counts()
    in_spool = sum(not path.name.startswith(".") for path in workspace.spool.iterdir())
    assert in_spool + sum(counts.values()) >= files
    return in_spool, *counts.values()
