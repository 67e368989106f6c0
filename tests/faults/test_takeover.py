"""Two daemons on one store, two workers: one of each is killed, and nobody need look."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm_daemon import run
from tests.helpers.feeds import Feed
from tests.helpers.killing import assert_nothing_lost_doubled_or_half_written
from tests.helpers.postgres import Databases
from tests.helpers.takeovers import kill_a_worker_then_the_active_daemon
from tests.helpers.workspaces import make_workspace

FILES = 4


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_worker_and_then_the_active_daemon_die_and_the_standby_ends_the_work(
    tmp_path: Path, postgresql: Databases
) -> None:
    quiet = make_workspace(tmp_path / "quiet")
    feed = Feed(quiet)
    for _ in range(FILES):
        feed.drop()
    run(quiet, once=True)
    with postgresql.store() as url:
        made = kill_a_worker_then_the_active_daemon(tmp_path, url, FILES)
        assert_nothing_lost_doubled_or_half_written(made.feed, quiet)
