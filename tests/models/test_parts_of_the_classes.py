"""What the classes hand on to other rooms: ends' stiffness, waves, laws, surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models import MODELS, THESIS, AsMade, build
from shm.values import FloatArray
from tests.helpers.hangers import HANGER_3
from tests.helpers.physical_hangers import frequencies_hz

ROD = replace(HANGER_3, plate=None)


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
