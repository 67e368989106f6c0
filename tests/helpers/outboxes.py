"""Outboxes full of alerts, by the store's own verbs, without any sampler."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import datetime

from shm.store import Store, StoredTest, Workspace
from shm.values import Alert
from tests.helpers.entering import LINEAGE as LINEAGE
from tests.helpers.entering import identified, selected, updated, watch
from tests.helpers.nouns import a_drift, a_watched_test, an_alert


def make_baseline(workspace: Workspace) -> None:
    """The first test of hanger 3, with which later ones are compared."""
    with workspace.store() as store:
        selected(store, entered(store, [0]))


def raise_alerts(workspace: Workspace, numbers: Iterable[int], hooks: Sequence[str]) -> None:
    """A test, its alert and the deliveries owed for it, for each number from 1 up."""
    with workspace.store() as store:
        for test in entered(store, numbers):
            name = test.test.id
            assert watch(store, updated(store, test), an_alert(f"hanger-3:{name}", name), *hooks)


def raise_alike(
    workspace: Workspace,
    hangers: Iterable[int],
    hooks: Sequence[str],
    at: datetime,
    *,
    day: int = 1,
    action: str = "",
) -> None:
    """An alert on each hanger, all alike: their tension fell; first tests make the baselines."""
    with workspace.store() as store:
        for hanger in hangers:
            if store.watch.baseline(hanger) is None:
                selected(store, [_one(store, hanger, 0, at)])
            baseline, test = store.watch.baseline(hanger), _one(store, hanger, day, at)
            assert baseline is not None
            name = updated(store, test).test.id
            drift = replace(a_drift(name), hanger=hanger, shift_mean=-0.08 - hanger / 1e4)
            message = f"Hanger {hanger}: tension fell. {action}".rstrip()
            kinds, key = ("beyond threshold",), f"hanger-{hanger}:{name}"
            alert = Alert(key, hanger, name, test.time, message, (drift,), kinds)
            assert store.watch.save(test, baseline, a_watched_test(name), alert, hooks, at)


def _one(store: Store, hanger: int, day: int, at: datetime) -> StoredTest:
    named = {"name": f"h{hanger}-{day}", "days": day, "hanger": hanger, "at": at}
    return identified(store, 100 * hanger + day, **named)  # type: ignore[arg-type]


def entered(store: Store, numbers: Iterable[int]) -> list[StoredTest]:
    return [identified(store, number, days=number / 10) for number in numbers]
