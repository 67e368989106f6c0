"""Outboxes full of alerts, by the store's own verbs, without any sampler."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from shm.pipeline import utc_now
from shm.store import IdentifiedTest, Lineage, Store, StoredTest, Workspace
from shm.values import Alert, Selection
from tests.helpers.nouns import (
    NOW,
    a_drift,
    a_file,
    a_posterior,
    a_test,
    a_watched_test,
    an_alert,
)

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")


def make_baseline(workspace: Workspace) -> None:
    """The first test of hanger 3, with which later ones are compared."""
    with workspace.store() as store:
        (test,) = entered(store, [0])
        store.posteriors.save_selection(
            3, [test], Selection((a_posterior(),), (1.0,)), LINEAGE, NOW
        )


def raise_alerts(workspace: Workspace, numbers: Iterable[int], hooks: Sequence[str]) -> None:
    """A test, its alert and the deliveries owed for it, for each number from 1 up."""
    with workspace.store() as store:
        baseline = store.watch.baseline(3)
        assert baseline is not None
        for test in entered(store, numbers):
            name = test.test.id
            store.posteriors.save(test, a_posterior(tests=(name,)), LINEAGE, NOW)
            alert = an_alert(f"hanger-3:{name}", name)
            assert store.watch.save(test, baseline, a_watched_test(name), alert, hooks, NOW)


def make_baselines(workspace: Workspace, hangers: Iterable[int]) -> None:
    """The first test of each hanger, with which later ones are compared."""
    with workspace.store() as store:
        for hanger in hangers:
            test = _one(store, hanger, 0)
            posterior = replace(a_posterior(tests=(test.test.id,)), hanger=hanger)
            chosen = Selection((posterior,), (1.0,))
            store.posteriors.save_selection(hanger, [test], chosen, LINEAGE, NOW)


def raise_alike(workspace: Workspace, hangers: Iterable[int], hooks: Sequence[str]) -> None:
    """An alert on each hanger, all alike, as of now: their tension fell."""
    with workspace.store() as store:
        for hanger in hangers:
            baseline, test = store.watch.baseline(hanger), _one(store, hanger, 1)
            assert baseline is not None
            name, now = test.test.id, utc_now()
            posterior = replace(a_posterior(tests=(name,)), hanger=hanger)
            store.posteriors.save(test, posterior, LINEAGE, now)
            drift, message = replace(a_drift(name), hanger=hanger), f"Hanger {hanger}: fell."
            kinds, key = ("beyond threshold",), f"hanger-{hanger}:{name}"
            alert = Alert(key, hanger, name, test.time, message, (drift,), kinds)
            store.watch.save(test, baseline, a_watched_test(name), alert, hooks, now)


def _one(store: Store, hanger: int, day: int) -> StoredTest:
    name = f"h{hanger}-{day}"
    received = store.recordings.receive(a_file(100 * hanger + day), NOW).recording
    found = [IdentifiedTest(a_test(name, days=day, hanger=hanger))]
    store.tests.save(received.id, found, LINEAGE, NOW)
    (test,) = (each for each in store.tests.list_all(hanger) if each.test.id == name)
    return test


def entered(store: Store, numbers: Iterable[int]) -> list[StoredTest]:
    names = set()
    for number in numbers:
        recording = store.recordings.receive(a_file(number), NOW).recording
        test = a_test(f"t{number}", days=number / 10)
        store.tests.save(recording.id, [IdentifiedTest(test)], LINEAGE, NOW)
        names.add(test.id)
    return [test for test in store.tests.list_all(3) if test.test.id in names]
