from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify import IdentifyOptions
from shm.identify.contract import FoundMode, Measurement
from shm.identify.setup_merging.modal_participation import fitted
from shm.values import ComplexArray, FrequencyResponse, ResponsePoint

FREQUENCY_HZ = np.arange(801) * 0.1
OPTIONS = IdentifyOptions(5.0, 60.0)
PLANTED = ((12.0, 0.01, (1.0, -0.4)), (12.3, 0.02, (0.3, 0.9)), (40.0, 0.005, (-0.6, 1.0)))
NOTHING = np.empty(0)
MODES = [FoundMode(f, 0.0, damping, 0.0, NOTHING, NOTHING) for f, damping, _ in PLANTED]


def _accelerance(
    modes: tuple[tuple[float, float, tuple[float, ...]], ...], tau: float
) -> ComplexArray:
    """Sum of phi s^2 / (s^2 + 2 zeta w s + w^2), s = i w + 1/tau, (points, lines)."""
    s = 2j * np.pi * FREQUENCY_HZ + 1 / tau
    total = np.zeros((2, len(s)), complex)
    for frequency, damping, shape in modes:
        omega = 2 * np.pi * frequency
        total += np.outer(shape, s**2 / (s**2 + 2 * damping * omega * s + omega**2))
    return total


def _measurement(accelerance: ComplexArray, tau: float) -> Measurement:
    points = (ResponsePoint("a"), ResponsePoint("b"))
    response = FrequencyResponse("r", points, FREQUENCY_HZ, accelerance)
    return Measurement("r", points, (), 1.0, response, window_time_constant_s=tau)


def _error(measured: ComplexArray, tau: float, modes: list[FoundMode] = MODES) -> float:
    found = fitted([_measurement(measured, tau)], [modes], OPTIONS)
    assert found is not None
    band = (FREQUENCY_HZ >= 5) & (FREQUENCY_HZ <= 60)
    wanted = measured[:, band]
    return float(np.max(np.abs(found[:, band] - wanted)) / np.max(np.abs(wanted)))


@pytest.mark.parametrize("tau", [np.inf, 2.0])
def test_the_modes_that_were_planted_make_the_whole_response_window_included(tau: float) -> None:
    assert _error(_accelerance(PLANTED, tau), tau) < 1e-8


def test_unknown_lines_are_not_fitted_but_drawn() -> None:
    measured = _accelerance(PLANTED, np.inf)
    holes = measured.copy()
    holes[0, [0, 130]] = np.nan
    found = fitted([_measurement(holes, np.inf)], [MODES], OPTIONS)
    assert found is not None
    np.testing.assert_allclose(found[:, 60:590], measured[:, 60:590], atol=1e-6)


def test_set_ups_stand_below_one_another_and_ambient_records_have_no_fit() -> None:
    measurement = _measurement(_accelerance(PLANTED, np.inf), np.inf)
    both = fitted([measurement, measurement], [MODES, MODES], OPTIONS)
    assert both is not None
    assert both.shape == (4, len(FREQUENCY_HZ))
    assert fitted([replace(measurement, frequency_response=None)], [MODES], OPTIONS) is None
