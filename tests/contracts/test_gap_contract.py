"""Hold documents, names, signatures and exit codes of the gap diagnosis.

Golden files are by `write_gap_golden.py`. Keys, types, names and outcomes are compared as they are;
what a sampler gives, within tolerances that nearly every seed meets.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from shm import diagnosis_document as documents
from shm.bridge import load_hanger
from shm.diagnosis_document import diagnosis_document, diagnosis_of
from shm.pipeline.adopting import adopted_name
from shm.store import Lineage
from shm.store.rows import StoredDiagnosis
from tests.contracts import gap_calls as calls
from tests.contracts.inference_calls import call
from tests.contracts.test_inference_contract import bare
from tests.contracts.write_gap_golden import SEED

TOLERANCES = {
    r"(.*_)?probability|share|fit_p_value|acts_alone|scatter": {"abs": 0.05},
    r"log_.*|.*_log_.*": {"abs": 1.0},
    r".*_percent|rms_z|z|after_z|profile": {"abs": 0.02, "rel": 0.1},
    r"predicted_hz|expected_hz|slenderness": {"rel": 1e-3},
    r"expected_sd_hz|effective_draws": {"rel": 0.5},
    r"slope|offset": {"abs": 0.02},
    r"before|after|held_out_.*|gap_left|gaps|apart_sds": {"abs": 0.1, "rel": 0.1},
    r".*": {"rel": 2e-5},
}
"""Differences allowed to numbers, by key; the last is what golden files of six digits leave."""
OF_INTERVALS = 0.1
"""Difference allowed to a tension or size, as a fraction of its 90 % interval."""
TEXTS = {"summary", "details", "remarks", "what"}
"""Keys of texts that state numbers, which are passed over."""


@pytest.fixture(autouse=True)
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run each call in an empty folder, so that no workspace is at hand."""
    monkeypatch.delenv("SHM_WORKSPACE", raising=False)
    monkeypatch.chdir(tmp_path)


@cache
def made(name: str) -> Any:
    """Return the document of a case of today."""
    return calls.CASES[name](SEED)


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
                if not away <= OF_INTERVALS:
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
    verdicts = {
        name: (each["verdict"]["outcome"], each["verdict"]["reason"], each["verdict"]["causes"])
        for name, each in found.items()
        if "verdict" in each
    }
    assert verdicts == {
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
    assert [each["family"] for each in found["bridge"]["causes"]] == [[3, 4], [3, 4]]
    assert found["plan"]["steps"] == []
    assert [step["kind"] for step in found["plan_soft"]["steps"]] == ["known mass"]


def test_probabilities_of_golden_files_add_to_one() -> None:
    for name in ("sound", "point_mass", "without_sds", "gross_error", "bridge", "line"):
        found = calls.golden(name)
        total = sum(cause["probability"] for cause in found["causes"])
        total += sum(found[key] for key in found if re.fullmatch(r"\w+_probability", key))
        assert total == pytest.approx(1.0, abs=1e-4), name


def test_schemas_are_those_of_the_golden_files() -> None:
    assert documents.DIAGNOSIS_SCHEMA == calls.golden("sound")["schema"] == "shm.diagnosis/1"
    bridge = calls.golden("bridge")["schema"]
    assert documents.BRIDGE_DIAGNOSIS_SCHEMA == bridge == "shm.bridge_diagnosis/1"
    assert documents.GAP_CHECK_SCHEMA == "shm.gap_check/1"


@pytest.mark.parametrize("name", ["sound", "point_mass", "without_sds", "gross_error"])
def test_a_document_is_read_and_written_back_as_it_was(name: str) -> None:
    known = calls.golden(name)
    back = calls.read_back(diagnosis_document(diagnosis_of({**known, calls.VOLATILE: 0.0})))
    verdict, judged = known["verdict"], back.pop("verdict")
    assert list(differ(judged, verdict)) == []
    assert back == {key: value for key, value in known.items() if key in back}
    assert set(known) - set(back) <= {"verdict", "answer", "summary", "details", "bar"}


@pytest.mark.parametrize(
    ("name", "outcome", "causes"),
    [("explained", "explained", ["point_mass"]), ("unexplained", "unexplained", [])],
)
def test_a_document_of_version_1_0_0_is_read(name: str, outcome: str, causes: list[str]) -> None:
    """Read what it states today as well, judge it, and leave what is no longer stated."""
    known = calls.golden(calls.FORMER.stem)[name]
    assert known["schema"] == documents.DIAGNOSIS_SCHEMA
    back = calls.read_back(diagnosis_document(diagnosis_of(known)))
    assert set(known) - set(back) == {
        "not_falsified", "compatibility", "remainder", calls.VOLATILE,
    }  # fmt: skip
    assert set(back) - set(known) == {"effective_draws", "slenderness", "verdict"}
    for row in back["where"]:
        assert row.pop("after_z") is None
    assert {key: back[key] for key in known if key in back} == {
        key: value for key, value in known.items() if key in back
    }
    assert (back["verdict"]["outcome"], back["verdict"]["causes"]) == (outcome, causes)


def test_the_catalogue_of_effects_is_that_of_the_golden_file() -> None:
    found = call("gap", "effects", "--json").document
    assert list(differ(found, calls.golden("effects"))) == []


def test_the_class_of_an_adopted_cause_has_its_name() -> None:
    """Take place and range from the stored diagnosis; the name is what `shm gap adopt` stores."""
    diagnosis = diagnosis_of({**calls.golden("point_mass"), calls.VOLATILE: 0.0})
    when = datetime(2026, 5, 1, tzinfo=UTC)
    stored = StoredDiagnosis(1, 3, diagnosis, when, Lineage("", "", ""))
    name = adopted_name(("point_mass",), (), "", load_hanger(calls.ROD), stored, ())
    assert str(name) == "beam1+point_mass@everywhere:x_m=3.38112..3.40278"


# ---------------------------------------------------------------- names and signatures


NAMES = {
    "shm.gap": ("GapOptions", "Progress", "diagnose", "diagnose_bridge"),
    "shm": ("Diagnosis", "GapCheck", "Prior", "Reading", "Simulator", "SimulatorEffect",
            "check_gap", "diagnose", "diagnose_simulator"),
}  # fmt: skip
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
OUTCOMES = {
    "NO_GAP": "No gap visible",
    "EXPLAINED": "Explained",
    "PARTLY": "Partly explained",
    "ALIKE": "Several causes fit alike",
    "UNEXPLAINED": "Not explained",
}


@pytest.mark.parametrize("module", NAMES)
def test_public_names_are_there(module: str) -> None:
    assert set(importlib.import_module(module).__all__) >= set(NAMES[module])


@pytest.mark.parametrize("path", SIGNATURES)
def test_a_signature_is_as_it_was(path: str) -> None:
    """Compare the parameters of today; more may follow, each with a default."""
    module, _, name = path.rpartition(".")
    found = getattr(importlib.import_module(module), name)
    parameters = [bare(each) for each in inspect.signature(found).parameters.values()]
    count = len(re.sub(r"\*, ", "", SIGNATURES[path]).split(", "))
    assert str(inspect.Signature(parameters[:count])) == f"({SIGNATURES[path]})"
    assert inspect.Parameter.empty not in [each.default for each in parameters[count:]]


def test_outcomes_have_their_words() -> None:
    outcomes = type(diagnosis_of(calls.golden(calls.FORMER.stem)["explained"]).verdict.outcome)
    assert {each.name: each.value for each in outcomes} == OUTCOMES


# ---------------------------------------------------------------- exit codes


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (2, (calls.SOFT, "--hanger-file", calls.ROD, "--without", "ghosts")),
        (2, (calls.SOFT, "--hanger-file", calls.ROD, "--baseline", "beam9")),
        (2, (calls.SOFT, "--hanger-file", calls.ROD, "--hold-out", "t77")),
        (2, (calls.SOFT, calls.ROD, calls.SOFT)),
        (2, ("missing.modes.json", "--hanger-file", calls.ROD)),
        (3, (calls.ROD, "--hanger-file", calls.ROD)),
        (3, (calls.SOFT, "--hanger-file", calls.SOFT)),
        (3, (calls.SOFT, "--hanger-file", calls.ROD, "--hanger", 9)),
        (3, ("empty.modes.json", "--hanger-file", calls.ROD)),
    ],
)
def test_bad_input_is_refused_with_its_exit_code(code: int, words: tuple[object, ...]) -> None:
    Path("empty.modes.json").write_text('{"schema": "shm.modes/1", "hanger": 3, "tests": []}')
    ended = call("gap", "diagnose", *words)
    assert (ended.code, ended.out) == (code, ""), ended.err
    assert ended.err
