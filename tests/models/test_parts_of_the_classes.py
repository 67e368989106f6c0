"""What the classes hand on to other rooms: ends' stiffness, waves, laws, surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import UsageError
from shm.models import DESCRIPTION, MODELS, THESIS, build, class_of, end_stiffness
from shm.models.as_made import AsMade
from shm.models.base import Conditions
from shm.models.end_effects import EndWaves
from shm.values import AddedMass, FloatArray, Posterior
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_posterior, a_test
from tests.helpers.physical_hangers import frequencies_hz

ROD = replace(HANGER_3, plate=None)


def of_beam_2(**changes: object) -> Posterior:
    names = ("theta_L", "theta_F", "log10_k1", "log10_k2", "log10_k3", "log10_k4")
    values = np.tile([1.0, 0.9, 6.0, 7.0, 6.5, 7.5], (3, 1))
    values[1, 2] = 5.0
    return replace(
        a_posterior("beam2"),
        names=names,
        samples=values,
        most_probable=values[0],
        log_likelihood=np.zeros(3),
        priors=THESIS,
        **changes,
    )


def test_the_common_stiffness_of_the_ends_is_the_harmonic_mean() -> None:
    """2/(1/k_deck + 1/k_arch), the deck's springs being k1, k2 and the arch's k3, k4."""
    found = end_stiffness(of_beam_2(), ROD)
    first = np.array([1e6, 1e5, 1e6])
    np.testing.assert_allclose(
        found["transverse_end_stiffness"], np.log10(2 / (1 / first + 10**-6.5))
    )
    np.testing.assert_allclose(
        found["longitudinal_end_stiffness"], np.log10(2 / (10**-7.0 + 10**-7.5)) * np.ones(3)
    )
    assert end_stiffness(replace(a_posterior("beam1"), priors=THESIS), ROD) == {}


def test_a_posterior_of_other_parameters_is_made_again() -> None:
    posterior = replace(of_beam_2(), priors=DESCRIPTION)
    assert isinstance(class_of(posterior, ROD), AsMade)
    assert not isinstance(class_of(of_beam_2(), ROD), AsMade)
    with pytest.raises(UsageError, match="made without section, density, modulus") as refused:
        end_stiffness(posterior, ROD)
    assert "shm ingest --again t1" in str(refused.value)


@pytest.mark.parametrize("name", MODELS)
def test_a_bar_as_made_hands_on_what_its_class_says(name: str) -> None:
    own = MODELS[name](HANGER_3)
    made = AsMade(own)
    test = a_test(added_mass=AddedMass(8.0, 2.0))
    assert made.expensive == own.expensive
    assert (
        made.conditions(test) == own.conditions(test) == Conditions(added_mass=AddedMass(8.0, 2.0))
    )
    assert (made.name, made.title) == (own.name, own.title)


def test_a_baseline_of_beam_3_shears_and_turns_as_its_class() -> None:
    """The general model's own elements against the transcendental equation of Timoshenko."""
    model = build("beam3", ROD, THESIS)
    values = {"theta_F": 0.9, "theta_L": 1.0, "log10_k1": 6.0, "log10_k2": 7.0}
    values |= {"log10_k3": 6.5, "log10_k4": 7.5}
    theta = np.array([[values[name] for name in model.parameter_names]])

    def made_hz(name: str) -> FloatArray:
        made = AsMade(MODELS[name](ROD), with_terms=False)
        own = made.pack({each: values.get(each, 0.0) for each in made.parameter_names})
        return frequencies_hz(made.physical(own[None]), 6)

    np.testing.assert_allclose(made_hz("beam3"), model.frequencies_hz(theta, 6), rtol=5e-5)
    assert np.abs(made_hz("beam3") / made_hz("beam2") - 1).max() > 1e-3


def test_an_end_spring_is_stiff_against_bending_stiffness_times_wave_number() -> None:
    """sqrt(EI T + (EI n pi / L)^2): of a string EI and T alone, of a beam EI and n pi / L."""
    ei, tension = ROD.bending_stiffness_n_m2, ROD.nominal_tension_n
    for order in (1, 4):
        expected = np.sqrt(ei * tension + (ei * order * np.pi / ROD.length_m) ** 2)
        for one in (build("beam1", ROD), build("beam1", ROD, THESIS)):
            assert one.wave_stiffness_n_m_rad(order) == pytest.approx(expected, rel=1e-12)


def test_waves_of_the_ends_are_those_of_the_named_values() -> None:
    """Each parameter set with its own tension and length, each datum with its plane's springs."""
    model = build("beam2", ROD, THESIS)
    named = {"theta_F": 0.9, "theta_L": 1.1, "log10_k1": 6.0, "log10_k2": 7.0}
    theta = model.pack({**named, "log10_k3": 6.5, "log10_k4": 7.5})[None]
    frequency_hz, plane = np.array([[6.0, 20.0]]), np.array([0, 1])
    found = model.end_waves(theta, frequency_hz, plane)
    for waves, springs in zip(found, ([[1e6, 1e7]], [[10**6.5, 10**7.5]]), strict=True):
        expected = EndWaves.of(
            frequency_hz,
            np.array([[0.9 * ROD.nominal_tension_n]]),
            np.array([[ROD.bending_stiffness_n_m2]]),
            np.array([[ROD.mass_per_length_kg_m]]),
            np.array([[1.1 * ROD.length_m]]),
            np.array(springs),
        )
        for name in vars(expected):
            np.testing.assert_allclose(getattr(waves, name), getattr(expected, name), rtol=1e-12)
