"""Hold documents, names, signatures and stored posteriors of inference, models and simulate.

They were written down before these rooms were rebuilt: see `write_inference_golden.py`. Texts, keys
and units are compared as they are; what a sampler gives, within tolerances that each correct
sampler meets with 200 draws.
"""

from __future__ import annotations

import base64
import importlib
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shm
from shm.bridge import load_hanger
from shm.documents import posterior_document, selection_document
from shm.errors import BadInput, UsageError
from shm.inference import UpdateOptions, class_probabilities, refresh, select, update
from shm.models import (
    PRIORS,
    THESIS,
    build,
    class_of,
    class_units,
    described,
    end_stiffness,
    parameter_sets,
)
from shm.modes_document import load_modes
from shm.simulate import (
    PlantedEffect,
)
from shm.store.blobs import posterior_from
from shm.values import PLANES, Posterior, Recording
from tests.contracts import inference_calls as calls
from tests.contracts.golden_files import assert_signature

pytestmark = pytest.mark.usefixtures("outside")

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = 200
OF_THE_CLOCK = {"seconds": 0}

WHOLE = {"hanger", "samples", "evaluations", "order", "seed"}
"""Keys whose numbers are whole."""
QUICK_AND_SLOW = [
    pytest.param(name, marks=pytest.mark.slow) if name == "update_adopted" else name
    for name in calls.UPDATES
]
OPEN = {"tension_of_other_ends_n", "tension_of_other_orders_n"}
"""Keys that are null or a number, whichever the draws give."""
TEXTS = {"tests", "at_bounds", "caveats", "doubts"}
"""Keys of lists of texts, of any length."""
ADDED = {
    "schema", "remarks", "stated_error_percent", "taut_string_tension_n", "sampler",
    "ends_share_of_variance", "inclination_share_of_variance",
}  # fmt: skip
"""Keys that documents have had since version 1.0.0 and its golden files."""


@cache
def updated(name: str) -> Any:
    """Return the document of a call of today, which several tests look at."""
    return calls.update(name, SAMPLES, 1)


def outline(value: object, key: str = "") -> object:
    """Return keys, types and units of a document, without its values."""
    if isinstance(value, Mapping):
        return {name: outline(each, name) for name, each in value.items()}
    if key in TEXTS:
        assert isinstance(value, list)
        assert all(isinstance(each, str) for each in value)
        return "texts"
    if isinstance(value, list):
        return [outline(each) for each in value]
    if key in OPEN and (value is None or isinstance(value, float)):
        return "number or null"
    if value is None:
        return "null"
    if isinstance(value, str):
        return value if key == "unit" else "text"
    if key in WHOLE:
        return "whole number" if type(value) is int else f"{value!r} is not a whole number"
    return "number" if type(value) in (int, float) else type(value).__name__


def without_added(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document without the keys that version 1.0.0 leaves out; a wrong schema fails."""
    schema = document.get("schema", "shm.none/1")
    assert re.fullmatch(r"shm\.[a-z_]+/[0-9]+", schema), schema
    found = {key: value for key, value in document.items() if key not in ADDED}
    if "models" in found:
        found["models"] = [without_added(each) for each in found["models"]]
    return found


def entries(document: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the posteriors of a document of an update or a selection."""
    found: list[dict[str, Any]] = document.get("models", [document])
    return found


def pairs(name: str) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yield each posterior of a call of today beside that of its golden file."""
    yield from zip(entries(updated(name)), entries(calls.golden(name)), strict=True)


# ---------------------------------------------------------------- documents


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_keys_types_and_units_of_an_update_are_those_of_the_golden_file(name: str) -> None:
    assert outline(without_added(updated(name))) == outline(without_added(calls.golden(name)))


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_what_no_sampler_decides_is_the_same(name: str) -> None:
    fixed = ("model", "hanger", "tests", "nominal_tension_n", "priors")
    for now, before in pairs(name):
        assert {key: now[key] for key in fixed} == {key: before[key] for key in fixed}
        assert list(now["parameters"]) == list(before["parameters"])
        measured = [(row["plane"], row["order"], row["measured_hz"]) for row in now["predicted"]]
        assert measured == [
            (row["plane"], row["order"], pytest.approx(row["measured_hz"], rel=1e-5))
            for row in before["predicted"]
        ]
        assert (now["samples"], now["seed"]) == (SAMPLES, 1)


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_tension_and_evidence_are_those_of_the_golden_file(name: str) -> None:
    """Compare within limits of Monte Carlo: 200 draws give an end to 0.15 standard deviations.

    An interval of these is 1 to 4 % of the tension to each side, so that one of no width would
    still end within 5 % of the golden one: hence its width is compared, too.
    """
    for now, before in pairs(name):
        tension, known = now["tension_n"], before["tension_n"]
        assert tension["q50"] == pytest.approx(known["q50"], rel=0.02)
        assert tension["q05"] == pytest.approx(known["q05"], rel=0.05)
        assert tension["q95"] == pytest.approx(known["q95"], rel=0.05)
        width, golden_width = (each["q95"] - each["q05"] for each in (tension, known))
        assert 0.7 < width / golden_width < 1.4
        assert now["log_evidence"] == pytest.approx(before["log_evidence"], abs=0.3)
        assert now["log_occam"] < 0


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_a_summary_is_consistent_with_itself(name: str) -> None:
    for now, _ in pairs(name):
        tension, load = now["tension_n"], now["parameters"]["theta_F"]
        assert tension == {
            key: pytest.approx(load[key] * now["nominal_tension_n"]) for key in tension
        }
        for figures in now["parameters"].values():
            assert figures["q05"] <= figures["q50"] <= figures["q95"]
            assert figures["sd"] > 0
        for row in now["predicted"]:
            assert row["frequency_hz"]["mean"] == pytest.approx(row["measured_hz"], rel=0.01)


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_parameters_that_data_and_description_fix_are_those_of_the_golden_file(name: str) -> None:
    """Compare medians within half a standard deviation; 200 draws have them to a tenth of one.

    Springs are left out: the two of a plane can be exchanged, and which copy is kept is a choice.
    """
    for now, before in pairs(name):
        for parameter, known in before["parameters"].items():
            if not parameter.startswith("log10_k"):
                median = now["parameters"][parameter]["q50"]
                assert median == pytest.approx(known["q50"], abs=0.5 * known["sd"]), parameter


def test_a_selection_has_the_order_and_probabilities_of_the_golden_file() -> None:
    now, before = updated("select"), calls.golden("select")
    assert now["selected"] == before["selected"] == now["models"][0]["model"]
    chances, known = ([each["probability"] for each in found["models"]] for found in (now, before))
    assert sum(chances) == pytest.approx(1)
    # Two evidences, each within 0.3.
    assert math.log(chances[0] / chances[1]) == pytest.approx(
        math.log(known[0] / known[1]), abs=0.6
    )
    assert set(now["not_applicable"]) == {"solid0"}
    assert updated("update_few")["probability"] is None


def test_limits_of_the_tension_have_probabilities() -> None:
    averaged, known = (
        found["averaged"] for found in (updated("select_limits"), calls.golden("select_limits"))
    )
    # A fraction of 200 draws has a standard deviation of 0.022 here.
    assert averaged["probability_above_limit"] == pytest.approx(
        known["probability_above_limit"], abs=0.1
    )
    assert averaged["probability_above_limit"] > 0
    assert averaged["probability_slack"] == 0
    assert updated("select")["averaged"]["probability_slack"] is None


def test_overridden_assumptions_are_part_of_the_document() -> None:
    known = calls.golden("select_limits")["assumptions"]
    assert updated("select_limits")["assumptions"] == known
    assert "assumptions" not in updated("select")


@pytest.mark.parametrize("name", calls.PREDICTIONS)
def test_predicted_frequencies_are_those_of_the_golden_file(name: str) -> None:
    now, before = without_added(calls.predict(name)), calls.golden("predict")[name]
    assert outline(now) == outline(before)
    assert {**now, "frequencies": 0, "points": 0} == {**before, "frequencies": 0, "points": 0}
    tables = [
        [row["frequencies"] for row in found.get("points", [found])] for found in (now, before)
    ]
    # Beams are solved exactly; a solid on its mesh, which is off its limit by more than 1e-4.
    rel = 1e-4 if before["model"].startswith("solid") else 1e-6
    for rows, known in zip(*tables, strict=True):
        assert [(row["plane"], row["order"]) for row in rows] == [
            (row["plane"], row["order"]) for row in known
        ]
        assert [row["frequency_hz"] for row in rows] == pytest.approx(
            [row["frequency_hz"] for row in known], rel=rel
        )


@pytest.mark.parametrize("name", calls.SIMULATIONS)
def test_a_simulated_file_has_the_header_of_the_golden_file_and_repeats(
    name: str, tmp_path: Path
) -> None:
    known = calls.golden("simulate")[name]
    path = calls.simulate(name, tmp_path / "first")
    assert path == tmp_path / "first" / known["file"]
    assert calls.header_of(path) == known["header"]
    lines = path.read_text(encoding="utf-8").splitlines()
    assert sum(not line.startswith("#") for line in lines) - 1 == known["rows"]
    assert calls.simulate(name, tmp_path / "again").read_bytes() == path.read_bytes()
    assert calls.simulate(name, tmp_path / "other", seed=8).read_bytes() != path.read_bytes()


def test_a_simulated_recording_is_the_same_by_command_and_by_function(tmp_path: Path) -> None:
    planted = PlantedEffect("point_mass", "everywhere", {"mass_kg": 12.0, "x_m": 3.4})
    recording = shm.simulate(
        load_hanger(calls.ROD), tension_n=640e3, k1_n_m_rad=1e7, k3_n_m_rad=1e7, hits=2,
        seconds_per_hit=4.0, sampling_rate_hz=256.0, effects=[planted], seed=7,
    )  # fmt: skip
    written = shm.read(calls.simulate("hammer", tmp_path))
    assert isinstance(written, Recording)
    for one, other in zip(recording.channels, written.channels, strict=True):
        assert (one.name, one.plane) == (other.name, other.plane)
        assert one.x_m == pytest.approx(other.x_m)
        assert one.values == pytest.approx(other.values, rel=1e-5, abs=1e-6)


# ---------------------------------------------------------------- bad input


def written(name: str, document: object) -> Path:
    """Return a file of this folder with a document, or with a text as it is."""
    text = document if isinstance(document, str) else json.dumps(document)
    path = Path(name)
    path.write_text(text, encoding="utf-8")
    return path


def changed_mode(**changes: object) -> dict[str, Any]:
    """Return the few modes with the first one changed; a key that becomes None is left out."""
    document: dict[str, Any] = json.loads(calls.FEW.read_text(encoding="utf-8"))
    first = document["tests"][0]["modes"][0] | changes
    document["tests"][0]["modes"][0] = {
        key: value for key, value in first.items() if value is not None or key not in changes
    }
    return document


def changed(**changes: object) -> dict[str, Any]:
    """Return the few modes with changed keys of the document itself."""
    return {**json.loads(calls.FEW.read_text(encoding="utf-8")), **changes}


WRONG_MODES: Mapping[str, Callable[[], object]] = {
    "no order": lambda: changed_mode(order=None),
    "order 0": lambda: changed_mode(order=0),
    "order 1.5": lambda: changed_mode(order=1.5),
    "order as a text": lambda: changed_mode(order="one"),
    "no frequency": lambda: changed_mode(frequency_hz=None),
    "negative frequency": lambda: changed_mode(frequency_hz=-5.0),
    "no plane": lambda: changed_mode(plane=None),
    "unknown plane": lambda: changed_mode(plane="vertical"),
    "a mode twice": lambda: changed_mode(order=2),
    "another schema": lambda: changed(schema="shm.modes/2"),
    "no tests": lambda: changed(tests=[]),
    "no modes": lambda: changed(tests=[{"id": "t1", "modes": []}]),
    "a list": lambda: [1],
    "no JSON": lambda: "modes: 3",
}
WRONG_HANGERS: Mapping[str, tuple[int, Callable[[str], str]]] = {
    "no hanger": (3, lambda text: ""),
    "no TOML": (3, lambda text: "[[hanger"),
    "negative diameter": (3, lambda text: text.replace("0.130", "-0.130")),
    "no diameter": (3, lambda text: text.replace("diameter_m = 0.130\n", "")),
    "unknown key": (3, lambda text: text + "colour = 3\n"),
    "pinned ends": (2, lambda text: text + '[hanger.supports]\ndeck = "pinned"\narch = "pinned"\n'),
    "no tension": (2, lambda text: text.replace("711e3", "0")),
}
UPDATE, SELECT = ("update", calls.FEW), ("select", calls.FEW)
SIMULATE = ("simulate", "--out", "made")
CALIBRATED = ("--calibrated-by", calls.FEW)
WRONG_CALLS: Mapping[str, tuple[int, tuple[object, ...]]] = {
    "update, missing file": (2, ("update", "there_is_none.modes.json")),
    "update, unknown class": (2, (*UPDATE, "--model", "beam9")),
    "update, class of plates": (2, (*UPDATE, "--model", "solid0")),
    "update, unknown effect": (2, (*UPDATE, "--model", "beam1+nonsense@everywhere")),
    "update, unknown place": (2, (*UPDATE, "--model", "beam1+point_mass@nowhere")),
    "update, few samples": (2, (*UPDATE, "--samples", 99)),
    "update, negative seed": (2, (*UPDATE, "--seed", -1)),
    "update, unknown priors": (2, (*UPDATE, "--priors", "mine")),
    "update, unknown hanger": (4, (*UPDATE, "--hanger", 4)),
    "update, calibrated by no reading": (3, (*UPDATE, *CALIBRATED)),
    "update, thesis calibrated": (2, (*UPDATE, *CALIBRATED, "--priors", "thesis")),
    "select, missing file": (2, ("select", "there_is_none.modes.json")),
    "select, unknown class": (2, (*SELECT, "--models", "beam1,beam9")),
    "select, no class": (2, (*SELECT, "--models", "")),
    "select, no class that applies": (2, (*SELECT, "--models", "solid0")),
    "select, a prior of one": (2, (*SELECT, "--models", "beam1,beam2", "--prior", "beam1=1")),
    "select, no number": (2, (*SELECT, "--models", "beam1", "--prior", "beam1=x")),
    "predict, unknown class": (2, ("predict", "beam9")),
    "predict, class of plates": (2, ("predict", "solid2")),
    "predict, missing parameter": (2, ("predict", "beam2")),
    "predict, unknown parameter": (2, ("predict", "beam1", "--set", "theta_X=1")),
    "predict, no value": (2, ("predict", "beam1", "--set", "theta_F")),
    "predict, no frequencies": (2, ("predict", "beam1", "--set", "theta_F=-1")),
    "predict, no range": (2, ("predict", "beam1", "--sweep", "theta_F=1")),
    "predict, no modes": (2, ("predict", "beam1", "--modes", 0)),
    "simulate, no folder": (2, ("simulate",)),
    "simulate, no hits": (2, (*SIMULATE, "--hits", 0)),
    "simulate, negative spring": (2, (*SIMULATE, "--k1", "-1")),
    "simulate, hammer beyond the end": (2, (*SIMULATE, "--hammer-x", 13)),
    "simulate, unknown effect": (2, (*SIMULATE, "--effect", "nonsense:everywhere:x=1")),
    "simulate, missing value": (2, (*SIMULATE, "--effect", "point_mass:everywhere:mass_kg=1")),
    "simulate, mass without a hit": (2, (*SIMULATE, "--ambient", "--added-mass", "25:3.6")),
    "simulate, unknown format": (2, (*SIMULATE, "--format", "docx")),
}


def refused(code: int, *words: object) -> None:
    """Assert that a call ends with a code, a message for people and no result."""
    ended = calls.call(*words, "--json")
    assert ended.code == code, ended.err
    assert ended.err.strip()
    if ended.out:  # an error as JSON, which version 1.0.0 does not give
        results = {"tension_n", "models", "frequencies", "points", "files"}
        assert not results & set(json.loads(ended.out))


@pytest.mark.parametrize("verb", [("update", "--model", "beam1"), ("select", "--models", "beam1")])
@pytest.mark.parametrize("fault", WRONG_MODES)
def test_wrong_modes_are_bad_input(fault: str, verb: tuple[str, ...]) -> None:
    path = written("wrong.modes.json", WRONG_MODES[fault]())
    refused(3, verb[0], path, *verb[1:], "--hanger-file", calls.ROD)


@pytest.mark.parametrize("fault", WRONG_HANGERS)
def test_a_wrong_hanger_has_the_same_code_in_every_verb(fault: str) -> None:
    code, change = WRONG_HANGERS[fault]
    path = written("H.toml", change(calls.ROD.read_text(encoding="utf-8")))
    for words in (UPDATE, (*SELECT, "--models", "beam1"), ("predict", "beam1"), SIMULATE):
        refused(code, *words, "--hanger-file", path)


@pytest.mark.parametrize("fault", WRONG_CALLS)
def test_a_wrong_call_has_its_exit_code(fault: str) -> None:
    code, words = WRONG_CALLS[fault]
    refused(code, *words, "--hanger-file", calls.ROD)


@pytest.mark.parametrize(("verb", "code"), [("update", 2), ("select", 2), ("predict", 2)])
def test_a_call_without_a_hanger_is_a_usage_error(verb: str, code: int) -> None:
    refused(code, verb, *(("beam1",) if verb == "predict" else ()))
    refused(2, verb, "beam1" if verb == "predict" else calls.FEW, "--hanger-file", "none.toml")


def test_a_hanger_of_no_workspace_is_bad_input() -> None:
    for words in (("update",), ("select",), ("predict", "beam1"), SIMULATE):
        refused(3, *words, "--hanger", 3)
    refused(3, *UPDATE)  # the file names hanger 3, and there is no workspace


# ---------------------------------------------------------------- names and signatures


NAMES = {
    "shm.inference": ("Progress", "UpdateOptions", "class_probabilities", "refresh", "select",
                      "update"),
    "shm.models": ("DESCRIPTION", "MODELS", "PRIORS", "THESIS", "AdoptedName", "AsMade", "Model",
                   "applicable", "build", "check_baseline", "class_of", "class_units",
                   "competing_names", "described", "end_stiffness", "is_adopted"),
    "shm.simulate": ("AmbientPlan", "HammerPlan", "HangerState", "PlantedEffect", "ambient_test",
                     "hammer_test", "spread_places_m"),
    "shm": ("PlantedEffect", "Posterior", "Selection", "load_hanger", "load_modes", "round_bar",
            "select", "simulate", "update"),
}  # fmt: skip
SIGNATURES = {
    "update": "tests, hanger, model='beam2', *, seed=1, samples=1000, priors='description'",
    "select": "tests, hanger, models=None, *, seed=1, samples=1000, priors='description'",
}


@pytest.mark.parametrize("module", NAMES)
def test_public_names_are_there(module: str) -> None:
    found = importlib.import_module(module)
    assert [name for name in NAMES[module] if not hasattr(found, name)] == []


@pytest.mark.parametrize("name", SIGNATURES)
def test_a_signature_of_the_front_is_as_it_was(name: str) -> None:
    assert_signature(getattr(shm, name), SIGNATURES[name])


@pytest.mark.parametrize("name", calls.golden("classes"))
@pytest.mark.parametrize("priors", PRIORS)
def test_a_class_has_its_parameters_in_order_with_their_units(name: str, priors: str) -> None:
    known = calls.golden("classes")[name][priors]
    model = described(name, load_hanger(calls.PLATED), priors)
    assert (model.name, list(model.parameter_names)) == (name, list(known))
    assert {each: model.units[each] for each in known} == known
    prior = model.prior
    assert list(prior.names) == list(known)
    assert np.all(prior.lower < prior.upper)
    registered = class_units(name)
    assert registered["sigma"] == "1"
    assert {each: registered[each] for each in known if each in registered}.items() <= known.items()


def test_an_unknown_class_and_priors_are_usage_errors() -> None:
    hanger = load_hanger(calls.ROD)
    for make in (build, described):
        with pytest.raises(UsageError, match="beam9"):
            make("beam9", hanger)
        with pytest.raises(UsageError, match="mine"):
            make("beam1", hanger, "mine")
    with pytest.raises(UsageError, match="plate"):
        build("solid0", hanger)


# ---------------------------------------------------------------- the front


def test_the_function_gives_the_document_of_the_command() -> None:
    tests, hanger = shm.load_modes(calls.FEW), shm.load_hanger(calls.ROD)
    posterior = shm.update(tests, hanger, model="beam1", seed=1, samples=SAMPLES)
    document = json.loads(json.dumps(posterior_document(posterior), default=str))
    command = updated("update_few")
    assert document.keys() == command.keys() - {"doubts", "schema"}
    assert document["tension_n"] == command["tension_n"]
    assert document["parameters"] == command["parameters"]
    assert document["log_evidence"] == command["log_evidence"]
    assert posterior.samples.shape == (SAMPLES, len(posterior.names))
    assert posterior.tension_n.shape == (SAMPLES,)


def test_a_choice_of_the_function_holds_its_posteriors_and_an_average() -> None:
    tests, hanger = shm.load_modes(calls.FEW), shm.load_hanger(calls.LIMITED)
    choice = shm.select(tests, hanger, models=["beam1"], seed=1, samples=SAMPLES)
    assert (choice.selected.model, choice.probabilities) == ("beam1", (1.0,))
    averaged = choice.averaged_with(hanger.limits)
    command = updated("select_limits")["averaged"]
    assert averaged.tension_n.q50 == pytest.approx(command["tension_n"]["q50"])
    assert averaged.probability_above_limit == command["probability_above_limit"]
    assert selection_document(choice, hanger.limits)["selected"] == "beam1"


def test_springs_repeat_and_are_those_that_were_planted() -> None:
    """Compare with log10 of k1 = k3 and of k2 = k4, within three standard deviations.

    The same seed has given the command the same draws before.
    """
    hanger = load_hanger(calls.ROD)
    model = build("beam2", hanger, THESIS)
    posterior = update(load_modes(calls.SPRUNG_HIGHER), model, UpdateOptions(SAMPLES, 1))
    assert posterior.names == (*model.parameter_names, "sigma")
    document = updated("update_thesis")
    assert {name: figures["mean"] for name, figures in document["parameters"].items()} == {
        name: float(posterior.parameter(name).mean()) for name in posterior.names
    }
    assert document["log_evidence"] == posterior.log_evidence
    found = end_stiffness(posterior, hanger)
    assert list(found) == ["transverse_end_stiffness", "longitudinal_end_stiffness"]
    for values, planted in zip(found.values(), (7.1, 7.0), strict=True):
        assert values.shape == (SAMPLES,)
        assert values.std() < 0.2
        assert values.mean() == pytest.approx(planted, abs=3 * values.std())


def test_progress_is_told_the_class_and_a_fraction_that_rises_to_one() -> None:
    heard: list[tuple[str, float]] = []
    model = build("beam1", load_hanger(calls.ROD))
    update(
        load_modes(calls.FEW), model, UpdateOptions(SAMPLES, 1), lambda *each: heard.append(each)
    )
    assert {label for label, _ in heard} == {"beam1"}
    fractions = [fraction for _, fraction in heard]
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)
    assert fractions == sorted(fractions)


def test_probabilities_of_classes_follow_from_evidence_and_priors() -> None:
    """Compare two classes of which one is stated to be three times as probable beforehand."""
    tests, hanger = load_modes(calls.FEW), load_hanger(calls.ROD)
    stored = [stored_posterior(name)[0] for name in ("posterior_beam2", "posterior_adopted")]
    models = [class_of(each, hanger) for each in stored]
    stated = {stored[0].model: 1.0, stored[1].model: 3.0}
    found = class_probabilities(stored, models, tests, stated)
    assert list(found) == [each.model for each in stored]
    assert sum(found.values()) == pytest.approx(1)
    log_odds = stored[0].log_evidence - stored[1].log_evidence - math.log(3)
    assert found[stored[0].model] == pytest.approx(1 / (1 + math.exp(-log_odds)))


def test_wrong_requests_of_inference_are_refused() -> None:
    tests, hanger = load_modes(calls.FEW), load_hanger(calls.ROD)
    with pytest.raises(UsageError):
        select(tests, [])
    with pytest.raises(UsageError):
        select(tests, [build("beam1", hanger)], class_priors={"beam2": 1.0})
    with pytest.raises(UsageError, match="beam2"):
        refresh(tests, build("beam1", hanger), stored_posterior("posterior_beam2")[0])
    far = written("far.modes.json", with_mass_beyond_the_ends())
    with pytest.raises(BadInput, match="known mass"):
        update(load_modes(far), build("beam1", hanger))


def with_mass_beyond_the_ends() -> dict[str, Any]:
    """Return the few modes, measured with a known mass at 13 m of a hanger of 12 m."""
    document = changed()
    document["tests"][0]["added_mass"] = {"mass_kg": 25.0, "x_m": 13.0}
    return document


# ---------------------------------------------------------------- stored posteriors


def stored_posterior(name: str) -> tuple[Posterior, dict[str, Any]]:
    """Return a posterior of version 1.0.0 from its document and arrays, and what is expected."""
    kept = calls.golden(name)
    posterior = posterior_from(kept["document"], base64.b64decode(kept["samples"]))
    return posterior, kept["expected"]


STORED = ("posterior_beam2", "posterior_adopted")


@pytest.mark.parametrize("name", STORED)
def test_a_stored_posterior_is_read_and_written_back_as_it_was(name: str) -> None:
    posterior, expected = stored_posterior(name)
    assert list(posterior.names) == expected["names"]
    assert list(posterior.units) == expected["units"]
    assert posterior.samples.shape == (50, len(posterior.names))
    assert posterior.log_likelihood.shape == (50,)
    assert posterior.tension_n[:3] == pytest.approx(expected["tension_n"], rel=1e-12)
    back = json.loads(shm_dump(posterior_document(posterior)))
    document = calls.golden(name)["document"]
    assert outline(without_added(back)) == outline(document)
    assert nearly(without_added(back), document)


def shm_dump(document: object) -> str:
    """Return the text of a document as the store writes it."""
    return importlib.import_module("shm.documents").dump(document)  # type: ignore[no-any-return]


def nearly(one: Any, other: Any) -> bool:
    """Return True for documents that differ by rounding of numbers alone."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(nearly(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(nearly, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-9)
    return bool(one == other)


@pytest.mark.parametrize("name", STORED)
def test_the_class_of_a_stored_posterior_predicts_as_it_did(name: str) -> None:
    """Compare with three stored draws to 1e-3, and with the stored means.

    What is newer in a class, as own weight, has its usual value. The stored means hold corrections
    of ends and sensors, too, of up to 0.5 % of a frequency.
    """
    posterior, expected = stored_posterior(name)
    model = class_of(posterior, load_hanger(calls.ROD))
    assert model.name == posterior.model
    assert set(posterior.names) <= {*model.parameter_names, "sigma"}
    known = np.array(expected["frequencies_hz"])
    theta = parameter_sets(posterior, model)
    frequencies_hz = model.frequencies_hz(theta, known.shape[2])
    assert frequencies_hz.shape == (50, 2, known.shape[2])
    assert frequencies_hz[:3] == pytest.approx(known, rel=1e-3)
    for row in posterior.predicted:
        mean_hz = frequencies_hz[:, PLANES.index(row.plane), row.order - 1].mean()
        assert mean_hz == pytest.approx(row.mean_hz, rel=0.005)


@pytest.mark.parametrize("name", STORED)
def test_the_end_stiffness_of_a_stored_posterior_is_as_it_was(name: str) -> None:
    posterior, expected = stored_posterior(name)
    found = end_stiffness(posterior, load_hanger(calls.ROD))
    assert found.keys() == expected["end_stiffness"].keys()
    for key, values in expected["end_stiffness"].items():
        assert found[key].shape == (50,)
        assert found[key][:3] == pytest.approx(values, rel=1e-6)


def test_a_stored_posterior_of_a_former_version_is_read_without_its_newer_keys() -> None:
    """Leave out what version 0.1.0 did not write: units, remarks, a baseline's check."""
    kept = calls.golden("posterior_beam2")
    document = {
        key: value
        for key, value in kept["document"].items()
        if key not in ("caveats", "baseline_check", "log_occam", "misfit_percent", "reading_off_sd")
    }
    document["parameters"] = {
        name: {key: value for key, value in figures.items() if key != "unit"}
        for name, figures in document["parameters"].items()
    }
    posterior = posterior_from(document, base64.b64decode(kept["samples"]))
    assert posterior.unit("log10_k1") == "N m/rad"
    assert math.isnan(posterior.misfit_percent)
    assert posterior.baseline_check is None


def test_a_stored_posterior_of_other_parameters_is_refused_by_its_end_stiffness() -> None:
    kept = calls.golden("posterior_beam2")
    document = {**kept["document"], "parameters": dict(kept["document"]["parameters"])}
    document["parameters"]["log10_k9"] = document["parameters"].pop("log10_k1")
    posterior = posterior_from(document, base64.b64decode(kept["samples"]))
    with pytest.raises(UsageError, match="log10_k1"):
        end_stiffness(posterior, load_hanger(calls.ROD))


def test_a_stored_posterior_refreshes_on_tests() -> None:
    """Start from the stored draws; the answer is that of an update within Monte Carlo error."""
    tests, hanger = load_modes(calls.SPRUNG), load_hanger(calls.ROD)
    known, _ = stored_posterior("posterior_beam2")
    posterior = refresh(tests, build("beam2", hanger), known, UpdateOptions(SAMPLES, 4))
    golden = calls.golden("update_description")
    median_n = float(np.median(posterior.tension_n))
    assert median_n == pytest.approx(golden["tension_n"]["q50"], rel=0.02)
    assert posterior.log_evidence == pytest.approx(golden["log_evidence"], abs=0.3)
    assert (posterior.seed, posterior.tests) == (4, ("t1",))


# ---------------------------------------------------------------- the same again


def test_another_seed_gives_other_draws() -> None:
    other = calls.update("update_few", SAMPLES, 2)
    assert other["seed"] == 2
    assert other["tension_n"]["mean"] != updated("update_few")["tension_n"]["mean"]


def test_another_process_gives_the_same_document() -> None:
    words = [*calls.UPDATES["update_few"], "--samples", SAMPLES, "--seed", 1, "--json"]
    program = "import sys; from shm_cli.main import run; sys.exit(run(sys.argv[1:]))"
    paths = os.pathsep.join(str(ROOT / each) for each in (".", "daemon", "cli"))
    ended = subprocess.run(
        [sys.executable, "-c", program, *map(str, words)],
        env={**os.environ, "PYTHONPATH": paths, "PYTHONHASHSEED": "77"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    assert {**found, **OF_THE_CLOCK} == {**updated("update_few"), **OF_THE_CLOCK}
