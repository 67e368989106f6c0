"""An adopted effect is in the hanger's class from the next test on; dropping it restores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shm.inference import UpdateOptions
from shm.models import Model
from shm.pipeline import adopting, steps
from shm.pipeline.adopting import AdoptionRequest, adopt, gap_watch
from shm.store import Store, StoredAdoption, Workspace
from shm.store.posteriors import list_history
from shm.values import ModalTest, Posterior, PredictedFrequency
from tests.helpers import quick_update
from tests.helpers.diagnoses import MASS, a_diagnosis
from tests.helpers.entering import LINEAGE
from tests.helpers.flows import Postman, ingest
from tests.helpers.workspaces import START, make_workspace, write_test

MASS_MODEL = "beam1+point_mass@everywhere"
_UPDATE = quick_update.update
STIFFNESS = "beam1+bending_stiffness@everywhere"


def spool(workspace: Workspace, name: str, **values: float) -> None:
    write_test(workspace.spool / f"{name}.modes.json", workspace, **values)  # type: ignore[arg-type]


def quick(
    tests: Sequence[ModalTest], model: Model, options: UpdateOptions, *_: Any, **__: Any
) -> Posterior:
    """The stand-in for the sampler; adopted classes predict 0.2 % off, others 2 %."""
    found = _UPDATE(tests, model, options)
    off = 1.002 if "+" in model.name else 1.02
    predicted = tuple(
        PredictedFrequency(m.plane, m.order, m.frequency_hz * off, 0.01, m.frequency_hz)
        for test in tests
        for m in test.modes
    )
    return replace(found, predicted=predicted)


@pytest.fixture(autouse=True)
def _quick_gaps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adopting, "update", quick)
    monkeypatch.setattr(quick_update, "update", quick)
    monkeypatch.setattr(
        steps, "refresh", lambda tests, model, known, options: quick(tests, model, options)
    )


@pytest.fixture
def begun(workspace: Workspace) -> Workspace:
    """One test in beam1, which is the baseline."""
    spool(workspace, "t1")
    ingest(workspace)
    return workspace


def wish(
    *effects: str, at: Sequence[str] = (), baseline: str = "", why: str = "a lamp"
) -> AdoptionRequest:
    return AdoptionRequest(effects, tuple(at), baseline, why, "engineer")


def adopted(workspace: Workspace, *effects: str, at: Sequence[str] = ()) -> StoredAdoption:
    hanger = workspace.bridge.hanger(3)
    with workspace.store() as store:
        return adopt(workspace, store, hanger, wish(*effects, at=at), START)


def models(store: Store) -> dict[str, str]:
    return {test.test.id: posterior.model for test, posterior in list_history(store, 3)}


def test_the_next_test_uses_the_adopted_class_and_its_baseline(begun: Workspace) -> None:
    made = adopted(begun, "point_mass")
    assert made.adoption.model == MASS_MODEL
    assert made.adoption.gap_percent == pytest.approx(0.2)
    for number in (2, 3):
        spool(begun, f"t{number}", day=30 * number, tension=0.8)
    ingest(begun)
    with begun.store() as store:
        assert models(store) == dict.fromkeys(("t1", "t2", "t3"), MASS_MODEL)
        drift = store.watch.list_drifts(3)[-1]
        assert (drift.test, drift.quantity) == ("t3", "tension")
        assert drift.shift_mean == pytest.approx(-0.2, abs=0.03)
        baseline, selection = store.watch.baseline(3), store.posteriors.selection(3)
        assert baseline is not None
        assert (baseline.posterior.tests, baseline.why) == (
            ("t1",),
            f"adopted {MASS_MODEL}: a lamp",
        )
        assert selection is not None
        assert {p.model for p in selection.selection.posteriors} == {"beam1", MASS_MODEL}
        assert sum(selection.selection.probabilities) == pytest.approx(1)


def test_dropping_it_restores_class_and_baseline_for_the_next_test(begun: Workspace) -> None:
    made = adopted(begun, "point_mass")
    spool(begun, "t2", day=1)
    ingest(begun)
    with begun.store() as store:
        store.posteriors.drop_adoption(made.id, "taken off", "engineer", START)
    spool(begun, "t3", day=2)
    ingest(begun)
    with begun.store() as store:
        assert models(store) == {"t1": "beam1", "t2": MASS_MODEL, "t3": "beam1"}
        assert [drift.test for drift in store.watch.list_drifts(3)] == ["t2", "t3"]
        assert store.alerts.list_all() == ()
        assert gap_watch(store, 3) is None


def test_a_gap_that_opens_again_is_one_alert(
    begun: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    adopted(begun, "point_mass")

    def opened(tests, model, known, options):  # type: ignore[no-untyped-def]
        found = quick(tests, model, options)
        rows = [replace(row, mean_hz=1.01 * row.measured_hz) for row in found.predicted]
        return replace(found, predicted=tuple(rows))

    monkeypatch.setattr(steps, "refresh", opened)
    for day in (1, 2):
        spool(begun, f"t{day + 1}", day=day)
    postman = Postman()
    ingest(begun, notifier=postman)
    with begun.store() as store:
        (stored,) = store.alerts.list_all()
        watch = gap_watch(store, 3)
    assert stored.alert.key.startswith("hanger-3:gap-up:baseline-")
    assert "1.00 % off the measured ones, 0.20 % when it was adopted" in stored.alert.message
    assert [key for _, key in postman.told] == [stored.alert.key]
    assert watch is not None
    assert str(watch).endswith("1.00 % now, grown: diagnose it again.")


def test_the_likeliest_place_and_the_baseline_come_from_the_diagnosis(begun: Workspace) -> None:
    ends = replace(MASS, effect="effective_length", at="arch end", parameters=())
    pair = replace(MASS, effect="sag + effective_length", at="everywhere, transverse + both ends")
    found = replace(a_diagnosis(causes=(MASS, ends, pair)), baseline="beam2")
    with begun.store() as store:
        stored = store.posteriors.save_diagnosis(3, found, LINEAGE, START)
    made = adopted(begun, "effective_length")
    assert made.adoption.model == "beam2+effective_length@arch_end"
    assert made.adoption.diagnosis_id == stored.id
    both = adopted(begun, "effective_length", "sag")
    assert both.adoption.model == "beam2+effective_length@both_ends+sag@everywhere.transverse"


def test_without_a_diagnosis_the_baseline_is_the_class_of_the_hanger(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "other", settings={"models": "beam2"})
    spool(workspace, "t1")
    ingest(workspace)
    made = adopted(workspace, "point_mass").adoption
    assert (made.baseline_model, made.diagnosis_id) == ("beam2", None)


@pytest.mark.slow
@pytest.mark.usefixtures("real_sampler")
def test_adopting_with_the_real_sampler_closes_the_gap(
    begun: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    from shm.inference import update

    monkeypatch.setattr(adopting, "update", update)
    made = adopted(begun, "bending_stiffness", at=["everywhere"])
    assert made.adoption.model == STIFFNESS
    assert made.adoption.gap_percent < 0.05
