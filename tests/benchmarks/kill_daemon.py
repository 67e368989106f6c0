"""`kill -9` of the daemon at random moments of an ingest: is every file stored once, none lost?

    python tests/benchmarks/kill_daemon.py --kills 30 --files 40

The daemon is `python -m shm_daemon` with a pool of two processes and the real sampler. Files come
in from time to time; each life lasts a random time from the moment the daemon, or in most lives
its first worker, comes to work.
`tests/faults` holds the short form.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shm.store import Stage, Workspace
from tests.helpers.daemons import real_daemon, until_serving
from tests.helpers.feeds import Feed, assert_all_done_once
from tests.helpers.workspaces import make_workspace


def until_a_step_is_done(workspace: Workspace) -> None:
    """Waits until the workers of the present life have come to work."""
    log, end = workspace.folder / "daemon.log", time.monotonic() + 60
    while ": done" not in log.read_text().rpartition("watching")[2] and time.monotonic() < end:
        time.sleep(0.02)


def live_and_be_killed(workspace: Workspace, seconds: float, warm: bool) -> dict[Stage, int]:
    """One life of the daemon, ended by SIGKILL; how many files stand where after it.

    `warm` lets the time begin only when the workers, which import much, are at work.
    """
    with real_daemon(workspace.folder) as daemon:
        until_serving(daemon.pid, workspace.folder)
        if warm:
            until_a_step_is_done(workspace)
        time.sleep(seconds)
    with workspace.store() as store:
        return store.stage_counts()


def live_in_peace(workspace: Workspace, files: int) -> None:
    """A last life that ends when all files have come to their end."""
    ended = 0
    with real_daemon(workspace.folder) as daemon:
        while ended < files:
            time.sleep(0.2)
            with workspace.store() as store:
                counts = store.stage_counts()
            ended = counts[Stage.DONE] + counts[Stage.REFUSED]
        daemon.terminate()
        if daemon.wait(30) != 0:
            raise SystemExit(f"SIGTERM gave exit code {daemon.returncode}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--files", type=int, default=40)
    parser.add_argument("--longest", type=float, default=2.0, help="longest life, in s")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng, began = random.Random(options.seed), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        workspace = make_workspace(Path(folder) / "bridge", settings={"workers": 2})
        feed = Feed(workspace)
        for life in range(options.kills):
            while len(feed.files) < options.files * (life + 1) / options.kills:
                feed.drop()
            counts = live_and_be_killed(
                workspace, rng.uniform(0.0, options.longest), warm=rng.random() < 0.7
            )
            print(f"kill {life + 1}: " + ", ".join(f"{n} {s}" for s, n in counts.items() if n))
        live_in_peace(workspace, options.files)
        assert_all_done_once(feed)
    print(
        f"{options.kills} kills, {options.files} files: every file stored once, none lost, "
        f"{time.monotonic() - began:.0f} s"
    )


if __name__ == "__main__":
    main()
