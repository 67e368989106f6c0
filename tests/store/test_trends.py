"""Years of tests in numbers: what is answered without samples is what the samples say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from datetime import datetime

import pytest
import sqlalchemy as sa

import shm.store.posteriors as stored
from shm.models import described, end_stiffness
from shm.store import (
    Adoption,
    Numbers,
    Stage,
    Store,
    StoredTest,
    TrendPoint,
)
from shm.store.posteriors import (
    find_latest_trends,
    list_baselines_in_force,
    list_history,
    list_trend,
)
from shm.store.tables import posteriors
from shm.values import Hanger, Limits, Posterior, Selection, Summary
from shm.values.stated_tension import averaged_now
from tests.helpers.entering import LINEAGE, identified, selected
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import posterior as modelled
from tests.helpers.nouns import NOW, a_posterior
from tests.helpers.slow import few_of

SPRUNG = [1.0, 0.98, 7.0, 7.4, 7.2, 7.1]
Told = tuple[str, tuple[datetime, datetime | None, float], str, Numbers]
ANOTHER = replace(HANGER_3, id=4)


def a_sprung(test: str, tension: float = 1.0) -> Posterior:
    return replace(modelled([tension, *SPRUNG[1:]]), tests=(test,))


def begun(store: Store, number: int = 1, hanger: int = 3) -> StoredTest:
    """The first test of a hanger: two classes compete, the sprung one is selected."""
    first = identified(store, number, hanger=hanger)
    selected(store, [first], a_sprung(first.test.id), a_posterior("beam1", (first.test.id,)))
    return first


def updated(store: Store, number: int, tension: float, hanger: int = 3) -> StoredTest:
    test = identified(store, number, hanger=hanger)
    store.posteriors.save(test, a_sprung(test.test.id, tension), LINEAGE, NOW)
    return test


def from_history(store: Store, hanger: Hanger) -> list[Told]:
    found = store.posteriors.selection(hanger.id)
    selection = found.selection if found else None
    return [
        (
            stored.test.id,
            (stored.time, stored.test.time, stored.test.temperature_c),
            posterior.model,
            in_numbers(posterior, hanger, selection),
        )
        for stored, posterior in list_history(store, hanger.id)
    ]


def in_numbers(posterior: Posterior, hanger: Hanger, selection: Selection | None) -> Numbers:
    stiffness = end_stiffness(posterior, hanger)
    most_probable = dict(zip(posterior.names, posterior.most_probable, strict=True))
    return Numbers(
        tension_n=Summary.of(posterior.tension_n),
        most_probable_tension_n=most_probable["theta_F"] * posterior.nominal_tension_n,
        stiffness={name: Summary.of(samples) for name, samples in stiffness.items()},
        parameters={name: Summary.of(posterior.parameter(name)) for name in posterior.names},
        averaged=averaged_now(posterior, selection, hanger.limits),
    )


def numbers_of(point: TrendPoint) -> Numbers:
    return Numbers(**{field.name: getattr(point, field.name) for field in fields(Numbers)})


def from_trend(store: Store, hanger: Hanger) -> list[Told]:
    return [
        (
            point.test,
            (point.time, point.taken_at, point.temperature_c),
            point.model,
            numbers_of(point),
        )
        for point in list_trend(store, hanger)
    ]


def without_samples(store: Store) -> None:
    """What is read from now on is not made from samples."""
    with store.writing() as connection:
        connection.execute(sa.update(posteriors).values(samples=b"no npz"))


def sent_back(store: Store) -> None:
    store.recordings.rerun(store.tests.list_all(3)[1].recording_id, Stage.UPDATED, NOW)


def sent_back_and_done_again(store: Store) -> None:
    sent_back(store)
    store.posteriors.save(store.tests.list_all(3)[1], a_sprung("t2", 0.8), LINEAGE, NOW)


def refused(store: Store) -> None:
    test = store.tests.list_all(3)[1]
    store.recordings.refuse(test.recording_id, {"message": "no."}, NOW, [test.id])


def adopted(store: Store) -> None:
    before = store.posteriors.selection(3)
    assert before is not None
    model = "beam2+point_mass@everywhere"
    adoption = Adoption(3, model, "beam2", "point_mass", "everywhere", "a lamp", "engineer")
    probable = {"beam1": 0.1, "beam2": 0.4, model: 0.5}
    chosen = [store.tests.list_all(3)[0]]
    prior = described(model, HANGER_3).prior
    posterior = replace(modelled(list((prior.lower + prior.upper) / 2), model), tests=("t1",))
    store.posteriors.adopt(adoption, posterior, probable, (before, chosen), LINEAGE, NOW)


def undone(store: Store) -> None:
    adopted(store)
    store.posteriors.drop_adoption(1, "the lamp is gone", "engineer", NOW)


def rebaselined(store: Store) -> None:
    baseline = store.watch.baseline(3)
    assert baseline is not None
    chosen = list(store.tests.list_all(3)[1:])
    record = ("engineer", "new pin", chosen[0].time)
    joint = replace(a_sprung("t3", 0.9), tests=tuple(test.test.id for test in chosen))
    store.watch.rebaseline(baseline, joint, chosen, record, LINEAGE, NOW)


HAPPENINGS = (sent_back, sent_back_and_done_again, refused, adopted, undone, rebaselined)


@pytest.mark.parametrize("happened", few_of(HAPPENINGS, 5), ids=lambda each: each.__name__)
def test_the_trend_is_what_the_history_says(
    store: Store, happened: Callable[[Store], None]
) -> None:
    begun(store)
    updated(store, 2, 0.95)
    updated(store, 3, 0.9)
    happened(store)
    expected = from_history(store, HANGER_3)
    assert 2 <= len(expected) <= 3
    assert from_trend(store, HANGER_3) == expected
    store.posteriors.save_summaries(HANGER_3)
    without_samples(store)
    assert from_trend(store, HANGER_3) == expected
    (latest,) = find_latest_trends(store, [HANGER_3]).values()
    assert latest == list_trend(store, HANGER_3)[-1]


@pytest.mark.parametrize("happened", HAPPENINGS, ids=lambda each: each.__name__)
def test_the_baselines_in_force_are_those_of_each_hanger(
    file_store: Store, happened: Callable[[Store], None]
) -> None:
    begun(file_store)
    updated(file_store, 2, 0.95)
    updated(file_store, 3, 0.9)
    begun(file_store, 4, hanger=4)
    happened(file_store)
    found = list_baselines_in_force(file_store, [HANGER_3, ANOTHER])
    assert list(found) == [3, 4]
    for hanger, glance in found.items():
        baseline = file_store.watch.baseline(hanger)
        assert baseline is not None
        assert (glance.id, glance.who, glance.why) == (baseline.id, baseline.who, baseline.why)
        assert (glance.since, glance.tests) == (baseline.since, baseline.posterior.tests)
        assert glance.temperature_c == 11.5
        assert glance.tension_n == Summary.of(baseline.posterior.tension_n)


def test_only_what_is_not_kept_is_made_from_samples(
    file_store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun(file_store)
    assert file_store.posteriors.save_summaries(HANGER_3) == 1
    assert file_store.posteriors.save_summaries(HANGER_3) == 0
    updated(file_store, 2, 0.95)
    made: list[tuple[str, ...]] = []
    summarised = stored.summarised

    def noted(posterior: Posterior, hanger: Hanger, selection: Selection | None) -> Numbers:
        made.append(posterior.tests)
        return summarised(posterior, hanger, selection)

    with monkeypatch.context() as patched:
        patched.setattr(stored, "summarised", noted)
        assert [point.test for point in list_trend(file_store, HANGER_3)] == ["t1", "t2"]
    assert made == [("t2",)]
    assert file_store.posteriors.save_summaries(HANGER_3) == 1
    without_samples(file_store)
    assert [point.test for point in list_trend(file_store, HANGER_3)] == ["t1", "t2"]


def test_the_tension_over_all_classes_follows_the_selected_one(file_store: Store) -> None:
    begun(file_store)
    (first,) = list_trend(file_store, HANGER_3)
    found = file_store.posteriors.selection(3)
    assert found is not None
    assert first.averaged == found.selection.averaged_with(HANGER_3.limits)
    updated(file_store, 2, 0.9)
    latest = list_trend(file_store, HANGER_3)[-1]
    ratio = latest.tension_n.mean / first.tension_n.mean
    assert latest.averaged.tension_n.mean == pytest.approx(
        ratio * first.averaged.tension_n.mean, rel=2e-3
    )
    limited = replace(HANGER_3, limits=Limits(tension_max_n=latest.averaged.tension_n.q50))
    assert list_trend(file_store, limited)[-1].averaged.probability_above_limit == pytest.approx(
        0.5, abs=0.02
    )
