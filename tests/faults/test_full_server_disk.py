"""The disk of a PostgreSQL server fills while files come in: the daemon waits, and goes on."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import pytest

from shm.store import Workspace
from tests.helpers import quick_update
from tests.helpers.feeds import Feed
from tests.helpers.full_server_disks import (
    assert_whole,
    count_writes,
    fill_from,
    forget_writes,
    ingest_meanwhile,
    writes,
)
from tests.helpers.postgres import Databases
from tests.helpers.workspaces import make_workspace

FILES, MOMENTS, SEED = 3, 4, 20261125


@pytest.mark.slow
def test_a_disk_that_fills_at_any_write_or_commit_costs_nothing(
    postgresql: Databases, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quick_update.stand_in(monkeypatch.setattr)
    rng = random.Random(SEED)
    drafts = tmp_path / "drafts"
    drafts.mkdir()
    most = _ingest(postgresql, tmp_path, drafts, monkeypatch, first=2**40, last=2**40)
    assert most > 10 * FILES
    for number in range(MOMENTS):
        first = 1 + number * most // MOMENTS + rng.randrange(most // MOMENTS)
        last = first + rng.choice((1, 2, 5))
        try:
            asked = _ingest(postgresql, tmp_path, drafts, monkeypatch, first=first, last=last)
        except BaseException as error:
            error.add_note(f"the disk was full from write {first} to before write {last}")
            raise
        assert asked >= first, "the disk was never full"


def _ingest(
    databases: Databases,
    tmp_path: Path,
    drafts: Path,
    monkeypatch: pytest.MonkeyPatch,
    *,
    first: int,
    last: int,
) -> int:
    """How many writes an ingest of some files took, the disk full meanwhile for some of them."""
    with databases.store() as url:
        workspace = make_workspace(tmp_path / "bridge", settings={"store": url})
        feed = Feed(workspace, drafts=drafts)
        for _ in range(FILES):
            feed.drop()
        count_writes(databases, url)
        try:
            fill_from(databases, url, first, last)
            ingest_meanwhile(workspace, monkeypatch)
            asked = writes(databases, url)
            assert_whole(Feed(Workspace.open(workspace.folder), files=feed.files, bad=feed.bad))
        finally:
            forget_writes(databases, url)
            shutil.rmtree(workspace.folder)
            workspace.folder.with_name("bridge.toml").unlink()
    return asked
