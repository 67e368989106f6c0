"""Drifts, alerts and the outbox: an alert and what is owed for it are one."""

from __future__ import annotations

from datetime import timedelta

import pytest

from shm.errors import StoreError
from shm.store import (
    Baseline,
    DeliveryState,
    IdentifiedTest,
    Lineage,
    Stage,
    Store,
    StoredAlert,
    StoredTest,
)
from shm.store.journal import list_steps
from shm.values import Alert, Selection
from tests.helpers.nouns import (
    NOW,
    a_file,
    a_posterior,
    a_test,
    a_watched_test,
    an_alert,
)

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")


@pytest.fixture
def updated(store: Store) -> list[StoredTest]:
    """Three tests with posteriors after the one that makes the baseline."""
    for number in range(4):
        recording = store.recordings.receive(a_file(number), NOW).recording
        test = IdentifiedTest(a_test(f"t{number}", days=number))
        store.tests.save(recording.id, [test], LINEAGE, NOW)
    first, *later = store.tests.list_all()
    store.posteriors.save_selection(3, [first], Selection((a_posterior(),), (1.0,)), LINEAGE, NOW)
    for test in later:
        store.posteriors.save(test, a_posterior(tests=(test.test.id,)), LINEAGE, NOW)
    return later


def watch(
    store: Store, test: StoredTest, alert: Alert | None = None, *hooks: str
) -> StoredAlert | None:
    found = a_watched_test(test.test.id)
    raised = store.watch.save(test, baseline(store), found, alert, hooks, NOW)
    return raised[0] if raised else None


def baseline(store: Store) -> Baseline:
    found = store.watch.baseline(3)
    assert found is not None
    return found


def test_a_new_alert_owes_each_hook_a_delivery(store: Store, updated: list[StoredTest]) -> None:
    raised = watch(store, updated[0], an_alert(test="t1"), "mail", "siren")
    assert raised is not None
    assert store.alerts.list_all(3) == (raised,)
    assert raised.alert == an_alert(test="t1")
    due = store.alerts.list_due_deliveries(NOW, 10)
    assert [(each.hook, each.attempts, each.alert) for each in due] == [
        ("mail", 0, raised.alert),
        ("siren", 0, raised.alert),
    ]


def test_watching_a_test_again_changes_nothing(store: Store, updated: list[StoredTest]) -> None:
    watch(store, updated[0])
    assert watch(store, updated[0], an_alert(), "mail") is None
    assert len(store.watch.list_drifts()) == 1
    assert store.alerts.list_all() == ()


def test_an_alert_whose_delivery_cannot_be_entered_is_not_raised(
    store: Store, updated: list[StoredTest]
) -> None:
    with pytest.raises(StoreError):
        watch(store, updated[0], an_alert(), "mail", "mail")
    assert (
        store.alerts.list_all() == store.alerts.list_deliveries() == store.watch.list_drifts() == ()
    )
    assert store.tests.get(updated[0].id).stage is Stage.UPDATED


def test_a_delivery_put_off_by_a_clock_that_was_ahead_is_due_once_it_is_right(
    store: Store, updated: list[StoredTest]
) -> None:
    watch(store, updated[0], an_alert(), "mail")
    waits = [timedelta(0), timedelta(seconds=5), timedelta(seconds=10)]
    before = NOW - timedelta(days=400)
    assert store.alerts.list_due_deliveries(before, 10) == ()
    (delivery,) = store.alerts.list_due_deliveries(before, 10, (), waits)
    for tries in range(1, 5):
        wait = waits[min(tries, 2)]
        store.alerts.save_failure(delivery, "exit code 1", NOW, NOW + wait)
        (again,) = store.alerts.list_due_deliveries(before, 10, (), waits)
        assert again.attempts == tries
        assert store.alerts.list_due_deliveries(NOW, 10, (), waits) == ()


def test_a_delivery_that_two_have_made_is_ended_once(
    store: Store, updated: list[StoredTest]
) -> None:
    watch(store, updated[0], an_alert(test="t1"), "mail")
    (owed,) = store.alerts.list_deliveries()
    store.alerts.save_delivery(owed, NOW)
    store.alerts.save_delivery(owed, NOW)
    store.alerts.save_failure(owed, "no answer", NOW, None)
    store.alerts.save_failure(owed, "no answer", NOW, NOW)
    (ended,) = store.alerts.list_deliveries()
    assert (ended.state, ended.attempts, ended.last_error) == (DeliveryState.DELIVERED, 1, "")
    reached = [step.kind for step in list_steps(store, updated[0].recording_id)]
    assert reached.count("notified") == 1
