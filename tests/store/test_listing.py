"""Lists say what the full answers say, in few questions."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import timedelta

import pytest
import sqlalchemy as sa

from shm.errors import NothingThere
from shm.store import Baseline, Stage, Store, StoredAlert, StoredWatch
from shm.store.alerts import (
    count_alerts,
    count_open_alerts,
    list_alert_page,
    resolve,
)
from shm.store.tests import find_neighbours, list_test_rows
from shm.store.watch import find_latest_watches
from tests.helpers.entering import identified, selected, updated
from tests.helpers.nouns import NOW, a_change, a_watched_test, an_alert


def with_baseline(store: Store, number: int, hanger: int) -> Baseline:
    return selected(store, [identified(store, number, hanger=hanger)])


def watched(store: Store, baseline: Baseline, number: int, evidence_years: float = 1.0) -> None:
    test = updated(store, identified(store, number, hanger=baseline.hanger), number)
    name = test.test.id
    found = replace(a_watched_test(name), change=a_change(evidence_years=evidence_years))
    alert = replace(an_alert(), key=f"alert {number}", hanger=baseline.hanger, test=name)
    store.watch.save(test, baseline, replace(found, time=test.time), alert, ["mail"], NOW)


@contextmanager
def questions(store: Store) -> Iterator[list[str]]:
    """What is asked of the database."""
    asked: list[str] = []

    def note(*arguments: object) -> None:
        asked.append(str(arguments[2]))

    sa.event.listen(store.engine, "before_cursor_execute", note)
    yield asked
    sa.event.remove(store.engine, "before_cursor_execute", note)


def latest_of_each(watches: tuple[StoredWatch, ...]) -> dict[int, int]:
    return {each.hanger: each.id for each in watches}


def test_neighbours_of_a_test_are_of_its_hanger_by_time(file_store: Store) -> None:
    """Not by when they came, and at one time by when they came."""
    last, first, also_first = (
        identified(file_store, n, days=days, name=name)
        for n, days, name in ((1, 9, "last"), (2, 2, "first"), (3, 2, "also first"))
    )
    identified(file_store, 4, days=5, hanger=4)
    assert find_neighbours(file_store, first) == (None, "also first")
    assert find_neighbours(file_store, also_first) == ("first", "last")
    assert find_neighbours(file_store, last) == ("also first", None)


def test_what_was_superseded_or_refused_is_not_listed(file_store: Store) -> None:
    first, second = identified(file_store, 1), identified(file_store, 2)
    file_store.recordings.rerun(first.recording_id, Stage.IDENTIFIED, NOW)
    file_store.recordings.refuse(second.recording_id, {"message": "no."}, NOW, [second.id])
    assert list_test_rows(file_store, 3) == ()
    with pytest.raises(NothingThere):
        file_store.tests.named(3, "t1")


def test_the_latest_watches_are_those_of_each_hanger_in_few_questions(store: Store) -> None:
    for hanger in range(3, 8):
        baseline = with_baseline(store, 10 * hanger, hanger)
        for number in (1, 2):
            watched(store, baseline, 10 * hanger + number)
    expected = latest_of_each(store.watch.list_all())
    with questions(store) as asked:
        found = find_latest_watches(store)
    assert {hanger: each.id for hanger, each in found.items()} == expected
    assert found[3].watched.drifts == store.watch.list_all(3)[-1].watched.drifts != ()
    assert sum("SELECT" in text for text in asked) == 3


def test_a_resolved_alert_is_open_no_more_whoever_took_note(store: Store) -> None:
    raise_alerts(store)
    with store.engine.begin() as connection:
        resolve(connection, 2, "shm", "two visits agree", NOW)
        resolve(connection, 6, "shm", "two visits agree", NOW + timedelta(days=2))
    store.alerts.acknowledge(3, "engineer", "seen", NOW + timedelta(days=1))
    assert count_open_alerts(store) == {3: 2, 4: 1}
    assert count_alerts(store) == (3, 1)
    opened, others = (list_alert_page(store, is_open=each) for each in (True, False))
    assert numbers(opened) == [5, 4, 1]
    assert numbers(others) == [6, 3, 2]
    assert numbers(list_alert_page(store, is_open=False, before=6)) == [3, 2]
    assert numbers(list_alert_page(store, is_open=False, before=3)) == [2]
    assert [each.id for each in store.alerts.list_all() if each.is_open] == [1, 4, 5]


def raise_alerts(store: Store) -> None:
    """Alerts 1 to 4 of hanger 3, then 5 and 6 of hanger 4."""
    for hanger, count in ((3, 4), (4, 2)):
        baseline = with_baseline(store, 10 * hanger, hanger)
        for number in range(1, count + 1):
            watched(store, baseline, 10 * hanger + number)


def numbers(rows: tuple[StoredAlert, ...]) -> list[int]:
    return [row.id for row in rows]
