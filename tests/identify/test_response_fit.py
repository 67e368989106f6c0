from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import NotIdentifiable
from shm.identify import IDENTIFIERS, IdentifyOptions
from shm.identify.contract import Measurement
from shm.values import FrequencyResponse, ResponsePoint

OPTIONS = IdentifyOptions(2.0, 50.0)
MODES = ((6.0, 0.004, (1.0, 0.4)), (6.1, 0.003, (-0.3, 1.0)), (31.0, 0.002, (0.7, 1.0)))


def _measurement(spacing_hz: float = 0.05, time_constant_s: float = np.inf) -> Measurement:
    """Exact accelerances of `MODES`, seen through an exponential window."""
    frequency_hz = np.arange(0, 62.5, spacing_hz)
    s = 2j * np.pi * frequency_hz + 1 / time_constant_s
    accelerance = np.zeros((2, len(s)), complex)
    for frequency, damping, shape in MODES:
        omega = 2 * np.pi * frequency
        accelerance += np.outer(shape, s**2 / (s**2 + 2 * damping * omega * s + omega**2))
    points = (ResponsePoint("a", "transverse", 1.0), ResponsePoint("b", "longitudinal", 1.0))
    response = FrequencyResponse("frf.uff", points, frequency_hz, accelerance)
    return Measurement(
        "frf.uff", points, (), 128.0, response, window_time_constant_s=time_constant_s
    )


def test_exact_responses_give_exact_modes() -> None:
    found = IDENTIFIERS["frf"](_measurement(), OPTIONS).modes
    for mode, (frequency, damping, shape) in zip(found, MODES, strict=True):
        assert mode.frequency_hz == pytest.approx(frequency, rel=1e-7)
        assert mode.damping_ratio == pytest.approx(damping, rel=1e-4)
        np.testing.assert_allclose(mode.shape, np.array(shape), atol=1e-3)


def test_the_window_of_the_responses_is_taken_off_the_damping() -> None:
    found = IDENTIFIERS["frf"](_measurement(time_constant_s=2.0), OPTIONS).modes
    assert [m.damping_ratio for m in found] == pytest.approx([m[1] for m in MODES], rel=1e-3)


def test_a_window_on_the_ring_downs_too_is_left_for_identify_to_take_off() -> None:
    measurement = replace(_measurement(time_constant_s=2.0), decay_time_constant_s=2.0)
    found = IDENTIFIERS["frf"](measurement, OPTIONS).modes
    expected = [damping + 1 / (2 * np.pi * 2.0 * f) for f, damping, _ in MODES]
    assert [m.damping_ratio for m in found] == pytest.approx(expected, rel=0.01)


def test_lines_that_are_unknown_are_left_out() -> None:
    measurement = _measurement()
    assert measurement.frequency_response is not None
    accelerance = measurement.frequency_response.accelerance.copy()
    accelerance[:, 0] = np.nan
    accelerance[:, -100:] = np.nan
    broken = replace(measurement.frequency_response, accelerance=accelerance)
    found = IDENTIFIERS["frf"](replace(measurement, frequency_response=broken), OPTIONS).modes
    assert [m.frequency_hz for m in found] == pytest.approx([m[0] for m in MODES], rel=1e-6)


def test_too_few_lines_or_none_are_refused() -> None:
    with pytest.raises(NotIdentifiable, match="too few"):
        IDENTIFIERS["frf"](_measurement(spacing_hz=5.0), OPTIONS)
    with pytest.raises(NotIdentifiable, match="nobody hit"):
        IDENTIFIERS["frf"](replace(_measurement(), frequency_response=None), OPTIONS)
