"""Hold documents, keys, names and scenarios of the watch.

Golden files are by `write_watch_golden.py`. Keys, types, names, kinds and the test of each alert
are compared as they are; numbers, within three standard errors of 500 samples.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from functools import cache
from typing import Any, get_args

import pytest

import shm.watch
from shm import plausibility
from shm.documents import dump
from shm.store.blobs import watch_document, watch_in
from shm.values import Alert, AlertKind, Change, Drift, Fingerprint, WatchedTest
from shm.watch.neighbours import BridgePattern
from tests.contracts import watch_calls as calls
from tests.contracts.golden_files import assert_signature
from tests.contracts.watch_scenarios import SCENARIOS, Scenario, load
from tests.helpers.nouns import a_watched_test, an_alert
from tests.helpers.synthetic_readings import watch_of

SHIFTS = {"shift_mean": 0.13, "shift_sd": 0.1, "value": 0.13, "mean": 0.13, "sd": 0.1}
"""Differences allowed to a shift, in its standard deviations: three errors of 500 samples."""
OF_PROBABILITY = 0.07
"""Three standard errors of a probability of a half by 500 samples."""
TEXTS = {"message", "state", "action", "sentence", "remarks", "why", "alike_cause"}
"""Keys of texts that state numbers: the words are compared, not the numbers."""
UNSETTLED = {"evidence_years", "moved", "sudden", "began_after", "began_by", "alike"}
"""Of what is below the limit: nothing rests on it but that it is there."""


@cache
def made(name: str) -> Any:
    """Return the document of a case of today."""
    return calls.CASES[name]()


def differ(now: Any, before: Any, key: str = "", at: str = "", sd: float = 0.0) -> Iterator[str]:
    """Yield a line for each place where a document differs from the golden one."""
    line = f"{at}: {now!r}, not {before!r}"
    if type(now) is not type(before):
        yield line
    elif isinstance(before, dict):
        if list(now) != list(before):
            yield f"{at}: keys {list(now)}, not {list(before)}"
            return
        # Of a tension the value is in N, of a stiffness in decades as its shift.
        sd = before.get("shift_sd") or before.get("sd") or 0.0
        unit = before.get("baseline", 1.0) if before.get("quantity") == "tension" else 1.0
        called = before.get("evidence_years", 0.0) > before.get("limit_years", 0.0)
        for name, value in before.items():
            if name in UNSETTLED and not called and "evidence_years" in before:
                if type(now[name]) is not type(value):
                    yield f"{at}.{name}: {now[name]!r}"
                continue
            of_unit = unit if name == "value" else 1.0
            yield from differ(now[name], value, name, f"{at}.{name}", (sd or 0.0) * of_unit)
    elif isinstance(before, list):
        if len(now) != len(before):
            yield line
            return
        for index, (one, other) in enumerate(zip(now, before, strict=True)):
            yield from differ(one, other, key, f"{at}[{index}]")
    elif key == "evidence_years":
        return  # on which side of its limit it is, `called` says
    elif isinstance(before, float):
        allowed = 1e-6 + 2e-5 * abs(before)
        if key in SHIFTS and sd:
            allowed = SHIFTS[key] * sd
        elif "probability" in key or key == "sudden":
            allowed = OF_PROBABILITY
        if not abs(now - before) <= allowed:
            yield f"{line}, {abs(now - before):.3g} apart"
    elif key in TEXTS:
        if re.sub(r"[\d.]+", "#", now) != re.sub(r"[\d.]+", "#", before):
            yield line
    elif now != before:
        yield line


# ---------------------------------------------------------------- documents


@pytest.mark.parametrize("name", calls.CASES)
def test_a_document_is_that_of_the_golden_file(name: str) -> None:
    assert list(differ(made(name), calls.golden(name))) == []


def test_golden_files_hold_what_was_planted() -> None:
    """Look at the golden files: a wrong answer would be held for ever."""
    found = {name: calls.golden(name) for name in calls.CASES if name != "bridge"}
    rung = {
        name: [(alert["test"], alert["kinds"]) for alert in each["alerts"]]
        for name, each in found.items()
    }
    assert rung["sound"] == []
    assert rung["disturbed"] == [("t6", ["repeat the test"])]
    assert [kinds for _, kinds in rung["lost"]] == [["beyond threshold", "sudden change"]]
    assert rung["loosened"][-1][1] == ["sudden change"]
    assert rung["deck"][-1][1] == ["sudden change"]
    (alert,) = found["lost"]["alerts"]
    assert alert["change"]["moved"][0]["quantity"] == "tension"
    assert alert["urgency"] == "today"
    shift = found["lost"]["drifts"][0]
    assert abs(shift["shift_mean"] + 0.08) < 1.645 * shift["shift_sd"]
    alert = found["loosened"]["alerts"][-1]
    assert alert["change"]["moved"][0]["quantity"] == "transverse_end_stiffness"
    for shift in found["deck"]["drifts"]:
        assert abs(shift["shift_mean"] + 0.0198) < 1.645 * shift["shift_sd"]
    pattern = calls.golden("bridge")
    assert pattern["explanations"][0]["name"] == "load redistribution"
    assert pattern["suspects"][0]["hangers"] == [4]


def test_schemas_are_as_they_were() -> None:
    """Compare with texts: golden files could be written anew with another one."""
    assert calls.golden("lost")["alerts"][0]["schema"] == "shm.alert/1"
    assert calls.golden("bridge")["schema"] == "shm.bridge_pattern/1"


@pytest.mark.parametrize("name", [*calls.STATES, "deck"])
def test_what_is_stored_of_a_test_is_read_and_written_back_as_it_was(name: str) -> None:
    known = calls.golden(name)["watch"]
    back, level, _ = watch_in(dump({**known, "alert_probability": 0.95}))
    assert (calls.read_back(watch_document(back)), level) == (known, 0.95)


def test_what_version_0_1_0_stored_of_a_test_is_read() -> None:
    """Read what does not say how sure it is that the change is material, nor of creep or modes."""
    known = calls.read_back(watch_document(a_watched_test()))
    del known["creep_per_year"], known["mistaken"]
    for key in ("material_probability", "against_baseline"):
        del known["change"][key]
    back, _, alert = watch_in(dump(known))
    assert back.change.called
    assert (back.creep_per_year, back.mistaken, alert) == (None, (), None)


def test_fields_are_in_their_order() -> None:
    """Compare the fields of what is stored and shown; more may follow, each with a default."""
    expected = {
        Drift: "hanger test time quantity baseline value shift_mean shift_sd threshold probability",
        Change: "evidence_years limit_years probability sudden began_after began_by moved "
        "outlier_probability material_probability against_baseline",
        WatchedTest: "test time temperature_c drifts change creep_per_year mistaken",
        Alert: "key hanger test time message drifts kinds change tension alerts limit",
        BridgePattern: "newest explanations suspects rows sum_kept alike_fraction alike_sd "
        "alike_cause not_compared sentence remarks",
        Fingerprint: "digest shapes marks",
    }
    for kind, names in expected.items():
        found = list(inspect.signature(kind).parameters)
        assert found[: len(names.split())] == names.split(), kind


# ---------------------------------------------------------------- keys, kinds, checks


def test_kinds_of_alerts_have_their_names() -> None:
    assert get_args(AlertKind) == (
        "sudden change", "slow drift", "beyond threshold", "repeat the test", "tests disagree",
        "check the modes", "check the baseline", "gap", "held", "limit", "silent", "test",
        "resolved",
    )  # fmt: skip


def test_a_key_names_hanger_rules_quantity_way_and_test() -> None:
    keys = {
        alert["key"] for name in (*calls.STATES, "deck") for alert in calls.golden(name)["alerts"]
    }
    form = r"hanger-\d+:[a-z-]+(\+[a-z-]+)*(:[\w.-]+-(up|down))?:\w+"
    assert all(re.fullmatch(form, key) for key in keys), keys
    assert "resolved" not in an_alert().key


def test_plausibility_checks_keep_their_order() -> None:
    assert [check.__name__ for check in plausibility.CHECKS] == [
        "before_the_bridge", "ahead", "ambiguous", "scattered", "stuck", "before_the_baseline",
        "copied", "of_another_bar", "of_other_signals",
    ]  # fmt: skip


def test_the_digest_of_samples_is_as_it_was() -> None:
    """Compare with a text: copies of recordings that are stored must be known again."""
    found = plausibility.fingerprint_of([calls.record_hit()])
    assert found is not None
    assert found.digest == "7d8e061e119fb2253924b34d6ff3c2e6e119002d1fb567abb356409af036fe17"
    assert found.shapes.shape[1] == 32
    assert found.marks.shape == (len(found.shapes), 4)


# ---------------------------------------------------------------- names and signatures

SIGNATURES = {
    "watch_hanger": "baseline, baseline_tests, later, hanger, options",
    "watch_newest": "baseline, baseline_tests, later, hanger, options, kept=None",
    "watch_frequencies": "tests, *, baseline_tests=30, name='', options=None",
    "watch_gap": "baseline, current, hanger, *, test, time",
    "gap_percent": "posterior",
    "has_grown": "before_percent, now_percent",
    "end_stiffness": "posterior, hanger",
}


@pytest.mark.parametrize("name", SIGNATURES)
def test_a_signature_is_as_it_was(name: str) -> None:
    assert_signature(getattr(shm.watch, name), SIGNATURES[name])


def test_public_names_are_there() -> None:
    more = {"DatedTest", "Newest", "WatchOptions", "Watched", "WatchedFrequencies"}
    assert set(shm.watch.__all__) >= {*SIGNATURES, *more}


# ---------------------------------------------------------------- scenarios


@pytest.mark.parametrize("scenario", SCENARIOS.values(), ids=SCENARIOS)
def test_a_history_is_reported_as_the_table_says(scenario: Scenario) -> None:
    found = watch_of(scenario.make(), scenario.quantities)
    called = [call.index for call in found.calls]
    if scenario.first is None:
        assert called == []
    else:
        assert called
        assert scenario.first <= called[0] <= scenario.last
        if scenario.cause:
            assert found.calls[0].change.moved[0].quantity == scenario.cause
    assert found.tests[-1].change.is_baseline_alone == scenario.is_baseline_doubted


def test_the_table_has_at_least_41_scenarios() -> None:
    assert len(SCENARIOS) >= 41


def test_what_comes_often_needs_more_tests_than_what_never_came() -> None:
    scenario = SCENARIOS["load that never came before"]
    readings = list(scenario.make())
    (never,) = [call.index for call in watch_of(readings, scenario.quantities).calls]
    often = watch_of(load(readings, [2, 6, 10]), scenario.quantities).calls
    assert not often or often[0].index > never
