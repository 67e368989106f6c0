"""Two daemons on one PostgreSQL store and two Dask workers: a worker, then the active daemon is
killed at work. Does the standby take over within seconds, and is everything there once, with the
results of one undisturbed daemon to the bit?

    python tests/benchmarks/kill_two_daemons.py --files 60
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import begin

from shm_daemon import run
from tests.helpers.feeds import Feed
from tests.helpers.killing import assert_nothing_lost_doubled_or_half_written
from tests.helpers.postgres import postgresql_server
from tests.helpers.takeovers import kill_a_worker_then_the_active_daemon
from tests.helpers.workspaces import make_workspace


def main() -> None:
    options = begin.options(__doc__, files=60)
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder, postgresql_server() as databases:
        quiet = make_workspace(Path(folder) / "quiet")
        feed = Feed(quiet)
        for _ in range(options.files):
            feed.drop()
        run(quiet, once=True)
        with databases.store() as url:
            made = kill_a_worker_then_the_active_daemon(Path(folder), url, options.files)
            assert_nothing_lost_doubled_or_half_written(made.feed, quiet)
    print(
        f"{options.files} files, a worker and the active daemon killed: the standby served after "
        f"{made.takeover_s:.1f} s; 0 lost, 0 doubled, 0 half written, results equal to the bit; "
        f"{time.monotonic() - began:.0f} s"
    )


if __name__ == "__main__":
    main()
