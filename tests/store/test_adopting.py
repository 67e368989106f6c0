"""Diagnoses come back as they were; an adoption changes what is in force, its undoing restores."""

from __future__ import annotations

import sqlite3
from dataclasses import replace

import pytest
import sqlalchemy as sa

from shm.errors import StoreBusy
from shm.store import Adoption, Baseline, IdentifiedTest, Lineage, Store, StoredAdoption
from shm.store.posteriors import list_history
from shm.store.tables import adoptions, baselines, posteriors, selections
from shm.store.watch import list_adoptions, list_selected_models
from shm.values import Selection
from tests.helpers.nouns import NOW, a_file, a_posterior, a_test

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")
MASS = "beam1+point_mass@everywhere"
STIFF = "beam1+bending_stiffness@everywhere"
PROBABILITIES = {"beam2": 0.5, "beam1": 0.2, MASS: 0.3, STIFF: 0.1}


@pytest.fixture
def filled(store: Store) -> Store:
    """Two tests: the first made the baseline in beam2, the second was updated."""
    for number in (1, 2):
        recording = store.recordings.receive(a_file(number), NOW).recording
        found = IdentifiedTest(a_test(f"t{number}", days=number))
        store.tests.save(recording.id, [found], LINEAGE, NOW)
    first, second = store.tests.list_all(3)
    posteriors = (a_posterior("beam2"), a_posterior("beam1"))
    store.posteriors.save_selection(3, [first], Selection(posteriors, (0.8, 0.2)), LINEAGE, NOW)
    store.posteriors.save(second, a_posterior("beam2", ("t2",)), LINEAGE, NOW)
    return store


def adopted(store: Store, model: str = MASS, why: str = "a lamp at 3.4 m") -> StoredAdoption:
    before = store.posteriors.selection(3)
    assert before is not None
    made = Adoption(3, model, "beam1", "point_mass", "everywhere", why, "engineer", 2.3, 0.6)
    chosen = [test for test in store.tests.list_all(3) if test.test.id == "t1"]
    basis = (before, chosen)
    return store.posteriors.adopt(made, a_posterior(model), PROBABILITIES, basis, LINEAGE, NOW)


def baseline(store: Store, model: str | None = None) -> Baseline:
    found = store.watch.baseline(3, model)
    assert found is not None
    return found


def history(store: Store) -> list[tuple[str, str]]:
    return [(test.test.id, posterior.model) for test, posterior in list_history(store, 3)]


def rows(store: Store) -> list[int]:
    with store.reading() as connection:
        count = sa.func.count()
        return [
            connection.execute(sa.select(count).select_from(table)).scalar_one()
            for table in (adoptions, posteriors, selections, baselines)
        ]


def test_dropping_an_adoption_restores_what_was_in_force(filled: Store) -> None:
    before = filled.posteriors.selection(3)
    made = adopted(filled)
    dropped = filled.posteriors.drop_adoption(made.id, "taken off", "inspector", NOW)
    assert (dropped.undone_at, dropped.undone_why, dropped.undone_who) == (
        NOW, "taken off", "inspector",
    )  # fmt: skip
    after = filled.posteriors.selection(3)
    assert before is not None
    assert after is not None
    assert (after.id, after.model) == (before.id, "beam2")
    assert baseline(filled).posterior.model == "beam2"
    assert history(filled) == [("t1", "beam2"), ("t2", "beam2")]
    assert list_adoptions(filled) == ()
    assert list_adoptions(filled, undone=True) == (dropped,)


def test_an_adoption_computed_from_a_selection_no_longer_in_force_is_refused_whole(
    filled: Store,
) -> None:
    before = filled.posteriors.selection(3)
    assert before is not None
    adopted(filled)
    held = rows(filled)
    made = replace(list_adoptions(filled)[0].adoption, model=STIFF)
    late = (before, filled.tests.list_all(3)[:1])
    with pytest.raises(StoreBusy):
        filled.posteriors.adopt(made, a_posterior(STIFF), PROBABILITIES, late, LINEAGE, NOW)
    assert rows(filled) == held


def test_an_adoption_cut_short_leaves_nothing_behind(
    filled: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by a full disk or a kill between any two of its rows: all or nothing."""
    from shm.store import posteriors

    held = rows(filled)
    for verb in ("insert_posterior", "insert_selection", "insert_baseline", "insert"):
        keep = getattr(posteriors, verb)

        def cut(*arguments, keep=keep):  # type: ignore[no-untyped-def]
            keep(*arguments)
            raise sqlite3.OperationalError("cut short")

        with monkeypatch.context() as patched:
            patched.setattr(posteriors, verb, cut)
            with pytest.raises(sqlite3.OperationalError):
                adopted(filled)
        assert rows(filled) == held
        assert list_selected_models(filled) == {3: "beam2"}
