"""Tests of a hanger entered into a store stage by stage, as the flow enters them."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from types import ModuleType

import pytest
import sqlalchemy as sa

from shm.store import Baseline, IdentifiedTest, Lineage, Store, StoredAlert, StoredTest
from shm.store import WatchCheckpoint as Checkpoint
from shm.values import Alert, Posterior, Selection
from tests.helpers.nouns import NOW, a_file, a_posterior, a_test, a_watched_test

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")


def identified(
    store: Store,
    number: int,
    *found: IdentifiedTest,
    hanger: int = 3,
    lineage: Lineage = LINEAGE,
    name: str = "",
    days: float | None = None,
    at: datetime = NOW,
) -> StoredTest:
    """Enter a recording; without its tests named it has one, so many days after `NOW`."""
    recording = store.recordings.receive(a_file(number), at).recording
    days = number if days is None else days
    items = found or (IdentifiedTest(a_test(name or f"t{number}", days=days, hanger=hanger)),)
    store.tests.save(recording.id, items, lineage, at)
    return next(test for test in store.tests.list_all() if test.recording_id == recording.id)


def selected(store: Store, tests: Sequence[StoredTest], *ranked: Posterior) -> Baseline:
    """Make the baseline of a hanger from tests; the first of the posteriors is selected."""
    hanger, names = tests[0].hanger, tuple(test.test.id for test in tests)
    posteriors = ranked or (replace(a_posterior("beam1", names), hanger=hanger),)
    probabilities = (0.8, 0.2)[: len(posteriors)] if ranked[1:] else (1.0,)
    selection = Selection(posteriors, probabilities)
    store.posteriors.save_selection(hanger, tests, selection, LINEAGE, NOW)
    return baseline_of(store, hanger)


def updated(
    store: Store, test: StoredTest, seed: int = 1, lineage: Lineage = LINEAGE, model: str = "beam1"
) -> StoredTest:
    posterior = a_posterior(model, (test.test.id,), seed=seed)
    store.posteriors.save(test, replace(posterior, hanger=test.hanger), lineage, NOW)
    return test


def watch(
    store: Store, test: StoredTest, alert: Alert | None = None, *hooks: str, kept: bytes = b""
) -> StoredAlert | None:
    """Compare a test with the baseline; return the alert that is new."""
    found, state = a_watched_test(test.test.id), Checkpoint("a key", test.time, kept)
    against = baseline_of(store, test.hanger)
    raised = store.watch.save(test, against, found, alert, hooks, NOW, state if kept else None)
    return raised[0] if raised else None


def four_tests(store: Store) -> list[StoredTest]:
    """Enter a test that makes the baseline and three that are updated, a day apart."""
    first, *later = [identified(store, number) for number in range(4)]
    selected(store, [first])
    return [first, *(updated(store, test) for test in later)]


def baseline_of(store: Store, hanger: int = 3) -> Baseline:
    found = store.watch.baseline(hanger)
    assert found is not None
    return found


def assert_all_or_nothing(
    store: Store,
    home: ModuleType,
    verbs: Sequence[str],
    act: Callable[[], object],
    tables: Sequence[sa.Table],
) -> None:
    """As by a full disk or a kill after any of the rows that `act` writes."""
    before = count_rows(store, tables)
    for verb in verbs:
        keep = getattr(home, verb)

        def cut(*arguments, keep=keep):  # type: ignore[no-untyped-def]
            keep(*arguments)
            raise sqlite3.OperationalError("cut short")

        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(home, verb, cut)
            with pytest.raises(sqlite3.OperationalError):
                act()
        assert count_rows(store, tables) == before


def count_rows(store: Store, tables: Sequence[sa.Table]) -> list[int]:
    counts = (sa.select(sa.func.count()).select_from(table) for table in tables)
    return [int(store.scalar(count)) for count in counts]
