"""The daemon is killed without warning, again and again: nothing is lost, nothing doubled.

The long form is the benchmark `tests/benchmarks/kill_daemon.py`.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from shm.store import Workspace
from tests.helpers.killing import (
    assert_nothing_lost_doubled_or_half_written,
    killed_again_and_again,
    unfinished_uploads,
)
from tests.helpers.postgres import Databases
from tests.helpers.workspaces import make_workspace

KILLS, FILES, SEED = 4, 8, 20260501


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    return unfinished_uploads(tmp_path_factory.mktemp("quiet") / "bridge", FILES)


def kill(workspace: Workspace, undisturbed: Workspace) -> None:
    rng = random.Random(SEED)
    feed, seen = killed_again_and_again(workspace, KILLS, FILES, rng)
    assert len(seen) > KILLS / 3, "the kills did not catch the daemon at work"
    assert_nothing_lost_doubled_or_half_written(feed, undisturbed)


def test_kills_at_random_moments_lose_and_double_nothing(
    tmp_path: Path, undisturbed: Workspace
) -> None:
    kill(make_workspace(tmp_path / "bridge"), undisturbed)


@pytest.mark.slow
def test_nor_do_they_where_the_store_is_a_server(
    tmp_path: Path, undisturbed: Workspace, postgresql: Databases
) -> None:
    with postgresql.store() as url:
        kill(make_workspace(tmp_path / "bridge", settings={"store": url}), undisturbed)
