"""Two processes that both believe to be the active one: each step gives one result all the same.

So it is for the rest of a turn in which a daemon has lost its lock and another has taken over.
"""

from __future__ import annotations

from collections import Counter
from concurrent.futures import wait
from pathlib import Path

import pytest

from shm.pipeline import Flow, steps
from shm.store import DeliveryState, Stage, Workspace
from shm.store.journal import list_events, list_steps
from shm.store.recordings import list_recordings
from tests.helpers.flows import Postman, a_flow, ingest, receive_all, tension_kn
from tests.helpers.workspaces import make_workspace, put, write_loss, write_test


def begun(flow: Flow) -> bool:
    """A turn, of which all steps that it has begun are through; whether there were any."""
    busy = flow.advance()
    wait(flow.under_way)
    return busy


def work_side_by_side(first: Flow, second: Flow) -> None:
    """Each begins what it finds waiting before the other has kept its result of the same step."""
    while any([begun(first), begun(second)]):
        pass


def outcome(workspace: Workspace) -> object:
    """All that must not double: stages reached, results, alerts, what was owed to hooks."""
    with workspace.store() as store:
        return (
            [[step.kind for step in list_steps(store, each.id)] for each in list_recordings(store)],
            tension_kn(store),
            len(store.watch.list_drifts(3)),
            [stored.alert.key for stored in store.alerts.list_all()],
            [(delivery.hook, delivery.state) for delivery in store.alerts.list_deliveries()],
            Counter(event.kind for event in list_events(store)),
        )


@pytest.mark.slow
def test_steps_done_by_two_give_the_results_of_one(tmp_path: Path) -> None:
    alone, shared = (
        make_workspace(tmp_path / name, hooks={"mail": ["true"]}) for name in ("alone", "shared")
    )
    for workspace in (alone, shared):
        write_loss(workspace.spool, workspace)
        put(workspace.spool / "bad.csv", "no header")
    ingest(alone, notifier=Postman())
    postmen = Postman(), Postman()
    with (
        a_flow(shared, notifier=postmen[0]) as first,
        a_flow(shared, notifier=postmen[1]) as second,
    ):
        receive_all(first)
        work_side_by_side(first, second)
    assert all(postman.told for postman in postmen)  # both were at work: a hook may be told twice
    found = outcome(shared)
    assert found == outcome(alone)
    assert DeliveryState.DELIVERED in str(found)


def test_what_another_has_done_is_not_refused_for_failing_here(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_test(workspace.spool / "t1.modes.json", workspace)

    def broken(*_: object) -> None:
        raise RuntimeError("no memory on this machine")

    with a_flow(workspace) as failing, a_flow(workspace) as able:
        receive_all(failing)
        with monkeypatch.context() as patched:
            patched.setattr(steps, "identify_file", broken)
            assert begun(failing)
        able.drain()
        failing.drain()
        (recording,) = list_recordings(able.store)
    assert recording.stage is Stage.DONE
    assert list(workspace.quarantine.folder.iterdir()) == []
