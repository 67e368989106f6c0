"""Hold documents, names, signatures and exit codes of the gap diagnosis.

Golden files are by `write_gap_golden.py`. Keys, types, names and outcomes are compared as they are;
what a sampler gives, within tolerances that other seeds meet as well.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import shm.gap
import shm.values
from shm import diagnosis_document as documents
from shm.diagnosis_document import diagnosis_document, diagnosis_of
from shm.pipeline.adopting import adopted_name
from shm.store import Lineage
from shm.store.rows import StoredDiagnosis
from tests.contracts import gap_calls as calls
from tests.contracts.golden_files import assert_signature
from tests.contracts.inference_calls import ROD, call

pytestmark = pytest.mark.usefixtures("outside")

TOLERANCES = {
    r"(.*_)?probability|share|fit_p_value|acts_alone|scatter": {"abs": 0.05},
    r"log_.*|.*_log_.*": {"abs": 1.0},
    r".*_percent|rms_z|z|after_z|profile": {"abs": 0.02, "rel": 0.1},
    r"predicted_hz|expected_hz|slenderness": {"rel": 1e-3},
    r"expected_sd_hz|effective_draws": {"rel": 0.5},
    r"slope|offset": {"abs": 0.02},
    r"x_m|low_m|high_m": {"abs": 0.1},
    r"before|after|held_out_.*|gap_left|gaps|apart_sds": {"abs": 0.1, "rel": 0.1},
    r".*": {"rel": 2e-5},
}
"""Differences allowed to numbers, by key; the last is what golden files of six digits leave."""
OF_INTERVALS = {"mean": 0.1, "sd": 0.1, "q05": 0.25, "q95": 0.25, "q025": 0.25, "q975": 0.25}
"""Differences allowed to a tension or size, as fractions of its 90 % interval.

Of 200 effective draws, two means differ by 0.03, two quantiles of 2.5 % by 0.08 (1 sd).
"""
TEXTS = {"summary", "details", "remarks", "what"}
"""Keys of texts that state numbers, which are passed over."""


@cache
def made(name: str) -> Any:
    """Return the document of a case of today."""
    return calls.CASES[name](calls.SEED)


def differ(now: Any, before: Any, key: str = "", at: str = "") -> Iterator[str]:
    """Yield a line for each place where a document differs from the golden one."""
    line = f"{at}: {now!r}, not {before!r}"
    if type(now) is not type(before):
        yield line
    elif isinstance(before, dict):
        if list(now) != list(before):
            yield f"{at}: keys {list(now)}, not {list(before)}"
            return
        for name, value in before.items():
            place = f"{at}.{name}"
            if "q95" in before and isinstance(value, float) and isinstance(now[name], float):
                away = abs(now[name] - value) / (before["q95"] - before["q05"])
                if not away <= OF_INTERVALS[name]:
                    yield f"{place}: {now[name]}, not {value}, {away:.2f} of the interval"
            else:
                yield from differ(now[name], value, name, place)
    elif isinstance(before, list):
        if len(now) != len(before):
            yield line
            return
        for index, (one, other) in enumerate(zip(now, before, strict=True)):
            yield from differ(one, other, key, f"{at}[{index}]")
    elif isinstance(before, float):
        allowed = next(each for name, each in TOLERANCES.items() if re.fullmatch(name, key))
        if now != pytest.approx(before, rel=allowed.get("rel", 0.0), abs=allowed.get("abs", 0.0)):
            yield line
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
    found = {name: calls.golden(name) for name in calls.CASES}
    verdicts = {name: found[name]["verdict"] for name in calls.SINGLE}
    assert {n: (v["outcome"], v["reason"], v["causes"]) for n, v in verdicts.items()} == {
        "sound": ("no_gap", "", []),
        "point_mass": ("explained", "", ["point_mass"]),
        "without_sds": ("explained", "", ["point_mass"]),
        "gross_error": ("unexplained", "acts alone", []),
    }
    for name in ("point_mass", "without_sds"):
        sizes = found[name]["causes"][0]["parameters"]
        assert sizes["mass_kg"]["q05"] < 12.0 < sizes["mass_kg"]["q95"]
        assert sizes["x_m"]["q05"] < 3.4 < sizes["x_m"]["q95"]
    (wrong,) = found["gross_error"]["outliers"]
    assert (wrong["plane"], wrong["order"]) == ("transverse", 4)
    assert wrong["measured_hz"] == pytest.approx(1.04 * wrong["expected_hz"], rel=1e-3)
    assert found["line"]["named"] == ["offset"]
    (shared,) = found["bridge"]["causes"]
    assert (shared["effect"], shared["family"]) == ("bending_stiffness", [3, 4])
    assert shared["size"]["q05"] < -0.2 < shared["size"]["q95"]
    assert [step["kind"] for step in found["plan"]["steps"]] == ["known mass"]


@pytest.mark.parametrize("name", [*calls.SINGLE, "bridge", "line"])
def test_probabilities_of_a_document_add_to_one(name: str) -> None:
    found = made(name)
    total = sum(cause["probability"] for cause in found["causes"])
    total += sum(found[key] for key in found if key.endswith("_probability"))
    assert total == pytest.approx(1.0)


def test_schemas_are_as_they_were() -> None:
    """Compare with texts: golden files could be written anew with another one."""
    assert documents.DIAGNOSIS_SCHEMA == "shm.diagnosis/1"
    assert documents.BRIDGE_DIAGNOSIS_SCHEMA == "shm.bridge_diagnosis/1"
    assert documents.GAP_CHECK_SCHEMA == "shm.gap_check/1"


@pytest.mark.parametrize("name", calls.SINGLE)
def test_a_document_is_read_and_written_back_as_it_was(name: str) -> None:
    known = calls.golden(name)
    back = calls.read_back(diagnosis_document(diagnosis_of({**known, calls.VOLATILE: 0.0})))
    assert set(known) - set(back) <= {"answer", "summary", "details", "bar"}
    assert list(differ(back.pop("verdict"), known["verdict"])) == []  # computed anew
    assert back == {key: known[key] for key in back}


@pytest.mark.parametrize(("name", "causes"), [("explained", ["point_mass"]), ("unexplained", [])])
def test_a_document_of_version_1_0_0_is_read(name: str, causes: list[str]) -> None:
    """Keep what is stated today as well, judge it, and leave the rest."""
    known = calls.golden("former")[name]
    back = calls.read_back(diagnosis_document(diagnosis_of(known)))
    assert set(known) - set(back) == {"not_falsified", "compatibility", "remainder", "seconds"}
    assert (back["verdict"]["outcome"], back["verdict"]["causes"]) == (name, causes)
    for row in back["where"]:
        assert row.pop("after_z") is None
    news = {"effective_draws", "slenderness", "verdict"}
    assert {key: back[key] for key in back if key not in news} == {
        key: known[key] for key in back if key not in news
    }


def test_the_catalogue_of_effects_is_that_of_the_golden_file() -> None:
    assert list(differ(calls.list_effects(), calls.golden("effects"))) == []


def test_an_adopted_cause_has_its_name() -> None:
    """Take the range of its place from a diagnosis, as `shm gap adopt` does."""
    diagnosis = diagnosis_of({**calls.golden("point_mass"), calls.VOLATILE: 0.0})
    when, lineage = datetime(2026, 5, 1, tzinfo=UTC), Lineage("", "", "")
    stored = StoredDiagnosis(1, 3, diagnosis, when, lineage)
    name = adopted_name(("point_mass",), (), "", shm.load_hanger(ROD), stored, ())
    assert str(name) == "beam1+point_mass@everywhere:x_m=3.36632..3.42457"


# ---------------------------------------------------------------- names and signatures


SIGNATURES = {
    "shm.gap.GapOptions": "baseline='', without=(), hold_out=(), draws=1000, seed=1",
    "shm.gap.diagnose": "tests, hanger, options=None, progress=silent",
    "shm.gap.diagnose_bridge": "hangers, options=None, progress=silent",
    "shm.diagnose": "tests, hanger, baseline='', *, without=(), hold_out=(), draws=1000, seed=1, "
    "progress=silent",
    "shm.check_gap": "tests, hanger, baseline='', *, effects=(), seeds=1, sound=5, seed=1, "
    "progress=silent",
    "shm.diagnose_simulator": "simulator, readings, *, candidates=(), seed=1",
    "shm.Simulator": "predict, parameters, effects=(), vectorised=False",
    "shm.SimulatorEffect": "name, parameters, predict",
    "shm.Reading": "condition, observable, value, sd=nan",
    "shm.Prior": "spread, a, b",
}
OUTCOMES = ("no_gap", "explained", "partly", "alike", "unexplained")


def test_public_names_are_there() -> None:
    assert set(shm.gap.__all__) >= {"GapOptions", "Progress", "diagnose", "diagnose_bridge"}
    named = {path.removeprefix("shm.") for path in SIGNATURES if path.count(".") == 1}
    assert set(shm.__all__) >= named | {"Diagnosis", "GapCheck"}


@pytest.mark.parametrize("path", SIGNATURES)
def test_a_signature_is_as_it_was(path: str) -> None:
    module, _, name = path.rpartition(".")
    assert_signature(getattr(importlib.import_module(module), name), SIGNATURES[path])


def test_outcomes_have_their_names() -> None:
    assert tuple(each.name.lower() for each in shm.values.Outcome) == OUTCOMES


# ---------------------------------------------------------------- exit codes


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (2, (calls.SOFT, "--hanger-file", ROD, "--without", "ghosts")),
        (2, (calls.SOFT, "--hanger-file", ROD, "--baseline", "beam9")),
        (2, (calls.SOFT, "--hanger-file", ROD, "--hold-out", "t77")),
        (2, (calls.SOFT, ROD, calls.SOFT)),
        (2, ("missing.modes.json", "--hanger-file", ROD)),
        (3, (ROD, "--hanger-file", ROD)),
        (3, (calls.SOFT, "--hanger-file", calls.SOFT)),
        (4, (calls.SOFT, "--hanger-file", ROD, "--hanger", 9)),
        (3, ("empty.modes.json", "--hanger-file", ROD)),
    ],
)
def test_bad_input_is_refused_with_its_exit_code(code: int, words: tuple[object, ...]) -> None:
    Path("empty.modes.json").write_text('{"schema": "shm.modes/1", "hanger": 3, "tests": []}')
    ended = call("gap", "diagnose", *words)
    assert (ended.code, ended.out) == (code, ""), ended.err
    assert ended.err
