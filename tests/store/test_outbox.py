"""What hooks are owed: messages, failures, what is sent again; and settings that were changed."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest

from shm.errors import NothingThere, StoreError, UsageError
from shm.store import DeliveryState, Reconciled, Stage, Store
from shm.store.alerts import count_deliveries
from shm.store.journal import list_steps
from tests.helpers.entering import four_tests, watch
from tests.helpers.nouns import NOW, an_alert
from tests.helpers.streams import a_reading

HOUR = timedelta(hours=1)
WAITING, DELIVERED = DeliveryState.WAITING, DeliveryState.DELIVERED
GIVEN_UP, NOT_NEEDED = DeliveryState.GIVEN_UP, DeliveryState.NOT_NEEDED


def raised(store: Store, number: int, *hooks: str) -> int:
    """An alert of a stream, owed to hooks from its own hour on."""
    alert = replace(an_alert(f"hanger-3:{number}"), test="")
    opens, at = Reconciled((alert,)), NOW + number * HOUR
    (made,) = store.streams.save_pooled(a_reading(number), None, opens, hooks, at)
    return made.id


def states(store: Store) -> list[tuple[int, str, DeliveryState, int | None]]:
    return [(e.stored.id, e.hook, e.state, e.message_id) for e in store.alerts.list_deliveries()]


def due(store: Store, hours: float, **asked: object) -> list[int]:
    return [each.id for each in store.alerts.list_due_deliveries(NOW + hours * HOUR, 9, **asked)]


def test_messages_keep_the_deliveries_that_they_were_made_of(file_store: Store) -> None:
    alerts = file_store.alerts
    alerts.begin_messages((), {}, NOW)
    first, second, third = (raised(file_store, n, "mail") for n in (1, 2, 3))
    assert [each.id for each in alerts.list_deliveries(WAITING, unsent=True)] == [1, 2, 3]
    assert due(file_store, 2) == []  # none is a message yet
    alerts.begin_messages([[2, 1]], {3: "resolved before"}, NOW + 5 * HOUR)
    assert states(file_store) == [
        (first, "mail", WAITING, 1),
        (second, "mail", WAITING, 1),
        (third, "mail", NOT_NEEDED, None),
    ]
    left_out = alerts.list_deliveries(NOT_NEEDED)[0]
    assert (left_out.last_error, left_out.ended_at) == ("resolved before", NOW + 5 * HOUR)
    assert alerts.list_deliveries(WAITING, unsent=True) == ()
    assert [each.id for each in alerts.list_deliveries(messages=[1])] == [1, 2]
    assert due(file_store, 5) == [1]
    assert due(file_store, 4) == due(file_store, 5, excluding=[1]) == []
    alerts.begin_messages([[1], [2]], {1: "too late", 3: "too late"}, NOW + 6 * HOUR)
    assert [each[2:] for each in states(file_store)] == [
        (WAITING, 1), (WAITING, 1), (NOT_NEEDED, None),
    ]  # fmt: skip
    alerts.save_delivery(alerts.list_deliveries(messages=[1])[0], NOW + 7 * HOUR)
    assert [each[2] for each in states(file_store)] == [DELIVERED, DELIVERED, NOT_NEEDED]
    counts = {state: n for state, n in count_deliveries(file_store).items() if n}
    assert counts == {DELIVERED: 2, NOT_NEEDED: 1}


def test_a_failure_is_put_off_and_one_put_off_too_far_is_due_again(file_store: Store) -> None:
    alerts = file_store.alerts
    raised(file_store, 0, "mail")
    alerts.begin_messages([[1]], {}, NOW)
    (delivery,) = alerts.list_due_deliveries(NOW, 1)
    alerts.save_failure(delivery, "no route", NOW, NOW + 9 * HOUR)
    (tried,) = alerts.list_deliveries()
    assert (tried.attempts, tried.last_error, tried.next_attempt_at, tried.message_id) == (
        1, "no route", NOW + 9 * HOUR, 1,
    )  # fmt: skip
    assert (tried.state, tried.ended_at) == (WAITING, None)
    assert due(file_store, 1) == []
    # After one attempt it waits an hour at most: 9 hours were told by a clock that was ahead.
    assert due(file_store, 1, waits=[9 * HOUR, HOUR, 9 * HOUR]) == [1]
    assert due(file_store, 1, waits=[HOUR, 9 * HOUR]) == []
    assert due(file_store, 1, waits=[HOUR]) == [1]


def test_what_was_given_up_is_owed_again_with_its_whole_message(file_store: Store) -> None:
    alerts = file_store.alerts
    first, second = (raised(file_store, n, "mail", "sms") for n in (1, 2))
    alerts.begin_messages([[1, 3], [2, 4]], {}, NOW)
    with pytest.raises(UsageError, match=f"alert {first} was given up by no hook"):
        alerts.resend(first, NOW)
    with pytest.raises(NothingThere, match="no alert 99"):
        alerts.resend(99, NOW)
    (mail,) = (each for each in alerts.list_due_deliveries(NOW, 9) if each.hook == "mail")
    alerts.save_failure(mail, "refused", NOW, None)
    assert [each[2] for each in states(file_store)] == [GIVEN_UP, WAITING, GIVEN_UP, WAITING]
    assert alerts.list_deliveries(GIVEN_UP)[0].ended_at == NOW
    again = alerts.resend(second, NOW + HOUR)
    assert [(each.stored.id, each.hook, each.attempts, each.ended_at) for each in again] == [
        (second, "mail", 0, None)
    ]
    assert [each[2] for each in states(file_store)] == [WAITING] * 4
    assert {each.next_attempt_at for each in again} == {NOW + HOUR}


def test_a_test_is_through_when_no_hook_is_owed_its_alert(filled_copy: Store) -> None:
    """Once, however many hooks there are."""
    store = filled_copy
    (first,) = (e for e in store.alerts.list_deliveries() if e.stored.alert.test == "t2")
    before = [step.kind for step in list_steps(store, 2)]
    store.alerts.save_delivery(first, NOW + HOUR)
    after = [step.kind for step in list_steps(store, 2)]
    assert after == [*before, "notified"]


def test_a_new_alert_owes_each_hook_a_delivery(store: Store) -> None:
    _, test, *_ = four_tests(store)
    raised = watch(store, test, an_alert(test="t1"), "mail", "siren")
    assert raised is not None
    assert store.alerts.list_all(3) == (raised,)
    assert raised.alert == an_alert(test="t1")
    due = store.alerts.list_deliveries(DeliveryState.WAITING, unsent=True)
    assert [(each.hook, each.attempts, each.alert) for each in due] == [
        ("mail", 0, raised.alert),
        ("siren", 0, raised.alert),
    ]


def test_watching_a_test_again_changes_nothing(store: Store) -> None:
    _, test, *_ = four_tests(store)
    watch(store, test)
    assert watch(store, test, an_alert(), "mail") is None
    assert len(store.watch.list_drifts()) == 1
    assert store.alerts.list_all() == ()


def test_an_alert_whose_delivery_cannot_be_entered_is_not_raised(store: Store) -> None:
    _, test, *_ = four_tests(store)
    with pytest.raises(StoreError):
        watch(store, test, an_alert(), "mail", "mail")
    assert (
        store.alerts.list_all() == store.alerts.list_deliveries() == store.watch.list_drifts() == ()
    )
    assert store.tests.get(test.id).stage is Stage.UPDATED


def test_a_delivery_put_off_by_a_clock_that_was_ahead_is_due_once_it_is_right(
    store: Store,
) -> None:
    _, test, *_ = four_tests(store)
    watch(store, test, an_alert(), "mail")
    (owed,) = store.alerts.list_deliveries()
    store.alerts.begin_messages([[owed.id]], {}, NOW)
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


def test_a_delivery_that_two_have_made_is_ended_once(store: Store) -> None:
    _, test, *_ = four_tests(store)
    watch(store, test, an_alert(test="t1"), "mail")
    (owed,) = store.alerts.list_deliveries()
    store.alerts.save_delivery(owed, NOW)
    store.alerts.save_delivery(owed, NOW)
    store.alerts.save_failure(owed, "no answer", NOW, None)
    store.alerts.save_failure(owed, "no answer", NOW, NOW)
    (ended,) = store.alerts.list_deliveries()
    assert (ended.state, ended.attempts, ended.last_error) == (DeliveryState.DELIVERED, 1, "")
    reached = [step.kind for step in list_steps(store, test.recording_id)]
    assert reached.count("notified") == 1
