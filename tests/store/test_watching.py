"""Drifts, alerts and the outbox: an alert and what is owed for it are one."""

from __future__ import annotations

from dataclasses import replace
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
from shm.store.queries.history import list_steps
from shm.values import Alert, Drift, Selection
from tests.helpers.comparing import assert_same
from tests.helpers.nouns import (
    NOW,
    a_change,
    a_drift,
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


def test_a_watched_test_is_done_and_its_drift_is_kept(
    store: Store, updated: list[StoredTest]
) -> None:
    assert watch(store, updated[0]) is None
    assert store.tests.get(updated[0].id).stage is Stage.WATCHED
    assert store.recordings.get(updated[0].recording_id).stage is Stage.DONE
    assert store.watch.list_drifts(3) == (a_drift("t1"),)
    assert store.watch.list_drifts(4) == ()


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


def test_a_standing_condition_is_told_once_and_its_drifts_are_all_kept(
    store: Store, updated: list[StoredTest]
) -> None:
    raised = [watch(store, test, an_alert(test=test.test.id), "mail") for test in updated]
    assert [each is not None for each in raised] == [True, False, False]
    assert len(store.alerts.list_all()) == len(store.alerts.list_deliveries()) == 1
    assert [drift.test for drift in store.watch.list_drifts(3)] == ["t1", "t2", "t3"]


def test_another_condition_is_told_too(store: Store, updated: list[StoredTest]) -> None:
    for test, key in zip(updated, ("down", "up"), strict=False):
        assert watch(store, test, an_alert(key)) is not None
    assert [stored.alert.key for stored in store.alerts.list_all(3)] == ["down", "up"]


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


def test_a_delivery_that_failed_is_due_later(store: Store, updated: list[StoredTest]) -> None:
    watch(store, updated[0], an_alert(), "mail")
    (delivery,) = store.alerts.list_due_deliveries(NOW, 10)
    later = NOW + timedelta(seconds=5)
    store.alerts.save_failure(delivery, "exit code 1", NOW, later)
    assert store.alerts.list_due_deliveries(NOW, 10) == ()
    (again,) = store.alerts.list_due_deliveries(later, 10)
    assert (again.attempts, again.last_error) == (1, "exit code 1")
    assert store.alerts.list_due_deliveries(later, 10, excluding=[again.id]) == ()


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


def test_an_ended_delivery_is_not_due_again(store: Store, updated: list[StoredTest]) -> None:
    watch(store, updated[0], an_alert(), "mail", "siren")
    mail, siren = store.alerts.list_due_deliveries(NOW, 10)
    store.alerts.save_delivery(mail, NOW)
    store.alerts.save_failure(siren, "no such program", NOW, None)
    assert store.alerts.list_due_deliveries(NOW + timedelta(days=9), 10) == ()
    (done,) = store.alerts.list_deliveries(DeliveryState.DELIVERED)
    (given_up,) = store.alerts.list_deliveries(DeliveryState.GIVEN_UP)
    assert (done.hook, done.attempts, done.ended_at) == ("mail", 1, NOW)
    assert (given_up.hook, given_up.last_error) == ("siren", "no such program")


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
    reached = [step.stage for step in list_steps(store, updated[0].recording_id)]
    assert reached.count("notified") == 1


def test_what_the_watch_said_comes_back_as_it_was(store: Store, updated: list[StoredTest]) -> None:
    said = a_watched_test("t1")
    store.watch.save(updated[0], baseline(store), said, None, [], NOW)
    (kept,) = store.watch.list_all(3)
    assert vars(kept.watched) == vars(said)
    assert (kept.hanger, kept.baseline_id) == (3, baseline(store).id)
    assert store.watch.list_drifts(3) == said.drifts
    assert store.watch.list_all(4) == store.watch.list_all(3, baseline_id=99) == ()


def test_what_the_watch_did_not_know_comes_back_unknown(
    store: Store, updated: list[StoredTest]
) -> None:
    nan = float("nan")
    said = replace(a_watched_test("t1", sudden=nan, moved=()), temperature_c=nan)
    store.watch.save(updated[0], baseline(store), said, None, [], NOW)
    (kept,) = store.watch.list_all()
    assert_same(kept.watched, said)


def test_watches_come_by_time_and_each_with_its_own_shifts(
    store: Store, updated: list[StoredTest]
) -> None:
    for test, hours in zip(updated, (2, 1, 3), strict=True):
        name, time = test.test.id, NOW + timedelta(hours=hours)
        shifts = (a_drift(name), replace(a_drift(name), quantity="log10_k1"))
        said = replace(a_watched_test(name), time=time, drifts=shifts)
        store.watch.save(test, baseline(store), said, None, [], NOW)
    found = [each.watched for each in store.watch.list_all(3, baseline(store).id)]
    assert [each.test for each in found] == ["t2", "t1", "t3"]
    assert [[drift.test for drift in each.drifts] for each in found] == [
        ["t2", "t2"], ["t1", "t1"], ["t3", "t3"],
    ]  # fmt: skip


def test_an_alert_keeps_its_kinds_and_the_change_behind_it(
    store: Store, updated: list[StoredTest]
) -> None:
    alert = replace(an_alert(test="t1"), kinds=("slow drift",), change=a_change())
    watch(store, updated[0], alert, "mail")
    (stored,) = store.alerts.list_all()
    (delivery,) = store.alerts.list_deliveries()
    assert stored.alert == delivery.alert == alert


def test_unknown_numbers_of_a_drift_come_back_unknown(
    store: Store, updated: list[StoredTest]
) -> None:
    nan = float("nan")
    drift = Drift(3, "t1", NOW, "tension", nan, 1.0, nan, 0.0, 0.05, nan)
    store.watch.save(
        updated[0], baseline(store), replace(a_watched_test(), drifts=(drift,)), None, [], NOW
    )
    assert_same(store.watch.list_drifts(3), (drift,))
