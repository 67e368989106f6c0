"""The steps of the API: they take what the step before gives, with the defaults of the command."""

from __future__ import annotations

import inspect
import math
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import rich_click as click

import shm
from shm.errors import BadInput, UsageError
from shm.gap import GapOptions
from shm.read import write

COMMANDS = {
    ("identify", "command"): {
        "band": "band_hz", "identifier": "identifier", "cross_check": "cross_check",
        "estimator": "estimator", "reference_force_n": "reference_force_n",
        "frequency_allowance": "frequency_allowance", "mains_hz": "mains_hz",
        "window_time_constant_s": "window_time_constant_s",
    },
    ("update", "command"): {
        "model": "model", "seed": "seed", "samples": "samples", "sampler": "sampler",
    },
    ("update", "select_command"): {
        "models": "models", "seed": "seed", "samples": "samples", "sampler": "sampler",
        "class_priors": "class_priors",
    },
    ("gap", "diagnose"): {
        "baseline": "baseline", "without": "without", "hold_out": "hold_out", "seed": "seed",
    },
    ("simulate", "command"): {
        "k1": "k1_n_m_rad", "k2": "k2_n_m_rad", "k3": "k3_n_m_rad", "k4": "k4_n_m_rad",
        "tension_n": "tension_n", "damping": "damping_ratio", "hits": "hits",
        "rate": "sampling_rate_hz", "hammer_x": "hammer_x_m", "amplitude": "amplitude",
        "temperature_c": "temperature_c", "reference_c": "reference_c", "seed": "seed",
    },
}  # fmt: skip


@pytest.mark.parametrize(("verb", "name"), COMMANDS)
def test_defaults_are_those_of_the_command(verb: str, name: str) -> None:
    command: click.Command = getattr(import_module(f"shm_cli.{verb}"), name)
    theirs = command.make_context(verb, [], resilient_parsing=True).params
    step = getattr(shm, {"diagnose": "diagnose", "select_command": "select"}.get(name, verb))
    for option, argument in COMMANDS[verb, name].items():
        default = inspect.signature(step).parameters[argument].default
        same = isinstance(default, float) and math.isnan(default) and math.isnan(theirs[option])
        assert same or default == theirs[option], option


def test_options_of_a_diagnosis_are_those_of_the_step() -> None:
    own = inspect.signature(shm.diagnose).parameters
    assert {name: own[name].default for name in vars(GapOptions())} == vars(GapOptions())


def test_a_simulated_recording_is_that_of_the_command(tmp_path: Path, hanger: shm.Hanger) -> None:
    from shm_cli import example
    from shm_cli.main import run

    call = ["simulate", "--hanger-file", str(example.HANGER_FILE), "--out", str(tmp_path)]
    assert run([*call, "--hits", "1", "--format", "npz", "--seed", "5"]) == 0
    (path,) = tmp_path.glob("*.npz")
    written, ours = (
        shm.read(path),
        shm.simulate(shm.load_hanger(example.HANGER_FILE), hits=1, seed=5),
    )
    assert isinstance(written, shm.Recording)
    for theirs, own in zip(written.channels, ours.channels, strict=True):
        np.testing.assert_allclose(own.values, theirs.values, rtol=1e-12, atol=1e-12)


def test_read_identify_update(tmp_path: Path, hanger: shm.Hanger, recording: shm.Recording) -> None:
    write(recording, tmp_path / "hanger3.csv")
    found = shm.identify(shm.read(str(tmp_path / "hanger3.csv")), hanger=hanger)
    assert (found.test.id, found.test.hanger) == ("hanger3", 3)
    posterior = shm.update(found, hanger, "beam1", samples=200)
    assert posterior.tension_n.mean() == pytest.approx(711e3, abs=3 * posterior.tension_n.std())
    # Within eight seconds a hit a softening of the first mode would hardly show.
    assert posterior.repeatability_sd_n < 0.01 * 711e3


def test_one_test_or_many_identified_or_given_are_taken_alike(
    hanger: shm.Hanger, test_of_711_kn: shm.ModalTest, identified: shm.Identification
) -> None:
    one = shm.update(test_of_711_kn, hanger, "beam1", samples=200)
    listed = shm.update([test_of_711_kn], hanger, "beam1", samples=200)
    np.testing.assert_array_equal(one.samples, listed.samples)
    both = shm.update([test_of_711_kn, identified], hanger, "beam1", samples=200)
    assert both.tests == ("t1", identified.test.id)


def test_a_file_of_another_hanger_is_refused(hanger: shm.Hanger, recording: shm.Recording) -> None:
    with pytest.raises(BadInput, match="the file says hanger 3, the description is of hanger 4"):
        shm.identify(recording, hanger=replace(hanger, id=4), cross_check="none")
    unnamed = shm.identify(
        replace(recording, hanger=None), hanger=replace(hanger, id=4), cross_check="none"
    )
    assert unnamed.test.hanger == 4


def test_a_round_bar_is_the_hanger_of_the_table(hanger: shm.Hanger) -> None:
    """A slack one is not simulated."""
    of_table = {"diameter_m": 0.130, "length_m": 12.0, "elastic_modulus_pa": 200e9,
                "density_kg_m3": 7800, "nominal_tension_n": 711e3}  # fmt: skip
    made = shm.round_bar(3, **of_table)
    for name in ("area_m2", "mass_per_length_kg_m", "bending_stiffness_n_m2"):
        assert getattr(made, name) == pytest.approx(getattr(hanger, name))
    with pytest.raises(BadInput, match=r"id 3: length_m = -1.0 is not a positive number"):
        shm.round_bar(3, **{**of_table, "length_m": -1.0})
    with pytest.raises(UsageError, match="cannot be simulated"):
        shm.simulate(replace(hanger, nominal_tension_n=0.0))


def test_classes_named_must_apply_and_the_usual_ones_are_those_that_do(
    hanger: shm.Hanger, test_of_711_kn: shm.ModalTest, monkeypatch: pytest.MonkeyPatch
) -> None:
    bar = replace(hanger, plate=None)
    monkeypatch.setenv("SHM_MODELS", "beam1,solid0")
    assert shm.select(test_of_711_kn, bar, samples=200).selected.model == "beam1"
    with pytest.raises(UsageError, match="solid0 does not apply to hanger 3"):
        shm.select(test_of_711_kn, bar, models=["beam1", "solid0"])


def test_sampler_priors_and_calibration(hanger: shm.Hanger, test_of_711_kn: shm.ModalTest) -> None:
    hanger = replace(hanger, plate=None)  # whose length is as taped
    plain = shm.update(test_of_711_kn, hanger, "beam1", samples=200)
    read = replace(test_of_711_kn, tension_read_n=711e3, tension_read_sd_n=2e3)
    taught = shm.update(test_of_711_kn, hanger, "beam1", samples=200, calibrated_by=read)
    assert taught.tension_n.std() < 0.7 * plain.tension_n.std()
    with pytest.raises(BadInput, match="no test has a tension_read_n to calibrate by"):
        shm.update(test_of_711_kn, hanger, "beam1", calibrated_by=test_of_711_kn)
    in_kn = replace(read, tension_read_n=711.0, tension_read_sd_n=2.0)
    with pytest.raises(BadInput, match=r"to calibrate by\. Left out: the tension read in test t1"):
        shm.update(test_of_711_kn, hanger, "beam1", calibrated_by=in_kn)
    asked = shm.update(test_of_711_kn, hanger, "beam1", samples=200, sampler="emcee")
    assert asked.method == "emcee"
    with pytest.raises(UsageError, match="there is no sampler 'tmcmc'"):
        shm.update(test_of_711_kn, hanger, "beam1", sampler="tmcmc")
    with pytest.raises(UsageError, match=r"beam9 is not compared. No prior of beam1: give one"):
        shm.select(test_of_711_kn, hanger, ["beam1"], class_priors={"beam9": 1.0})
    one = shm.select(test_of_711_kn, hanger, ["beam1"], samples=200, class_priors={"beam1": 2})
    assert one.probabilities == (1.0,)
