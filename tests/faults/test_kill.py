"""The daemon is killed without warning, again and again: nothing is lost, nothing doubled.

The long form, with the daemon as its owner begins it and the real sampler, is the benchmark
`tests/benchmarks/kill_daemon.py`.
"""

from __future__ import annotations

import random
from pathlib import Path

from shm.store import Stage
from tests.helpers.daemons import quick_daemon, until_serving
from tests.helpers.feeds import Feed, assert_all_done_once
from tests.helpers.workspaces import make_workspace

KILLS, FILES, SEED = 30, 40, 20260501


def test_thirty_kills_at_random_moments_lose_and_double_nothing(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    feed, rng, seen = Feed(workspace), random.Random(SEED), set()
    for life in range(KILLS):
        while len(feed.files) < FILES * (life + 1) / KILLS:
            feed.drop()
        daemon = quick_daemon(workspace.folder)
        if rng.random() < 0.8:  # else it may be killed before it comes to work
            until_serving(daemon.pid, workspace.folder)
        daemon.join(rng.uniform(0.0, 0.25))
        daemon.kill()
        daemon.join()
        assert daemon.exitcode == -9
        with workspace.store() as store:
            counts = store.stage_counts()
        in_spool = sum(1 for path in workspace.spool.iterdir() if not path.name.startswith("."))
        seen.add((in_spool, *counts.values()))
        assert in_spool + sum(counts.values()) >= len(feed.files)
    assert len(seen) > KILLS / 3, "the kills did not catch the daemon at work"
    last = quick_daemon(workspace.folder, once=True)
    last.join(60)
    assert last.exitcode == 0
    assert_all_done_once(feed)
    with workspace.store() as store:
        assert store.stage_counts()[Stage.DONE] == FILES - len(feed.bad)
