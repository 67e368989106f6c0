"""Which class and which baseline are in force: adopted, dropped, set anew; all of it or nothing."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest

from shm.errors import StoreBusy, UsageError
from shm.store import Adoption, Baseline, Store, StoredAdoption, StoredTest, posteriors, watch
from shm.store import tables as t
from shm.store.posteriors import list_history
from shm.store.watch import list_adoptions, list_selected_models
from tests.helpers.entering import (
    LINEAGE,
    assert_all_or_nothing,
    baseline_of,
    count_rows,
    four_tests,
    identified,
    selected,
    updated,
)
from tests.helpers.entering import watch as watched
from tests.helpers.nouns import NOW, a_posterior, an_alert

LATER = NOW + timedelta(days=30)
MASS = "beam1+point_mass@everywhere"
STIFF = "beam1+bending_stiffness@everywhere"
PROBABILITIES = {"beam2": 0.5, "beam1": 0.2, MASS: 0.3, STIFF: 0.1}
TABLES = (t.adoptions, t.posteriors, t.selections, t.baselines)


@pytest.fixture
def two(store: Store) -> Store:
    """Two tests: the first made the baseline in beam2, the second was updated."""
    first, second = identified(store, 1), identified(store, 2)
    selected(store, [first], a_posterior("beam2"), a_posterior("beam1"))
    updated(store, second, model="beam2")
    return store


@pytest.fixture
def four(store: Store) -> list[StoredTest]:
    """The first made the baseline, the second raised an alert."""
    tests = four_tests(store)
    for number, test in enumerate(tests[1:], start=1):
        watched(store, test, an_alert(test="t1") if number == 1 else None, "mail")
    return tests


def adopted(store: Store, model: str = MASS) -> StoredAdoption:
    before = store.posteriors.selection(3)
    assert before is not None
    made = Adoption(3, model, "beam1", "point_mass", "everywhere", "a lamp", "engineer", 2.3, 0.6)
    basis = (before, store.tests.list_all(3)[:1])
    names = tuple(test.test.id for test in basis[1])
    posterior = a_posterior(model, names)
    return store.posteriors.adopt(made, posterior, PROBABILITIES, basis, LINEAGE, NOW)


def anew(store: Store, chosen: list[StoredTest], model: str = "beam1") -> Baseline:
    names = tuple(test.test.id for test in chosen)
    record = ("engineer", "new pin", chosen[0].time)
    posterior = a_posterior(model, names, seed=9)
    return store.watch.rebaseline(baseline_of(store), posterior, chosen, record, LINEAGE, LATER)


def test_dropping_an_adoption_restores_what_was_in_force(two: Store) -> None:
    before, made = two.posteriors.selection(3), adopted(two)
    dropped = two.posteriors.drop_adoption(made.id, "taken off", "inspector", NOW)
    assert (dropped.undone_at, dropped.undone_why, dropped.undone_who) == (
        NOW, "taken off", "inspector",
    )  # fmt: skip
    after = two.posteriors.selection(3)
    assert before is not None
    assert after is not None
    assert (after.id, after.model) == (before.id, "beam2")
    assert baseline_of(two).posterior.model == "beam2"
    history = [(test.test.id, posterior.model) for test, posterior in list_history(two, 3)]
    assert history == [("t1", "beam2"), ("t2", "beam2")]
    assert (list_adoptions(two), list_adoptions(two, undone=True)) == ((), (dropped,))


def test_a_baseline_of_an_adopted_class_goes_when_the_adoption_is_dropped(
    store: Store, four: list[StoredTest]
) -> None:
    first, adoption = baseline_of(store), adopted(store)
    made = anew(store, four[2:], MASS)
    assert baseline_of(store).id == made.id
    store.posteriors.drop_adoption(adoption.id, "the lamp is gone", "engineer", LATER)
    assert baseline_of(store).id == first.id
    assert anew(store, four[3:]).id == baseline_of(store).id


def test_what_was_computed_while_another_came_in_is_refused_whole(
    store: Store, four: list[StoredTest]
) -> None:
    selection, baseline = store.posteriors.selection(3), baseline_of(store)
    assert selection is not None
    adopted(store)
    anew(store, four[2:], MASS)
    held = count_rows(store, TABLES)
    made = replace(list_adoptions(store)[0].adoption, model=STIFF)
    late, record = (selection, four[:1]), ("Smit", "late", four[3].time)
    with pytest.raises(StoreBusy):
        store.posteriors.adopt(made, a_posterior(STIFF), PROBABILITIES, late, LINEAGE, NOW)
    with pytest.raises(StoreBusy):
        store.watch.rebaseline(baseline, a_posterior(), four[3:], record, LINEAGE, LATER)
    assert count_rows(store, TABLES) == held


def test_what_is_cut_short_leaves_nothing_behind(store: Store, four: list[StoredTest]) -> None:
    verbs = ("insert_posterior", "insert_selection", "insert_baseline", "insert")
    assert_all_or_nothing(store, posteriors, verbs, lambda: adopted(store), TABLES)
    assert list_selected_models(store) == {3: "beam1"}
    assert_all_or_nothing(store, watch, verbs[::2], lambda: anew(store, four[2:]), TABLES)


def test_a_baseline_set_anew_is_in_force_with_who_when_why_and_since(
    store: Store, four: list[StoredTest]
) -> None:
    made, found = anew(store, four[2:]), baseline_of(store)
    assert found.id == made.id
    assert (found.who, found.why, found.since, found.set_at) == (
        "engineer", "new pin", four[2].time, LATER,
    )  # fmt: skip
    assert found.posterior.tests == ("t2", "t3")


def test_an_alert_is_acknowledged_once(store: Store, four: list[StoredTest]) -> None:
    store.alerts.acknowledge(1, "Jansen", "pin replaced", LATER)
    with pytest.raises(UsageError, match="by Jansen on 2026-05-31 already"):
        store.alerts.acknowledge(1, "Smit", "me too", LATER)
    (stored,) = store.alerts.list_all()
    assert stored.acknowledgement is not None
    assert stored.acknowledgement.who == "Jansen"
