"""Tests, posteriors, selections: complete when read back, and kept once."""

from __future__ import annotations

import math
from dataclasses import asdict, fields, replace
from datetime import timedelta

import numpy as np
import pytest

from shm.store import IdentifiedTest, Judgement, Stage, Store, StoredTest
from shm.store import tests as judging
from shm.store.blobs import unpack
from shm.store.posteriors import list_history, list_posteriors
from shm.store.tests import list_known_samples, load_frequency_response
from shm.store.watch import list_selected_models
from shm.values import AddedMass, Fingerprint
from tests.helpers.comparing import assert_same
from tests.helpers.entering import LINEAGE, identified, selected
from tests.helpers.nouns import NOW, a_file, a_posterior, a_response, a_test


def baseline_of_two_models(store: Store, *tests: StoredTest) -> None:
    names = tuple(test.test.id for test in tests)
    selected(store, tests, a_posterior("beam2", names), a_posterior("beam1", names))


def test_a_test_comes_back_as_it_was(store: Store) -> None:
    test = a_test(added_mass=AddedMass(25.0, 3.6))
    stored = identified(store, 1, IdentifiedTest(test, 0, None, ("3 poles: too damped",)))
    assert_same(stored.test, test)
    assert math.isnan(stored.test.amplitude)
    assert (stored.time, stored.stage, stored.notes) == (
        test.time,
        Stage.IDENTIFIED,
        ("3 poles: too damped",),
    )
    assert stored.lineage == LINEAGE
    assert stored.key == f"{a_file(1).sha256}/0"
    assert store.recordings.get(stored.recording_id).hanger == 3


def test_frequency_response_every_field(store: Store) -> None:
    """A response and its test come back with every field, of which none has its default here."""
    mass = AddedMass(25.0, 3.6)
    conditions = {"time": NOW, "temperature_c": 11.5, "added_mass": mass, "operator": "Ann"}
    response = replace(a_response(), **conditions)
    measured = {
        "amplitude": 1.2,
        "tension_read_n": 7e5,
        "tension_read_sd_n": 7e3,
        "rattles_above": 3.0,
    }
    test = a_test(**conditions, **measured)
    for value in (response, test):
        for field in fields(value):
            assert repr(getattr(value, field.name)) != repr(field.default), field.name
    stored = identified(store, 1, IdentifiedTest(test, 0, response))
    found = load_frequency_response(store, stored)
    assert found is not None
    single = {
        "accelerance": response.accelerance.astype(np.complex64),
        "coherence": np.asarray(response.coherence, np.float32),
    }
    np.testing.assert_equal(asdict(found), asdict(response) | single)
    np.testing.assert_equal(asdict(stored.test), asdict(test))


def test_two_files_may_call_their_tests_the_same(store: Store) -> None:
    identified(store, 1, IdentifiedTest(a_test("t1")))
    identified(store, 2, IdentifiedTest(a_test("t1")), IdentifiedTest(a_test("t2"), 1))
    suffix = a_file(2).sha256[:8]
    assert [test.test.id for test in store.tests.list_all(3)] == ["t1", f"t1-{suffix}-0", "t2"]


def test_the_most_probable_class_is_selected_and_its_posterior_the_baseline(store: Store) -> None:
    first = identified(store, 1)
    baseline_of_two_models(store, first)
    selection = store.posteriors.selection(3)
    assert selection is not None
    assert selection.selection.selected.model == "beam2"
    assert selection.selection.probabilities == (0.8, 0.2)
    assert list_selected_models(store) == {3: "beam2"}
    baseline = store.watch.baseline(3)
    assert baseline is not None
    assert_same(baseline.posterior, a_posterior("beam2"))
    assert store.tests.get(first.id).stage is Stage.WATCHED
    assert store.recordings.get(first.recording_id).stage is Stage.DONE


def test_several_tests_may_make_one_baseline(store: Store) -> None:
    tests = identified(store, 1), identified(store, 2)
    baseline_of_two_models(store, *tests)
    history = list_history(store, 3)
    assert [test.test.id for test, _ in history] == ["t1", "t2"]
    assert {posterior.tests for _, posterior in history} == {("t1", "t2")}
    assert list_posteriors(store, 3)[0].time == NOW + timedelta(days=2)


def test_a_posterior_comes_back_complete_with_its_samples(store: Store) -> None:
    first = identified(store, 1)
    second = identified(store, 2)
    baseline_of_two_models(store, first)
    posterior = a_posterior("beam2", ("t2",), seed=2**32 - 1)
    store.posteriors.save(second, posterior, LINEAGE, NOW)
    assert_same(store.posteriors.get(3), posterior)
    assert_same(store.posteriors.get(3, "t2"), posterior)
    assert_same(store.posteriors.get(3, second.test.id), posterior)
    assert store.posteriors.get(3, "t1").model == "beam2"
    assert list_posteriors(store, 3)[-1].lineage == LINEAGE
    assert store.tests.get(second.id).stage is Stage.UPDATED
    assert store.recordings.get(second.recording_id).stage is Stage.UPDATED


def test_posterior_of_a_sampler_that_is_gone_is_read(store: Store) -> None:
    """Earlier versions had the thesis's own sampler."""
    first = identified(store, 1)
    posterior = replace(a_posterior("beam2", ("t1",)), method="textbook", priors="thesis")
    selected(store, [first], posterior)
    assert_same(store.posteriors.get(3), posterior)


def test_a_pickled_blob_is_not_read() -> None:
    import io

    buffer = io.BytesIO()
    np.savez(buffer, samples=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ValueError, match="allow_pickle"):
        unpack(buffer.getvalue())


def test_samples_are_compared_with_the_earliest_first_and_always_with_the_same_numbers(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A copy of a copy is one of the original, which is named."""
    prints = [Fingerprint(f"{n:064x}", np.zeros((1, 32), dtype=np.int16)) for n in range(5)]
    for number, print_ in enumerate(prints, 1):
        recording = store.recordings.receive(a_file(number), NOW).recording
        items = [IdentifiedTest(a_test(f"t{number}", days=number))]
        store.tests.save(recording.id, items, LINEAGE, NOW, Judgement(None, print_))
    known = [each.fingerprint.digest for each in list_known_samples(store, 5, 3, prints[4])]
    assert known == [each.digest for each in prints[:4]]
    monkeypatch.setattr(judging, "_MOST_COMPARED", 2)
    known = [each.fingerprint.digest for each in list_known_samples(store, 5, 3, prints[0])]
    assert known == [prints[0].digest, prints[3].digest]
