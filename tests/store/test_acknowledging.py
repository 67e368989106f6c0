"""What people make of the watch: an alert is taken note of once, a baseline is set anew."""

from __future__ import annotations

import sqlite3
from datetime import datetime, timedelta

import pytest
import sqlalchemy as sa

from shm.errors import StoreBusy, UsageError
from shm.store import (
    Adoption,
    Baseline,
    IdentifiedTest,
    Lineage,
    Store,
    StoredTest,
)
from shm.store.tables import baselines, posteriors
from shm.values import Selection
from tests.helpers.nouns import NOW, a_file, a_posterior, a_test, a_watched_test, an_alert

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")
LATER = NOW + timedelta(days=30)
MASS = "beam1+point_mass@everywhere"


@pytest.fixture
def watched(store: Store) -> list[StoredTest]:
    """Four tests a day apart: the first made the baseline, the second raised an alert."""
    for number in range(4):
        recording = store.recordings.receive(a_file(number), NOW).recording
        found = IdentifiedTest(a_test(f"t{number}", days=number))
        store.tests.save(recording.id, [found], LINEAGE, NOW)
    first, *later = store.tests.list_all()
    store.posteriors.save_selection(3, [first], Selection((a_posterior(),), (1.0,)), LINEAGE, NOW)
    for test in later:
        name = test.test.id
        alert = an_alert(test="t1") if name == "t1" else None
        store.posteriors.save(test, a_posterior(tests=(name,)), LINEAGE, NOW)
        store.watch.save(test, baseline(store), a_watched_test(name), alert, ["mail"], NOW)
    return [first, *later]


def baseline(store: Store, time: datetime | None = None) -> Baseline:
    found = store.watch.baseline(3, time=time)
    assert found is not None
    return found


def anew(store: Store, chosen: list[StoredTest], model: str = "beam1") -> Baseline:
    names = tuple(test.test.id for test in chosen)
    record = ("engineer", "new pin", chosen[0].time)
    posterior = a_posterior(model, names, seed=9)
    return store.watch.rebaseline(baseline(store), posterior, chosen, record, LINEAGE, LATER)


def rows(store: Store) -> list[int]:
    with store.reading() as connection:
        return [
            connection.execute(sa.select(sa.func.count()).select_from(table)).scalar_one()
            for table in (posteriors, baselines)
        ]


def adopted(store: Store, first: StoredTest) -> int:
    before = store.posteriors.selection(3)
    assert before is not None
    made = Adoption(3, MASS, "beam1", "point_mass", "everywhere", "a lamp", "engineer")
    probabilities = {"beam1": 0.5, MASS: 0.5}
    return store.posteriors.adopt(
        made, a_posterior(MASS, ("t0",)), probabilities, (before, [first]), LINEAGE, NOW
    ).id


# ---------------------------------------------------------------- alerts


def test_an_alert_is_acknowledged_once(store: Store, watched: list[StoredTest]) -> None:
    store.alerts.acknowledge(1, "Jansen", "pin replaced", LATER)
    with pytest.raises(UsageError, match="by Jansen on 2026-05-31 already"):
        store.alerts.acknowledge(1, "Smit", "me too", LATER)
    (stored,) = store.alerts.list_all()
    assert stored.acknowledgement is not None
    assert stored.acknowledgement.who == "Jansen"


# ---------------------------------------------------------------- baselines


def test_a_baseline_set_anew_is_in_force_with_who_when_why_and_since(
    store: Store, watched: list[StoredTest]
) -> None:
    made, found = anew(store, watched[2:]), baseline(store)
    assert found.id == made.id
    assert (found.who, found.why, found.since, found.set_at) == (
        "engineer", "new pin", watched[2].time, LATER,
    )  # fmt: skip
    assert found.posterior.tests == ("t2", "t3")


def test_a_baseline_computed_while_another_came_in_is_refused_whole(
    store: Store, watched: list[StoredTest]
) -> None:
    before = baseline(store)
    anew(store, watched[2:])
    held, record = rows(store), ("Smit", "late", watched[3].time)
    with pytest.raises(StoreBusy):
        store.watch.rebaseline(before, a_posterior(), watched[3:], record, LINEAGE, LATER)
    assert rows(store) == held


def test_a_baseline_of_an_adopted_class_goes_when_the_adoption_is_dropped(
    store: Store, watched: list[StoredTest]
) -> None:
    first = baseline(store)
    adoption = adopted(store, watched[0])
    made = anew(store, watched[2:], MASS)
    assert baseline(store).id == made.id
    store.posteriors.drop_adoption(adoption, "the lamp is gone", "engineer", LATER)
    assert baseline(store).id == first.id
    assert anew(store, watched[3:]).id == baseline(store).id


def test_a_baseline_cut_short_leaves_nothing_behind(
    store: Store, watched: list[StoredTest], monkeypatch: pytest.MonkeyPatch
) -> None:
    from shm.store import watch

    held = rows(store)
    for verb in ("insert_posterior", "insert_baseline"):
        keep = getattr(watch, verb)

        def cut(*arguments, keep=keep):  # type: ignore[no-untyped-def]
            keep(*arguments)
            raise sqlite3.OperationalError("cut short")

        with monkeypatch.context() as patched:
            patched.setattr(watch, verb, cut)
            with pytest.raises(sqlite3.OperationalError):
                anew(store, watched[2:])
        assert rows(store) == held
