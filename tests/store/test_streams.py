"""What permanent sensors said is kept: windows, readings, events, the watch, progress."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest

from shm.errors import StoreError
from shm.store import Reconciled, Store
from shm.store.rows import Ending
from shm.store.streams import (
    StreamWatchCheckpoint,
    find_first_unpooled,
    list_pooled,
    list_stream_events,
    list_windows,
    load_stream_watch,
)
from tests.helpers.comparing import assert_same
from tests.helpers.nouns import NOW, an_alert
from tests.helpers.streams import MODES, a_reading, a_window, an_event

EVER = NOW - timedelta(days=5000), NOW + timedelta(days=5000)


def test_a_window_comes_back_and_is_replaced_where_it_is_done_anew(store: Store) -> None:
    store.streams.save_window(a_window(10, ()))
    store.streams.save_window(a_window(0))
    store.streams.save_window(a_window(10))
    found = list_windows(store, 3, *EVER)
    assert_same(found, (a_window(0), a_window(10)))
    assert list_windows(store, 4, *EVER) == ()
    assert len(list_windows(store, 3, NOW, NOW + timedelta(minutes=10))) == 1


def test_a_pooled_reading_its_watch_and_its_alert_come_together(store: Store) -> None:
    alert = replace(an_alert(), key="hanger-3:stream", test="", drifts=())
    assert store.streams.save_pooled(a_reading(-1)) == ()
    opens = Reconciled((alert,))
    (raised,) = store.streams.save_pooled(a_reading(), b"state", opens, ["mail"])
    assert raised.raised_at == NOW + timedelta(hours=1)
    state = load_stream_watch(store, 3)
    assert state is not None
    assert state.content == b"state"
    assert_same(list_pooled(store, 3, "hour", *EVER), (a_reading(-1), a_reading()))
    (owed,) = store.alerts.list_deliveries()
    assert (owed.hook, owed.stored.alert.key) == ("mail", "hanger-3:stream")
    again = store.streams.save_pooled(a_reading(1), b"later", opens, ["mail"], NOW)
    state = load_stream_watch(store, 3)
    assert state is not None
    assert (again, state.content) == ((), b"later")
    store.streams.save_pooled(
        a_reading(2), b"over", Reconciled((), {raised.id: (Ending.OVER, "over")})
    )
    (over,) = store.alerts.list_all(3, standing=False)
    assert over.resolution is not None
    assert over.resolution.at == NOW + timedelta(hours=3)


def test_nothing_of_a_reading_is_kept_where_its_alert_cannot_be(store: Store) -> None:
    alert = replace(an_alert(), key=None)  # type: ignore[arg-type]
    with pytest.raises(StoreError):
        store.streams.save_pooled(a_reading(), b"state", Reconciled((alert,)))
    assert load_stream_watch(store, 3) is None
    assert list_pooled(store, 3, "hour", *EVER) == ()


def test_what_is_old_goes_but_days_stay(store: Store) -> None:
    for days in (0, 39, 41, 801):
        store.streams.save_window(a_window(-1440 * days))
        store.streams.save_event(an_event(-1440 * days))
        for period in ("hour", "six hours", "day"):
            store.streams.save_pooled(a_reading(-24 * days, period))  # type: ignore[arg-type]
    store.streams.sweep(NOW, 40)
    assert len(list_windows(store, 3, *EVER)) == 2
    assert len(list_stream_events(store, None, EVER[0])) == 3
    periods = ("hour", "six hours", "day")
    counts = [len(list_pooled(store, 3, each, *EVER)) for each in periods]  # type: ignore[arg-type]
    assert counts == [3, 3, 4]


@pytest.mark.parametrize(
    ("hours", "modes", "since", "found"),
    [
        ((0, 1, 2), True, 0, None),
        ((0, 2), True, 0, 1),
        ((0, 2), False, 0, None),  # nothing to pool
        ((0, 2), True, 1.5, None),
        ((0, 1), True, 0, None),  # the latest hour is not over
    ],
)
def test_a_window_whose_hour_was_left_out_is_found(
    file_store: Store, hours: tuple[int, ...], modes: bool, since: float, found: int | None
) -> None:
    streams = file_store.streams
    for hour in range(3):
        streams.save_window(a_window(60 * hour, MODES if modes else ()))
    for hour in hours:
        streams.save_pooled(a_reading(hour))
    expected = None if found is None else NOW + timedelta(hours=found)
    assert find_first_unpooled(file_store, "h3", NOW + timedelta(hours=since)) == expected
    assert find_first_unpooled(file_store, "h4", NOW) is None


def test_the_watch_goes_back_to_a_day_before(file_store: Store) -> None:
    streams = file_store.streams
    assert load_stream_watch(file_store, 3) is load_stream_watch(file_store, 3, NOW) is None
    for day in range(3):
        streams.save_pooled(a_reading(24 * day), b"day %d" % day)
    end = [NOW + timedelta(days=day, hours=1) for day in range(3)]
    assert load_stream_watch(file_store, 3) == StreamWatchCheckpoint(end[2], b"day 2")
    assert load_stream_watch(file_store, 3, end[1]) == StreamWatchCheckpoint(end[1], b"day 1")
    assert load_stream_watch(file_store, 3, end[1] - timedelta(seconds=1)) == StreamWatchCheckpoint(
        end[0], b"day 0"
    )
    assert load_stream_watch(file_store, 3, end[0] - timedelta(seconds=1)) is None
    assert load_stream_watch(file_store, 4, end[2]) is None
    streams.go_back(3, end[1], b"anew")
    assert load_stream_watch(file_store, 3) == StreamWatchCheckpoint(end[1], b"anew")
    assert load_stream_watch(file_store, 3, end[2]) == StreamWatchCheckpoint(end[1], b"day 1")
