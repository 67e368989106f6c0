"""What people make of the watch: an alert is taken note of once, a baseline is set anew."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from datetime import datetime, timedelta

import pytest
import sqlalchemy as sa

from shm.errors import NothingThere, StoreBusy, UsageError
from shm.store import (
    Acknowledgement,
    Adoption,
    Baseline,
    IdentifiedTest,
    Lineage,
    Resolution,
    Store,
    StoredTest,
)
from shm.store.queries.trends import list_history, list_posteriors
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


def test_an_alert_is_open_until_somebody_takes_note(
    store: Store, watched: list[StoredTest]
) -> None:
    (raised,) = store.alerts.list_all()
    assert raised.acknowledgement is None
    noted = store.alerts.acknowledge(raised.id, "Jansen", "pin replaced", LATER)
    assert noted.acknowledgement == Acknowledgement(raised.id, "Jansen", "pin replaced", LATER)
    assert store.alerts.list_all() == store.alerts.list_all(3) == (noted,)
    assert noted.alert == raised.alert


def test_taking_note_stops_no_delivery(store: Store, watched: list[StoredTest]) -> None:
    store.alerts.acknowledge(1, "Jansen", "pin replaced", LATER)
    assert [each.hook for each in store.alerts.list_due_deliveries(LATER, 10)] == ["mail"]


def test_an_alert_is_acknowledged_once(store: Store, watched: list[StoredTest]) -> None:
    store.alerts.acknowledge(1, "Jansen", "pin replaced", LATER)
    with pytest.raises(UsageError, match="by Jansen on 2026-05-31 already"):
        store.alerts.acknowledge(1, "Smit", "me too", LATER)
    (stored,) = store.alerts.list_all()
    assert stored.acknowledgement is not None
    assert stored.acknowledgement.who == "Jansen"


def test_an_unknown_alert_is_said_to_be_so(store: Store, watched: list[StoredTest]) -> None:
    with pytest.raises(NothingThere, match="no alert 7"):
        store.alerts.acknowledge(7, "Jansen", "pin replaced", LATER)


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


def test_what_was_compared_with_the_old_baseline_stays(
    store: Store, watched: list[StoredTest]
) -> None:
    drifts, (alert,) = store.watch.list_drifts(3), store.alerts.list_all(3)
    anew(store, watched[2:])
    assert store.watch.list_drifts(3) == drifts
    resolution = Resolution(alert.id, "engineer", "new baseline: new pin", LATER)
    assert store.alerts.list_all(3) == (replace(alert, resolution=resolution),)


def test_the_tests_of_a_baseline_set_anew_keep_their_own_posteriors(
    store: Store, watched: list[StoredTest]
) -> None:
    before = [posterior.tests for _, posterior in list_history(store, 3)]
    anew(store, watched[2:])
    assert [posterior.tests for _, posterior in list_history(store, 3)] == before
    assert (
        store.posteriors.get(3).tests
        == store.posteriors.get(3, watched[3].test.id).tests
        == ("t3",)
    )
    assert len(list_posteriors(store, 3)) == 4


def test_a_test_of_before_that_day_belongs_to_the_baseline_before(
    store: Store, watched: list[StoredTest]
) -> None:
    first = baseline(store)
    made = anew(store, watched[2:])
    assert baseline(store, watched[1].time).id == first.id
    assert baseline(store, watched[2].time).id == baseline(store, LATER).id == made.id


def test_of_two_baselines_set_anew_the_later_one_holds(
    store: Store, watched: list[StoredTest]
) -> None:
    anew(store, watched[1:])
    second = anew(store, watched[3:])
    assert baseline(store).id == second.id


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
    from shm.store import stored_watch

    held = rows(store)
    for verb in ("insert_posterior", "insert_baseline"):
        keep = getattr(stored_watch, verb)

        def cut(*arguments, keep=keep):  # type: ignore[no-untyped-def]
            keep(*arguments)
            raise sqlite3.OperationalError("cut short")

        with monkeypatch.context() as patched:
            patched.setattr(stored_watch, verb, cut)
            with pytest.raises(sqlite3.OperationalError):
                anew(store, watched[2:])
        assert rows(store) == held
