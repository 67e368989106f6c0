"""A daemon that is killed again and again while files come in, and one that is left alone."""

from __future__ import annotations

import random
import time
from pathlib import Path

from shm.store import Workspace
from shm.store.recordings import count_stages
from tests.helpers.canonical import canonical
from tests.helpers.daemons import quick_daemons, until_serving
from tests.helpers.feeds import Feed, assert_all_done_once
from tests.helpers.workspaces import make_workspace

RecordingInProgress = tuple[int, ...]


def killed_again_and_again(
    workspace: Workspace, kills: int, files: int, rng: random.Random, longest_s: float = 0.25
) -> tuple[Feed, set[RecordingInProgress]]:
    """Kills each life of the daemon at a random moment; the feed, and how the files stood then."""
    feed, seen = Feed(workspace), set()
    with quick_daemons(workspace.folder) as daemons:
        for life in range(kills):
            while len(feed.files) < files * (life + 1) / kills:
                feed.drop()
            daemon = daemons.begin()
            if rng.random() < 0.8:  # else it may be killed before it comes to work
                until_serving(daemon, workspace.folder)
            time.sleep(rng.uniform(0.0, longest_s))
            assert daemons.kill(daemon) == -9
            seen.add(where_files_stand(workspace, len(feed.files)))
        daemons.begin(once=True)
        assert daemons.ended() == 0
    return feed, seen


def unfinished_uploads(folder: Path, files: int, **settings: object) -> Workspace:
    """The same feed, taken in by one daemon that nobody kills."""
    workspace = make_workspace(folder, settings=settings)
    feed = Feed(workspace)
    for _ in range(files):
        feed.drop()
    with quick_daemons(workspace.folder) as daemons:
        daemons.begin(once=True)
        assert daemons.ended() == 0
    return workspace


def assert_nothing_lost_doubled_or_half_written(feed: Feed, undisturbed: Workspace) -> None:
    """Each file is done once, and the store says what it says after an undisturbed run."""
    assert_all_done_once(feed)
    with feed.workspace.store() as disturbed, undisturbed.store() as quiet:
        found, expected = canonical(disturbed), canonical(quiet)
    assert found.keys() == expected.keys()
    for table, rows in expected.items():
        assert found[table] == rows, table


def where_files_stand(workspace: Workspace, files: int) -> RecordingInProgress:
    """How many files lie in the spool and how many at each stage: none less than were dropped."""
    with workspace.store() as store:
        counts = count_stages(store)
    in_spool = sum(not path.name.startswith(".") for path in workspace.spool.iterdir())
    assert in_spool + sum(counts.values()) >= files
    return in_spool, *counts.values()
