"""A watch goes on from what it kept, and the daemon fetches no more than that needs."""

from __future__ import annotations

from typing import Any

import pytest
import sqlalchemy as sa

from shm.pipeline import steps
from shm.store import Workspace
from shm.store.tables import watch_states
from shm.values import WatchedTest
from tests.helpers.comparing import assert_same
from tests.helpers.flows import ingest
from tests.helpers.slow import few_of
from tests.helpers.workspaces import make_workspace, write_test


@pytest.fixture
def gone_over(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The tests that each watch was given, the newest last."""
    watch, seen = steps.watch_test, []

    def noted(baseline: Any, tests: Any, *terms: Any) -> Any:
        seen.append([test.id for test, _ in tests[1]])
        return watch(baseline, tests, *terms)

    monkeypatch.setattr(steps, "watch_test", noted)
    return seen


def add(workspace: Workspace, day: int) -> None:
    tension = 1.0 + 0.002 * (day % 3)
    write_test(workspace.spool / f"t{day}.modes.json", workspace, day=day, tension=tension)
    ingest(workspace)


def said(workspace: Workspace) -> list[WatchedTest]:
    with workspace.store() as store:
        return [each.watched for each in store.watch.list_all(3)]


def change_state(workspace: Workspace, **values: object) -> None:
    with workspace.store() as store, store.writing() as connection:
        connection.execute(sa.update(watch_states).values(**values))


def test_only_the_newest_test_is_gone_over(
    workspace: Workspace, gone_over: list[list[str]]
) -> None:
    for day in range(4):
        add(workspace, day)
    assert gone_over == [["t1"], ["t2"], ["t3"]]


def test_a_test_that_came_late_makes_the_watch_begin_anew(
    workspace: Workspace, gone_over: list[list[str]]
) -> None:
    for day in (0, 2, 4, 3, 5, 6):
        add(workspace, day)
    assert gone_over == [["t2"], ["t4"], ["t2", "t3"], ["t2", "t3", "t4", "t5"], ["t6"]]


@pytest.mark.parametrize(
    ("values", "begins_anew"),
    few_of([({"content": b"damaged"}, 2), ({"key": "of an earlier shm"}, 1)], 1),
)
def test_what_is_kept_may_be_damaged_or_old(
    workspace: Workspace,
    gone_over: list[list[str]],
    values: dict[str, object],
    begins_anew: int,
) -> None:
    for day in range(3):
        add(workspace, day)
    change_state(workspace, **values)
    del gone_over[:]
    add(workspace, 3)
    assert gone_over[-1] == ["t1", "t2", "t3"]
    assert len(gone_over) == begins_anew
    whole = make_workspace(workspace.folder.with_name("whole"))
    for day in range(4):
        add(whole, day)
    assert_same(said(workspace), said(whole))
