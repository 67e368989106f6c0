"""Which shifts of which hangers are compared over the bridge."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from shm.pipeline.bridge_reporting import hanger_shifts, latest_drifts
from shm.store import Baseline, IdentifiedTest, Lineage, Store, StoredTest
from shm.values import NAN, Selection
from tests.helpers.nouns import NOW, a_drift, a_file, a_posterior, a_test, a_watched_test

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")
WARMER_K = 3.0


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.create(tmp_path / "shm.db") as store:
        yield store


def identified(store: Store, hanger: int, number: int, temperature_c: float) -> StoredTest:
    recording = store.recordings.receive(a_file(100 * hanger + number), NOW).recording
    made = a_test(f"t{number}", days=number, hanger=hanger, temperature_c=temperature_c)
    store.tests.save(recording.id, [IdentifiedTest(made)], LINEAGE, NOW)
    return store.tests.named(hanger, made.id)


def begun(store: Store, hanger: int, temperature_c: float) -> Baseline:
    first = identified(store, hanger, 1, temperature_c)
    ranked = Selection((a_posterior(tests=(first.test.id,)),), (1.0,))
    store.posteriors.save_selection(hanger, [first], ranked, LINEAGE, NOW)
    baseline = store.watch.baseline(hanger)
    assert baseline is not None
    return baseline


def watched(store: Store, baseline: Baseline, number: int, shift_mean: float) -> None:
    test = identified(store, baseline.hanger, number, 11.5 + WARMER_K)
    name = test.test.id
    store.posteriors.save(test, a_posterior(tests=(name,), seed=number), LINEAGE, NOW)
    drift = replace(a_drift(name), hanger=test.hanger, time=test.time, shift_mean=shift_mean)
    found = replace(
        a_watched_test(name), drifts=(drift,), time=test.time, temperature_c=test.test.temperature_c
    )
    store.watch.save(test, baseline, found, None, (), NOW)


def test_the_change_of_temperature_is_that_from_the_baselines_tests(store: Store) -> None:
    for hanger, temperature_c in ((3, 11.5), (4, NAN), (5, 11.5)):
        watched(store, begun(store, hanger, temperature_c), 2, -0.08)
    begun(store, 6, 11.5)
    found = hanger_shifts(store, (5, 4, 6, 3))
    assert [(each.hanger, each.place) for each in found] == [(5, 0), (4, 1), (3, 3)]
    changes = [each.temperature_change_k for each in found]
    assert changes[::2] == [WARMER_K, WARMER_K]
    assert math.isnan(changes[1])
    assert found == hanger_shifts(store, (5, 4, 6, 3))


def test_where_the_latest_shift_is_unknown_the_one_before_counts(store: Store) -> None:
    baseline = begun(store, 3, 11.5)
    for number, shift_mean in ((2, -0.08), (3, -0.06), (4, NAN)):
        watched(store, baseline, number, shift_mean)
    (shift,) = hanger_shifts(store, (3,))
    assert shift.shift_n == -0.06 * shift.baseline_n
    (drift,) = latest_drifts(store, 3)
    assert (drift.test, math.isnan(drift.shift_mean)) == ("t4", True)
