"""`shm update`, `shm select` and the assumptions they state, from files alone or a workspace."""

from __future__ import annotations

import json
import re
from math import pi, sqrt
from pathlib import Path

import pytest

from shm.assumptions import DEFAULTS
from shm.documents import dump
from shm.modes_document import modes_document
from shm.store import Workspace
from shm.values import PLANES, ModalTest, Mode
from tests.cli.conftest import Shm
from tests.helpers.slow import few_of

QUANTILES = {"mean", "sd", "q05", "q50", "q95", "map"}
QUICK = ("--samples", 100)


THESIS = ("--priors", "thesis")


def call(modes_file: Path, hanger_file: Path, *more: object) -> tuple[object, ...]:
    known = ("update", modes_file, "--hanger-file", hanger_file, "--model", "beam1", "--seed", 5)
    return (*known, *QUICK, "--json", *more)


def test_update_document_and_repeat(shm: Shm, modes_file: Path, hanger_file: Path) -> None:
    ended = shm(*call(modes_file, hanger_file))
    assert ended.code == 0, ended.err
    document = ended.document
    assert set(document) >= {
        "model", "tension_n", "parameters", "log_evidence", "log_evidence_sd", "probability",
        "samples", "effective_sample_size", "r_hat", "predicted", "seconds", "seed",
    }  # fmt: skip
    assert set(document["tension_n"]) == QUANTILES
    own = {"theta_F", "theta_L", "section", "density", "modulus", "sigma"}
    own |= {"inclination", "sag_shape"}
    assert set(document["parameters"]) == own
    assert (document["priors"], document["at_bounds"]) == ("description", [])
    assert document["misfit_percent"] < 1
    assert document["log_occam"] < 0
    assert document["tension_n"]["mean"] == pytest.approx(0.9 * 711e3, rel=0.05)
    # What the description leaves open, mass and length above all, is no part of a repetition.
    assert 0 < 5 * document["repeatability_sd_n"] < document["tension_n"]["sd"]
    assert (document["model"], document["seed"], document["samples"]) == ("beam1", 5, 100)
    assert document["predicted"][0]["measured_hz"] > 0
    again = shm(*call(modes_file, hanger_file)).document
    assert {**again, "seconds": 0} == {**document, "seconds": 0}


@pytest.mark.slow
def test_sampler_emcee_says_so_and_agrees(shm: Shm, modes_file: Path, hanger_file: Path) -> None:
    usual, other = (
        shm(*call(modes_file, hanger_file, *words)).document
        for words in ((), ("--sampler", "emcee"))
    )
    assert (usual["sampler"], usual["method"]) == ("importance", "importance")
    assert (other["sampler"], other["method"]) == ("emcee", "emcee")
    assert "Sampled by emcee, because it was asked for." in other["caveats"]
    assert not any("emcee" in caveat for caveat in usual["caveats"])
    found = other["tension_n"]["q50"]
    assert found == pytest.approx(usual["tension_n"]["q50"], abs=usual["tension_n"]["sd"])


def test_priors_of_thesis(shm: Shm, modes_file: Path, hanger_file: Path) -> None:
    document = shm(*call(modes_file, hanger_file, *THESIS)).document
    assert set(document["parameters"]) == {"theta_F", "theta_L", "sigma"}
    assert document["priors"] == "thesis"
    assert document["repeatability_sd_n"] is None


def test_tension_leads_select(
    shm: Shm, modes_file: Path, hanger_file: Path, tmp_path: Path
) -> None:
    limited = tmp_path / "limited.toml"
    limits = "\n[hanger.limits]\ntension_max_n = 900e3\ntension_min_n = 300e3\n"
    limited.write_text(hanger_file.read_text() + limits)
    ended = shm("select", modes_file, "--hanger-file", limited, "--models", "beam1", *QUICK)
    told = " ".join(ended.out.split())
    at = [
        told.index(words)
        for words in ("Tension 6", "Repeatability", "exceeds its limit: below", "slack: below")
    ]
    assert at == sorted(at)
    assert "absolute" in told[: at[1]]
    averaged = shm(
        "select", modes_file, "--hanger-file", limited, "--models", "beam1", *QUICK, "--json"
    ).document["averaged"]
    assert averaged["probability_above_limit"] == averaged["probability_slack"] == 0
    assert averaged["tension_n"]["q05"] < 0.9 * 711e3 < averaged["tension_n"]["q95"]


@pytest.mark.slow
def test_measured_tension_calibrates(
    shm: Shm, modes_file: Path, hanger_file: Path, tmp_path: Path
) -> None:
    weighed = json.loads(modes_file.read_text(encoding="utf-8"))
    read = {"tension_read_n": 0.9 * 711e3, "tension_read_sd_n": 0.001 * 711e3}
    weighed["tests"] = [test | read for test in weighed["tests"]]
    known = tmp_path / "weighed.modes.json"
    known.write_text(json.dumps(weighed), encoding="utf-8")
    plain = shm(*call(modes_file, hanger_file)).document["tension_n"]
    ended = shm(*call(modes_file, hanger_file, "--calibrated-by", known))
    assert ended.code == 0, ended.err
    found = ended.document["tension_n"]
    assert found["sd"] < 0.5 * plain["sd"]
    assert found["mean"] == pytest.approx(0.9 * 711e3, abs=4 * found["sd"])
    assert shm(*call(modes_file, hanger_file, "--calibrated-by", modes_file)).code == 3
    assert shm(*call(modes_file, hanger_file, *THESIS, "--calibrated-by", known)).code == 2


def test_select_ranks_the_models(shm: Shm, modes_file: Path, hanger_file: Path) -> None:
    ended = shm(
        "select", modes_file, "--hanger-file", hanger_file, "--models", "beam1, beam1",
        *QUICK, "--json",
    )  # fmt: skip
    document = ended.document
    assert document["selected"] == document["models"][0]["model"]
    assert sum(model["probability"] for model in document["models"]) == pytest.approx(1)


@pytest.mark.slow
def test_priors_of_classes_may_be_stated(shm: Shm, modes_file: Path, hanger_file: Path) -> None:
    asked = ("select", modes_file, "--hanger-file", hanger_file, "--models", "beam1,beam2", *QUICK)
    sure = shm(*asked, "--prior", "beam1=1,beam2=1e-99", "--json").document
    assert {each["model"]: each["probability"] for each in sure["models"]}["beam1"] > 0.99
    for wrong in ("beam1", "beam1=1", "beam1=1,beam2=x"):
        ended = shm(*asked, "--prior", wrong)
        assert (ended.code, "prior" in ended.err.lower()) == (2, True), ended.err
    assert "No prior of beam2: give one of each" in shm(*asked, "--prior", "beam1=0.5").err
    other = shm(*asked, "--prior", "beam1=0.5,beam2=0.5,beam9=0.1")
    assert "beam9 is not compared. Give" in " ".join(other.err.split())


def test_the_tables_name_units_and_intervals(shm: Shm, modes_file: Path, hanger_file: Path) -> None:
    updated = shm("update", modes_file, "--hanger-file", hanger_file, "--model", "beam1", *QUICK)
    assert re.search(r"Tension \d+ kN \(90 % credible interval", updated.out)
    assert "R-hat" in updated.out
    selected = shm("select", modes_file, "--hanger-file", hanger_file, "--models", "beam1", *QUICK)
    assert "tension, kN" in selected.out
    assert "interval" in selected.out


def _clamped_string(
    folder: Path, diameter_m: float, length_m: float, tension_n: float
) -> tuple[Path, Path]:
    """Its description, and its first modes: n/(2 L) sqrt(T/m), raised by its stiffness (Morse)."""
    hanger = folder / "H.toml"
    hanger.write_text(
        f"[[hanger]]\nid = 3\ndiameter_m = {diameter_m}\nlength_m = {length_m}\n"
        f"elastic_modulus_pa = 200e9\ndensity_kg_m3 = 7850\nnominal_tension_n = {tension_n}\n"
    )
    mass_kg_m, bending = 7850 * pi * diameter_m**2 / 4, 200e9 * pi * diameter_m**4 / 64
    slack = sqrt(bending / tension_n) / length_m
    modes = tuple(
        Mode(
            plane,
            n,
            n / (2 * length_m) * sqrt(tension_n / mass_kg_m)
            * (1 + 2 * slack + (4 + (n * pi) ** 2 / 2) * slack**2),
        )
        for plane in PLANES
        for n in range(1, 6)
    )  # fmt: skip
    path = folder / "t1.modes.json"
    path.write_text(dump(modes_document([ModalTest("t1", modes, 3)])))
    return path, hanger


@pytest.mark.parametrize(
    ("unit", "diameter_m", "length_m", "tension_n"),
    [("N", 0.5e-3, 0.65, 5.4), ("kN", 0.012, 6.0, 20e3), ("MN", 0.2, 100.0, 12e6)],
    ids=["string", "tie rod", "cable"],
)
def test_tensions_are_told_in_the_unit_that_fits_them(
    shm: Shm, tmp_path: Path, unit: str, diameter_m: float, length_m: float, tension_n: float
) -> None:
    modes, hanger = _clamped_string(tmp_path, diameter_m, length_m, tension_n)
    updated = shm("update", modes, "--hanger-file", hanger, "--model", "beam1", *QUICK)
    assert updated.code == 0, updated.err
    stated = rf"Tension ([\d.]+) {unit} \(90 % credible interval ([\d.]+) to ([\d.]+) {unit}"
    (found,) = re.findall(stated, " ".join(updated.out.split()))
    mean, *rest = map(float, found)
    expected = tension_n / {"N": 1.0, "kN": 1e3, "MN": 1e6}[unit]
    assert mean == pytest.approx(expected, rel=0.05)
    assert min(rest) > 0
    selected = shm("select", modes, "--hanger-file", hanger, "--models", "beam1", *QUICK)
    told = " ".join(selected.out.split())
    assert f"tension, {unit}" in told
    low, high = map(float, re.findall(r"([\d.]+) to ([\d.]+)", told)[0])
    assert 0 < low < high


def test_tests_of_the_workspace_are_taken(on_bridge: Shm, modes_file: Path) -> None:
    """The latest of a hanger; a file may name its hanger."""
    document = on_bridge.json("update", "--hanger", 3, "--model", "beam1", *QUICK)
    assert document["tests"] == ["t2"]
    assert document["tension_n"]["mean"] == pytest.approx(0.8 * 711e3, rel=0.05)
    assert on_bridge.json("update", modes_file, "--model", "beam1", *QUICK)["hanger"] == 3


def test_other_hangers_file(shm: Shm, hanger_file: Path, modes_file: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.modes.json"
    other.write_text(json.dumps({**json.loads(modes_file.read_text()), "hanger": 7}))
    ended = shm("update", other, "--hanger-file", hanger_file, "--model", "beam1", *QUICK)
    assert ended.code == 0
    first = " ".join(ended.out.split())
    said = "says that it is of hanger 7, the description is of hanger 3: right file?"
    assert first.startswith(f"Doubtful: test t9. It {said}")


def test_impossible_modes_are_doubted(
    shm: Shm, hanger_file: Path, modes_file: Path, tmp_path: Path
) -> None:
    """A 12 m hanger's modes by the description of one of 9 m; by its own they are not doubted."""
    shorter = tmp_path / "nine.toml"
    shorter.write_text(hanger_file.read_text().replace("length_m = 12.0", "length_m = 9.0"))
    ended = shm("update", modes_file, "--hanger-file", shorter, "--model", "beam1", *QUICK)
    assert ended.code == 0
    assert ended.out.startswith("Doubtful: test t9. No tension and no ends of hanger 3")
    assert "right hanger, right description?" in " ".join(ended.out.split())
    (doubt,) = shm(
        "update", modes_file, "--hanger-file", shorter, "--model", "beam1", *QUICK, "--json"
    ).document["doubts"]
    assert doubt.startswith("Doubtful: test t9.")
    own = shm("update", modes_file, "--hanger-file", hanger_file, "--model", "beam1", *QUICK)
    assert "Doubtful" not in own.out + own.err


@pytest.mark.parametrize(
    "command", [("update", "--model", "beam1"), ("select", "--models", "beam1")]
)
def test_a_mode_that_is_left_out_is_said(
    shm: Shm, modes_file: Path, hanger_file: Path, command: tuple[str, ...]
) -> None:
    document = json.loads(modes_file.read_text(encoding="utf-8"))
    mode = document["tests"][0]["modes"][0]
    mode |= {"irregular": True, "frequency_hz": 1.2 * mode["frequency_hz"]}
    modes_file.write_text(json.dumps(document), encoding="utf-8")
    ended = shm(*command, modes_file, "--hanger-file", hanger_file, *QUICK, "--json")
    assert f"Left out: {mode['plane']} {mode['order']} of test" in ended.err
    found = ended.document["models"][0] if command[0] == "select" else ended.document
    assert found["tension_n"]["mean"] == pytest.approx(0.9 * 711e3, rel=0.05)
    assert len(found["predicted"]) == len(document["tests"][0]["modes"]) - 1


@pytest.mark.parametrize(
    "command", few_of([["update", "--model", "beam1"], ["select", "--models", "beam1"]], 1)
)
def test_a_class_that_misses_the_frequencies_by_far_is_said(
    shm: Shm, modes_file: Path, hanger_file: Path, command: tuple[str, ...]
) -> None:
    call = (*command, modes_file, "--hanger-file", hanger_file, *QUICK, "--json")
    sound = shm(*call).document
    assert not any("misses the measured frequencies" in each for each in sound["caveats"])
    document = json.loads(modes_file.read_text(encoding="utf-8"))
    for test in document["tests"]:
        test["modes"] = [mode | {"order": mode["order"] + 1} for mode in test["modes"]]
    modes_file.write_text(json.dumps(document), encoding="utf-8")
    ended = shm(*call)
    assert ended.code == 0
    said = " ".join(ended.document["caveats"])
    assert "beam1 misses the measured frequencies by" in said
    assert "Check the orders of the modes and the description" in said
    assert "misses" not in ended.err  # in one place, in one wording


@pytest.fixture
def overridden(hanger_file: Path, tmp_path: Path) -> Path:
    """Hanger 3, whose owner has weighed the sensors."""
    path = tmp_path / "weighed.toml"
    text = hanger_file.read_text(encoding="utf-8")
    row = '[assumptions]\naccelerometer_mass_kg = {value = 0.2, reason = "weighed"}\n\n'
    path.write_text(row + text, encoding="utf-8")
    return path


def test_settings_lists_assumptions(shm: Shm, empty: Workspace, overridden: Path) -> None:
    listed = shm("settings", "--assumptions", "--json").document
    assert listed["schema"] == "shm.assumptions/1"
    assert list(listed["assumptions"]) == list(DEFAULTS)
    sensor = listed["assumptions"]["accelerometer_mass_kg"]
    assert (sensor["value"], sensor["sd"], sensor["unit"]) == (0.05, 0.05, "kg")
    assert sensor["from"] == "default"
    printed = shm("settings", "--assumptions").out
    assert all(f"{name} = " in printed for name in DEFAULTS)
    path = Path(empty.bridge.source)
    own = "[assumptions]\nend_restraint = [3, 1000]\n"
    path.write_text(own + path.read_text(encoding="utf-8"), encoding="utf-8")
    listed = shm("--workspace", empty.folder, "settings", "--assumptions", "--json").document
    ends = listed["assumptions"]["end_restraint"]
    assert (ends["lower"], ends["from"]) == (3.0, "bridge.toml")
    ended = shm("settings", "--assumptions", "--hanger-file", overridden)
    assert "accelerometer_mass_kg = 0.2 ± 0.05 kg (bridge.toml)\n    weighed" in ended.out


def test_update_and_select_name_overridden_rows(
    shm: Shm, modes_file: Path, hanger_file: Path, overridden: Path
) -> None:
    calls = (("update", "--model", "beam1"), ("select", "--models", "beam1"))
    for verb, *model in calls:
        document = shm.json(verb, modes_file, "--hanger-file", overridden, *model, *QUICK)
        (name,) = document["assumptions"]
        assert name == "accelerometer_mass_kg"
        assert document["assumptions"][name]["reason"] == "weighed"
        plain = shm.json(verb, modes_file, "--hanger-file", hanger_file, *model, *QUICK)
        assert "assumptions" not in plain
    model = ("--model", "beam1", "--samples", 100)
    assert (
        "accelerometer_mass_kg = 0.2"
        in shm("update", modes_file, "--hanger-file", overridden, *model).out
    )
    assert "ssum" not in shm("update", modes_file, "--hanger-file", hanger_file, *model).out


def test_misspelled_assumption_has_hint(shm: Shm, modes_file: Path, overridden: Path) -> None:
    text = overridden.read_text(encoding="utf-8")
    overridden.write_text(text.replace("accelerometer_mass_kg", "acelerometer_mass_kg"))
    ended = shm("update", modes_file, "--hanger-file", overridden, "--model", "beam1")
    assert ended.code == 3
    assert "Did you mean accelerometer_mass_kg?" in ended.err
    assert "line 2" in ended.err
